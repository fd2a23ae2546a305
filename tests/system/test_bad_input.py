"""Checks that user errors are reported in one line with a nonzero exit code."""

import os
import re
import shutil
import signal
import socket
import subprocess
from pathlib import Path
from typing import Any

import pytest

from revolve.command import main

pytestmark = pytest.mark.system

Workspace = Any


def _refused(workspace: Workspace, *words: str) -> str:
    output: str = workspace.run(*words, code=2)
    assert len(output.strip().splitlines()) == 1, output
    return output


def _document(workspace: Workspace, text: str) -> str:
    (workspace.folder / "mine.toml").write_text(text)
    return "mine.toml"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "a"\nbirth = 3', "'births'"),
        ('name = "a"\n[selection]\npopulaton = 3', "selection.populaton"),
        ('name = "a"\nbirths = "many"', "births"),
        ('name = "a"\n[space]\nmin_parts = 9\nmax_parts = 8', "space.min_parts"),
        (
            'name = "a"\n[space]\npart_types = ["schema.parts:CROE"]',
            "schema.parts:CORE",
        ),
        ('name = "a"\n[fitness]\nfunction = "worker.fitness:thesiss"', "thesis"),
        ("name = ", "not valid TOML"),
    ],
)
def test_invalid_experiment_is_refused(
    workspace: Workspace, text: str, message: str
) -> None:
    output = _refused(
        workspace, "run", _document(workspace, text), "--out", "x", "--quiet"
    )
    assert "mine.toml" in output
    assert message in output
    assert not (workspace.folder / "x").exists()


def test_restriction_that_no_robot_satisfies_ends_the_run_with_the_reason(
    workspace: Workspace,
) -> None:
    text = 'name = "a"\n[space]\npart_types = ["schema.parts:CORE", '
    text += '"schema.parts:ACTIVE_HINGE"]\nmin_parts = 29\nmax_parts = 30'
    words = ("--out", "x", "--quiet", "--in-process", "--births", "15")
    assert "space" in _refused(workspace, "run", _document(workspace, text), *words)


def test_a_seed_above_64_bits_is_refused(workspace: Workspace) -> None:
    words = ("scenario1", "--seed", str(2**64), "--out", "x", "--quiet")
    limits = "--seed: must be a whole number in 0..18446744073709551615, got"
    assert limits in _refused(workspace, "run", *words)


@pytest.mark.parametrize(
    "flag",
    [
        *("--access", "--connect", "--fleet", "--listen"),
        *("--tls-ca", "--tls-certificate", "--tls-key"),
    ],
)
def test_a_flag_of_the_network_is_refused_where_nothing_is_sent(
    workspace: Workspace, flag: str
) -> None:
    words = ("scenario1", flag, "tcp/127.0.0.1:1", "--in-process", "--out", "x")
    message = f"{flag} has no effect with --in-process"
    assert message in _refused(workspace, "run", *words)
    assert not (workspace.folder / "x").exists()


def test_certificates_of_the_environment_are_not_those_of_a_run_in_one_process(
    workspace: Workspace,
) -> None:
    words = ("run", "scenario1", "--births", "15", "--in-process", "--quiet")
    gone = {"REVOLVE_TLS_CA": "gone"}
    process = workspace.start(*words, "--out", "x", environment=gone)
    assert process.wait(60) == 0


def test_misspelt_names_are_reported_with_the_nearest_name(
    workspace: Workspace,
) -> None:
    assert "'resume'" in _refused(workspace, "resum", "x")
    assert "'scenario1'" in _refused(workspace, "run", "senario1")
    output = _refused(workspace, "run", "thesys")
    assert "; did you mean 'thesis'?" in output
    assert re.search("scenario3, .*thesis, .*or give a path", output)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("exp.yaml", "exp.yaml: the file of an experiment must end in .toml, got"),
        ("gone.yaml", "got '.yaml', and there is no such file"),
        ("gone.toml", "gone.toml: cannot be read: No such file"),
        ("scenario1.toml", "; did you mean 'scenario1', which is shipped?"),
        ("mine", "mine: no such experiment; did you mean 'mine.toml'?"),
        ("sub", "sub: is a folder; an experiment is a .toml file or a shipped name"),
    ],
)
def test_what_is_no_experiment_is_told_apart(
    name: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    for file in ("exp.yaml", "mine.toml"):
        (tmp_path / file).write_text('name = "a"')
    assert main(["run", name, "--out", "x"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert message in said


def test_a_viewer_needs_a_screen_before_the_run_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    assert main(["run", "scenario1", "--view", "--out", "x"]) == 2
    said = capsys.readouterr().err
    assert "no screen here" in said
    assert said.endswith("beside it: revolve view --connect x --serve\n")
    assert list(tmp_path.iterdir()) == []


def test_a_limit_of_speed_needs_an_arena(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "scenario1", "--speed", "2"]) == 2
    message = "revolve: --speed: limits arenas, and there is none in scenario1\n"
    assert capsys.readouterr().err.endswith(message)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("robot.yaml", "body: {type: Cor, id: c}\n", "Core"),
        ("robot.yaml", "body: [\n", "robot.yaml"),
        ("robot.pb", "\x01\x02\x03", "robot.pb"),
    ],
)
def test_invalid_robot_file_is_refused(
    workspace: Workspace, name: str, content: str, message: str
) -> None:
    (workspace.folder / name).write_text(content)
    assert message in _refused(workspace, "robot", "check", name)


