"""Mistakes of a careless user: each one clear line, and an exit code that tells.

All in this process; tests/system/test_bad_input.py has those that need another one.
"""

import os
import shutil
import socket
from pathlib import Path

import pyarrow as pa
import pytest

from revolve.command import main
from schema.tables.columns import TABLES
from schema.tables.description import Description, description_text

pytestmark = pytest.mark.system

KEY = 'name = "a"\nbirth = 3\n'
TYPE = 'name = "a"\nbirths = "many"\n'
RANGE = 'name = "a"\n[variation]\nbody_epsilon = 1.5\n'

# Command line, words of the only line, exit code.
MISTAKES = {
    "command misspelt": ("runn scenario1", "no command 'runn'; did you mean 'run'?", 2),
    "help misspelt": ("help statsu", "no command 'statsu'; did you mean 'status'?", 2),
    "flag misspelt": (
        "run scenario1 --birth 3",
        "revolve run: no flag '--birth'; did you mean '--births'?",
        2,
    ),
    "flag without value": ("run scenario1 --out", "--out: expected one argument", 2),
    "negative number": (
        "run scenario1 --births -5",
        "--births: must be a whole number >= 1, got '-5'",
        2,
    ),
    "fraction": (
        "run scenario1 --workers 1.5",
        "--workers: must be a whole number >= 0, got '1.5'",
        2,
    ),
    "experiment misspelt": (
        "run senario1",
        "senario1: no such experiment; did you mean 'scenario1'?; shipped are ",
        2,
    ),
    "other file": (
        "run exp.yaml",
        "exp.yaml: the file of an experiment must end in .toml, got '.yaml'",
        2,
    ),
    "missing file": ("run gone.toml", "gone.toml: cannot be read: No such file", 2),
    "wrong key": (
        "run key.toml --out x",
        "key.toml: birth: no such key; did you mean 'births'?; allowed: name, births",
        2,
    ),
    "wrong type": (
        "run type.toml --out x",
        "type.toml: births: must be a whole number, got 'many'",
        2,
    ),
    "out of range": (
        "run range.toml --out x",
        "range.toml: variation.body_epsilon: must be a number <= 1.0, got 1.5",
        2,
    ),
    "missing folder": ("resume nowhere", "nowhere: no such folder", 2),
    "folder without run": (
        "resume other",
        "other: no run is there (run.json is missing)",
        2,
    ),
    "file, not folder": ("status file", "file: must be a folder, got a file", 2),
    "file as output": (
        "run scenario1 --out file",
        "file: must be a folder, got a file",
        2,
    ),
    "folder of others": ("run scenario1 --out other", "notes.txt", 2),
    "used folder": (
        "run scenario1 --out run",
        "run: already holds a run with other settings; to resume it: revolve resume",
        2,
    ),
    "resume of a finished run": ("resume run", "run: already finished", 0),
    "analyze of an empty folder": ("analyze empty", "empty: no run in or below", 2),
    "analyze of a missing folder": ("analyze nowhere", "nowhere: no such folder", 2),
    "robot that does not exist": (
        "view run --robot 0:9999 --save a.rrd",
        "--robot 0:9999: no robot of that name was born",
        2,
    ),
    "other ending": ("view run --save a.mp4", "--save a.mp4: must end in .rrd", 2),
    "film of a time without robots": (
        "view run --save a.gif --from 1e5 --until 1.1e5",
        "run: no poses of an arena between 100000 and 110000 s; the run ends at ",
        2,
    ),
    "film of one robot": (
        "view run --robot best --save a.gif",
        "--save a.gif: a film takes no --robot",
        2,
    ),
    "film in a missing folder": (
        "view run --save nowhere/a.gif",
        "--save nowhere/a.gif: no such folder: nowhere",
        2,
    ),
    "run to view is missing": (
        "view nowhere --save a.rrd",
        "nowhere: no such folder",
        2,
    ),
    "no robot file": ("robot check nowhere.yaml", "nowhere.yaml: cannot be read", 2),
    "no robot file to simulate": (
        "robot simulate nowhere.yaml",
        "nowhere.yaml: cannot be read: No such file",
        2,
    ),
    "folder to simulate": (
        "robot simulate run",
        "run: must be the file of a robot, got a folder; the best robot of its last ",
        2,
    ),
    "other file to simulate": (
        "robot simulate key.toml",
        "key.toml: must end in one of .yaml, .yml, ",
        2,
    ),
    "not a robot": ("robot check exp.yaml", "exp.yaml", 2),
    "action misspelt": ("robot chek a.yaml", "did you mean 'check'?; allowed: ", 2),
    "address": (
        "worker --connect nowhere",
        "--connect: must be tcp/HOST:PORT, tls/HOST:PORT, ",
        2,
    ),
    "no coordinator": (
        "status --connect tcp/127.0.0.1:1",
        "no hub at tcp/127.0.0.1:1",
        2,
    ),
    "no hub": (
        "status",
        "tcp/127.0.0.1:1; of a run without a hub, name the folder (revolve status ",
        2,
    ),
    "table of another version": (
        "compare later later",
        "was written by another version of Revolve",
        2,
    ),
    "listen": (
        "run scenario1 --listen here --out x",
        "--listen: an address must be tcp/HOST:PORT, tls/HOST:PORT, ",
        2,
    ),
    "listen beyond this machine": (
        "run scenario1 --listen tcp/0.0.0.0:1 --out x",
        "--listen: tcp/0.0.0.0:1 would listen beyond this machine",
        2,
    ),
    "listen as hub": ("hub --listen here", "--listen: an address must be tcp/", 2),
    "metrics": (
        "run scenario1 --metrics here --out x",
        "--metrics: must be PORT or HOST:PORT, got 'here'",
        2,
    ),
    "fleet": (
        "run scenario1 --fleet a/b --out x",
        "--fleet: must be 1 to 96 letters, digits",
        2,
    ),
    "speed without arena": (
        "run scenario1 --speed 2",
        "--speed: limits arenas, and there is none in scenario1",
        2,
    ),
}


