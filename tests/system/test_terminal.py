"""Interrupts, closed pipes, full devices and completion at a terminal."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from revolve import command as revolve
from revolve.cli.commands import COMMANDS
from revolve.cli.completion import main
from schema.experiment.file import shipped_experiments
from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("awaited", ["run.json", "address"])
def test_ctrl_c_pressed_twice_while_processes_start(
    workspace: Workspace, awaited: str
) -> None:
    """Interrupt the process group twice while its processes import modules."""
    run = workspace.folder / "run"
    process = workspace.start("run", "scenario1", "--out", str(run))
    wait_until((run / awaited).exists, awaited)
    os.killpg(process.pid, signal.SIGINT)
    time.sleep(0.1)  # interval between two key presses
    os.killpg(process.pid, signal.SIGINT)
    _, output = process.communicate(timeout=60)
    assert "Traceback" not in output
    assert f"stopped; to resume: revolve resume {run}" in output
    assert process.returncode == 130


def test_ctrl_c_during_the_import_of_an_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The engine replaces the interrupt by an ImportError."""
    (tmp_path / "engine_of_a_test.py").write_text(
        "try:\n    raise KeyboardInterrupt\n"
        "except KeyboardInterrupt as error:\n    raise ImportError('no') from error\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(COMMANDS, "status", ("engine_of_a_test", "is odd"))
    assert revolve.main(["status"]) == 130


def _run_in_shell(
    words: str, unbuffered: str = "", output: int | None = None
) -> tuple[int, str]:
    """Run ``revolve`` in a shell; return exit code and standard error."""
    done = subprocess.run(
        ["sh", "-c", f'"$1" -m revolve {words}', "sh", sys.executable],
        stdout=output,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        check=False,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("words", ["--help", "run scenario1 --out x"])
def test_closed_output_is_refused_before_the_command_starts(words: str) -> None:
    expected = (2, "revolve: standard output is closed\n")
    assert _run_in_shell(f"{words} >&-") == expected
    assert not (ROOT / "x").exists()


@pytest.mark.parametrize(("words", "unbuffered"), [("--help", "1"), ("run --help", "")])
def test_output_to_a_full_device_is_reported(words: str, unbuffered: str) -> None:
    expected = (2, "revolve: standard output: no space left on device\n")
    assert _run_in_shell(f"{words} > /dev/full", unbuffered) == expected


@pytest.mark.parametrize(("words", "unbuffered"), [("--help", "1"), ("run --help", "")])
def test_closed_pipe_ends_the_command_without_a_message(
    words: str, unbuffered: str
) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        assert _run_in_shell(words, unbuffered, writer) == (1, "")
    finally:
        os.close(writer)


def test_other_errors_are_not_reported_as_output_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(revolve, "_overview", lambda: Path("/nowhere").read_text())
    with pytest.raises(FileNotFoundError):
        revolve.main([])


def _terminal_output(*words: str) -> str:
    """Return the output of a command whose standard error is a terminal."""
    try:
        screen, terminal = os.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminal can be opened: {error}")
    with subprocess.Popen(
        [sys.executable, "-m", "revolve", *words],
        stdout=subprocess.DEVNULL,
        stderr=terminal,
        cwd=ROOT,
    ):
        os.close(terminal)
        shown = b""
        # Reading fails once the last process has closed the terminal.
        with os.fdopen(screen, "rb", buffering=0) as file, suppress(OSError):
            while more := file.read(4096):
                shown += more
    return shown.decode()


def test_benchmarks_show_progress() -> None:
    assert "100%" in _terminal_output("bench", "evaluate", "--robots", "1")


_COMPLETE = """
source ./script
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_shtab_revolve revolve "${!#}" ""
printf '%s\\n' "${COMPREPLY[@]}"
"""


def script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


def test_bash_completes_commands_flags_experiments_and_folders(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "script").write_text(script("bash", capsys))
    (tmp_path / "runs" / "a").mkdir(parents=True)
    (tmp_path / "mine.toml").touch()
    (tmp_path / "mine.yaml").touch()
    for line, expected in (
        ("resu", {"resume"}),
        ("robot s", {"show", "simulate"}),
        ("robot render x --wi", {"--width"}),
        ("run scenario3", {"scenario3"}),
        ("run scenario1-w", {"scenario1-warm"}),
        ("run mi", {"mine.toml"}),
        ("robot check a.yaml --experiment mi", {"mine.toml"}),
        ("resume r", {"runs"}),
        ("run scenario1 --connect r", {"runs"}),
        ("completion ", {"bash", "zsh", "fish"}),
        ("help st", {"status"}),
    ):
        words = ["revolve", *line.split(" ")]
        done = subprocess.run(
            ["bash", "-c", _COMPLETE, "bash", *words],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert set(done.stdout.split()) == expected, line


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_get_all_commands_and_experiments(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both scripts were tried by hand; neither shell is needed for the tests."""
    text = script(shell, capsys)
    for name in (*COMMANDS, *shipped_experiments()):
        assert name.split()[-1] in text
    assert "_revolve_experiments" in text
