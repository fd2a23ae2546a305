"""The command that resumes a run, as messages and ``revolve status`` have it."""

from pathlib import Path

from coordinator.storage.hints import FLAGS, keep_flags, resume_command, stopped


def test_the_kept_flags_give_the_same_command_as_the_message(tmp_path: Path) -> None:
    flags = ["--workers", "0", "--listen", "hub", "--tls-ca", "my files/ca.pem"]
    keep_flags(tmp_path, flags)
    assert stopped(tmp_path, flags) == f"stopped; to resume: {resume_command(tmp_path)}"
    assert resume_command(tmp_path).endswith("--listen hub --tls-ca 'my files/ca.pem'")
    keep_flags(tmp_path, [])
    assert resume_command(tmp_path) == f"revolve resume {tmp_path}"


def test_a_missing_or_damaged_file_gives_no_flags(tmp_path: Path) -> None:
    alone = f"revolve resume {tmp_path}"
    assert resume_command(tmp_path) == alone
    (tmp_path / FLAGS).write_bytes(b"\xff")
    assert resume_command(tmp_path) == alone
    (tmp_path / FLAGS).write_bytes(b"x" * 5000)
    assert resume_command(tmp_path) == alone
    (tmp_path / FLAGS).write_text("a\x1b[2J\n")
    assert resume_command(tmp_path) == f"{alone} 'a [2J'"