@pytest.fixture(scope="module")
def folder(small_arena_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files and folders as careless users have them."""
    folder = tmp_path_factory.mktemp("careless")
    shutil.copytree(small_arena_run, folder / "run")
    (folder / "empty").mkdir()
    (folder / "other").mkdir()
    (folder / "other" / "notes.txt").write_text("mine")
    (folder / "file").write_text("mine")
    (folder / "exp.yaml").write_text('name: "a"\n')
    for name, text in (("key", KEY), ("type", TYPE), ("range", RANGE)):
        (folder / f"{name}.toml").write_text(text)
    _write_later_version(folder / "later")
    return folder


def _write_later_version(folder: Path) -> None:
    """Write the folder of a run whose births table has a later version."""
    segments = folder / "segments"
    segments.mkdir(parents=True)
    description = Description("a", 0, 1, "{}")
    (folder / "run.json").write_text(description_text(description))
    (folder / "state").write_text("stopped")
    schema = TABLES["births"]
    later = schema.with_metadata({**schema.metadata, b"revolve.schema_version": b"99"})
    with (
        (segments / "births-000.arrows").open("wb") as file,
        pa.ipc.new_stream(file, later) as stream,
    ):
        stream.write_table(later.empty_table())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_gives_one_line(
    mistake: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    words, message, code = MISTAKES[mistake]
    monkeypatch.chdir(folder)
    monkeypatch.setenv("REVOLVE_CONNECT", "tcp/127.0.0.1:1")
    before = sorted(Path().iterdir())
    try:
        found = main(words.split())
    except SystemExit as end:  # argparse ends the process
        found = int(str(end.code))
    said = capfd.readouterr()
    assert said.out == ""
    # Written once, about the first run of an earlier version.
    lines = [line for line in said.err.splitlines() if "has no checksums" not in line]
    assert len(lines) == 1, said.err
    assert message in lines[0]
    assert found == code
    assert sorted(Path().iterdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o500)
    assert main(["run", "scenario1", "--out", "x"]) == 2
    assert "x: cannot be written: Permission denied" in capfd.readouterr().err


def test_a_port_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["view", "run", "--serve", f"127.0.0.1:{port}"]) == 2
        said = capfd.readouterr().err
        assert f"--serve 127.0.0.1:{port}: Address already in use" in said
        assert said.count("\n") == 1