def test_folder_with_other_files_is_refused_and_unchanged(workspace: Workspace) -> None:
    (workspace.folder / "used").mkdir()
    (workspace.folder / "used" / "thesis.pdf").write_text("mine")
    assert "thesis.pdf" in _refused(workspace, "run", "scenario1", "--out", "used")
    assert (workspace.folder / "used" / "thesis.pdf").read_text() == "mine"


def test_folder_without_a_run_is_refused(workspace: Workspace) -> None:
    assert "nowhere" in _refused(workspace, "resume", "nowhere")
    assert "nowhere" in _refused(workspace, "compare", "nowhere", "nowhere")


def test_port_in_use_is_refused(workspace: Workspace) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        words = ("coordinator", "scenario1", "--out", "x", "--listen", address)
        assert "in use" in _refused(workspace, *words)


def test_listening_on_the_network_needs_certificates(
    workspace: Workspace,
) -> None:
    words = ("coordinator", "scenario1", "--out", "x", "--listen", "tcp/0.0.0.0:0")
    assert "tls/" in _refused(workspace, *words)


def test_worker_without_a_coordinator_reports_it_and_retries(
    workspace: Workspace,
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    worker = workspace.start("worker", "--connect", f"tcp/127.0.0.1:{port}")
    line = worker.stderr.readline()
    assert f"127.0.0.1:{port}" in line
    assert worker.poll() is None
    worker.send_signal(signal.SIGINT)
    assert worker.wait(30) == 0


def test_workers_of_a_run_in_one_process_are_refused(workspace: Workspace) -> None:
    words = ("run", "scenario1", "--in-process", "--workers", "3")
    output = workspace.run(*words, code=2)
    line = "error: revolve: --workers: --in-process starts no other processes\n"
    assert output.endswith(line)


def _fill_the_disk(workspace: Workspace, *words: str, kilobytes: int) -> None:
    """Run on a small disk until it is full; copy the run folder to ``moved``."""
    disk = workspace.folder / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(disk)]
    if subprocess.run(mount, check=False).returncode:
        pytest.skip("a small disk cannot be mounted here")
    try:
        output = workspace.run("run", *words, "--quiet", "--out", "disk/run", code=2)
        assert "full" in output
        assert "Traceback" not in output
        shutil.copytree(disk / "run", workspace.folder / "moved")
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
@pytest.mark.parametrize("flags", [("--in-process",), ("--workers", "2")])
def test_run_resumes_after_a_full_disk(
    workspace: Workspace, undisturbed: Path, births: int, flags: tuple[str, ...]
) -> None:
    words = ("scenario1", "--seed", "5", "--births", str(births), *flags)
    _fill_the_disk(workspace, *words, kilobytes=64)
    workspace.run("resume", "moved", "--quiet", *flags)
    output = workspace.run("compare", "moved", str(undisturbed))
    assert "equal" in output


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
def test_arena_resumes_after_a_full_disk(
    small_arena_workspace: Workspace, small_arena_run: Path
) -> None:
    flags = ("--in-process", "--threads", "1")
    words = ("hamlet.toml", "--seed", "4", *flags)
    _fill_the_disk(small_arena_workspace, *words, kilobytes=120)
    small_arena_workspace.run("resume", "moved", "--quiet", *flags)
    output = small_arena_workspace.run("compare", "moved", str(small_arena_run))
    assert "equal" in output


def test_closed_pipe_prints_no_error(workspace: Workspace) -> None:
    workspace.run("robot", "random", "some.yaml")
    process = workspace.start("robot", "show", "some.yaml")
    process.stdout.close()
    process.stdout = None
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (1, "")


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def test_any_text_is_printed_in_an_encoding_that_lacks_it(workspace: Workspace) -> None:
    file = workspace.folder / "Größe" / "r.yaml"
    file.parent.mkdir()
    for words in (("random",), ("check",), ("show", "--experiment", "scenario1")):
        action, *flags = words
        process = workspace.start(
            "robot", action, "Größe/r.yaml", *flags, environment=ASCII
        )
        out, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
    assert out.startswith("r.yaml: ")
    assert "orientation 0?" in out


def test_a_run_folder_with_a_name_of_another_encoding_is_one_line(
    workspace: Workspace,
) -> None:
    words = ("run", "scenario1", "--births", "15", "--in-process", "--quiet")
    process = workspace.start(*words, "--out", "Größe", environment=ASCII)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    line = "text in this locale's encoding, ascii: rename it, or set PYTHONUTF8=1\n"
    assert err.endswith(line)
    assert err.count("\n") == 1
