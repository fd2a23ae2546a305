"""Mistakes of a careless user: each one clear line, and an exit code that tells.

All in this process; tests/system/test_bad_input.py has what needs another one.
"""

import shutil
import socket
from pathlib import Path

import pytest

from revolve.command import main
from schema.agent.supervisor import cores
from schema.tables.columns import TABLES
from schema.tables.description import Description, description_text
from tests.segments import write_segment

pytestmark = pytest.mark.system

TLS = ("--tls-ca", "--tls-certificate", "--tls-key")
DOCUMENTS = {
    "key": "birth = 3",
    "type": 'births = "many"',
    "range": "[variation]\nbody_epsilon = 1.5",
    "section": "[selection]\npopulaton = 3",
    "parts": "[space]\nmin_parts = 9\nmax_parts = 8",
    "part": '[space]\npart_types = ["schema.parts:CROE"]',
    "function": '[fitness]\nfunction = "worker.fitness:thesiss"',
    "toml": "births = ",
}
"""Files of experiments, without their names."""
FILES = {
    "file": "mine",
    "exp.yaml": 'name: "a"\n',
    "mine.toml": 'name = "a"\n',
    "cor.yaml": "body: {type: Cor, id: c}\n",
    "open.yaml": "body: [\n",
    "robot.pb": "\x01\x02\x03",
    **{f"{name}.toml": f'name = "a"\n{text}\n' for name, text in DOCUMENTS.items()},
}
# Command line, and words of the only line.
MISTAKES = [
    ("runn scenario1", "no command 'runn'; did you mean 'run'?"),
    ("help statsu", "no command 'statsu'; did you mean 'status'?"),
    ("robot chek a.yaml", "did you mean 'check'?; allowed: "),
    ("run scenario1 --birth 3", "no flag '--birth'; did you mean '--births'?"),
    ("run scenario1 --out", "--out: expected one argument"),
    ("run scenario1 --births -5", "--births: must be a whole number >= 1, got '-5'"),
    ("run scenario1 --workers 1.5", "--workers: must be a whole number >= 0"),
    (f"run scenario1 --seed {2**64}", f"number in 0..{2**64 - 1}"),
    # Experiments
    ("run senario1", "no such experiment; did you mean 'scenario1'?; shipped"),
    ("run thesys", "; did you mean 'thesis'?"),
    ("run mine", "mine: no such experiment; did you mean 'mine.toml'?"),
    ("run scenario1.toml", "; did you mean 'scenario1', which is shipped?"),
    ("run exp.yaml", "exp.yaml: the file of an experiment must end in .toml"),
    ("run gone.yaml", "got '.yaml', and there is no such file"),
    ("run gone.toml", "gone.toml: cannot be read: No such file"),
    ("run other", "other: is a folder; an experiment is a .toml file"),
    ("run key.toml", "key.toml: birth: no such key; did you mean 'births'?"),
    ("run type.toml", "type.toml: births: must be a whole number, got 'many'"),
    ("run range.toml", "range.toml: variation.body_epsilon: must be a number <= 1.0"),
    ("run section.toml", "section.toml: selection.populaton: no such key"),
    ("run parts.toml", "parts.toml: space.max_parts: must be >= space.min_parts"),
    ("run part.toml", "did you mean 'schema.parts:CORE'"),
    ("run function.toml", "function.toml: fitness.function: "),
    ("run toml.toml", "toml.toml: not valid TOML"),
    # Folders
    ("resume nowhere", "nowhere: no such folder"),
    ("compare nowhere nowhere", "nowhere: no such folder"),
    ("resume other", "other: no run is there (run.json is missing)"),
    ("status file", "file: must be a folder, got a file"),
    ("run scenario1 --out file", "file: must be a folder, got a file"),
    ("run scenario1 --out other", "not empty (contains 'notes.txt')"),
    ("run scenario1 --out run", "run: already holds a run with other settings"),
    ("resume run", "run: already finished"),
    ("compare later later", "was written by another version of Revolve"),
    ("analyze empty", "empty: no run in or below"),
    ("analyze nowhere", "nowhere: no such folder"),
    ("analyze rnu", "rnu: no such folder; did you mean 'run'?"),
    ("analyze run --out file", "file: must be a folder, got a file"),
    # Views
    ("view nowhere", "nowhere: no such folder"),
    ("view nowhere --save a.rrd", "nowhere: no such folder"),
    ("view run --robot 0:9999 --save a.rrd", "0:9999: no robot of that name was born"),
    ("view run --save a.avi", "--save a.avi: must end in .rrd"),
    ("view run --save nowhere/a.gif", "--save nowhere/a.gif: no such folder: nowhere"),
    ("view run --robot best --save a.gif", "--save a.gif: a film takes no --robot"),
    ("view run --save a.gif --from 1e5 --until 1.1e5", "no poses of an arena between"),
    ("view x --connect hub", "give either a run folder or --connect"),
    ("view --connect tcp/127.0.0.1:1 --save a.rrd", "no hub at"),
    ("view other --serve 9876", "must be HOST:PORT"),
    ("view nowhere --follow x", "must be N or ISLAND:N in whole numbers >= 0"),
    ("view run --ancestry", "needs --robot best"),
    ("view --connect tcp/127.0.0.1:1 --robot best", "a run folder only"),
    # Documents about arenas
    ("arena lst --json", "ACTION: must be one of list, "),
    ("arena --json list", "no flag '--json' (see revolve arena --help)"),
    ("arena pause --json", "arena pause: no flag '--json'"),
    *(
        (f"arena list --json{words}", line)
        for words, line in (
            ("s", "no flag '--jsons'; did you mean '--json'?"),
            ("=yes", "argument --json: takes no value, got 'yes'"),
            (" run", "unexpected argument 'run'"),
            (" --island -1", "--island: must be a whole number in 0..4294967295, got"),
            (f" --island {2**64}", f"in 0..4294967295, got '{2**64}'"),
            (" --run", "--run: expected one argument"),
            (" --connect gone", "folder of an active run; no such folder: 'gone'"),
            (" --connect run", "run: no coordinator is running (address is missing)"),
            (" --connect tcp/h:70000", "an address must be tcp/HOST:PORT, "),
            (" --connect tcp/127.0.0.1:1", "no hub at tcp/127.0.0.1:1"),
        )
    ),
    (f"arena remove 0:{2**64}", "must be N or ISLAND:N in whole numbers >= 0, got"),
    # Robots
    ("robot check nowhere.yaml", "nowhere.yaml: cannot be read"),
    ("robot check cro.yaml", "did you mean 'cor.yaml'?"),
    ("robot check exp.yaml", "exp.yaml"),
    ("robot check cor.yaml", "'Core'"),
    ("robot check open.yaml", "open.yaml"),
    ("robot check robot.pb", "robot.pb"),
    ("robot simulate nowhere.yaml", "nowhere.yaml: cannot be read: No such file"),
    ("robot simulate .", ".: must be the file of a robot, got a folder"),
    ("robot simulate key.toml", "key.toml: must end in one of .yaml, .yml, "),
    ("run thesis scenario1", "must have different names"),
    ("run scenario1 --repeats 0", "--repeats: must be a whole number >= 1"),
    ("run scenario1 --first-repeat 100000", "--repeats: must be <= 100000"),
    ("status run --connect hub", "give either a folder or --connect"),
    # Network
    ("run scenario1 --listen hub --connect tcp/h:1", "exclude each other"),
    *(
        (f"{command} 5000", f"must be <= {4 * cores()}, 4 for each of {cores()} cores")
        for command in ("worker --processes", "run scenario1 --workers")
    ),
    *(
        (f"{role} --connect {flags}", message)
        for role in ("worker", "analyzer")
        for flags, message in (
            ("tls/h:1", "needs --tls-ca, --tls-certificate and --tls-key"),
            ("tls/h:1 --tls-ca x", "--tls-ca: no such file: x"),
            ("tcp/h:1 --processes 0", "must be a whole number >= 1, got '0'"),
            ("tcp/h:1 --name a/b", "--name: must be 1 to 96 letters"),
            ("tcp/h:1 --fleet *", "--fleet: must be 1 to 96 letters"),
            ("tcp/h:1 --slots 2", "no flag '--slots' (see revolve "),
        )
    ),
    ("worker --connect nowhere", "--connect: must be tcp/HOST:PORT, tls/HOST:PORT, "),
    ("status --connect tcp/127.0.0.1:1", "no hub at tcp/127.0.0.1:1"),
    ("status", "of a run without a hub, name the folder (revolve status"),
    ("hub --listen here", "--listen: an address must be tcp/"),
    ("run scenario1 --listen here", "--listen: an address must be tcp/HOST:PORT, "),
    ("run scenario1 --listen tcp/0.0.0.0:1", "tcp/0.0.0.0:1 would listen beyond this"),
    ("run scenario1 --metrics here", "--metrics: must be PORT or HOST:PORT"),
    ("run scenario1 --fleet a/b", "--fleet: must be 1 to 96 letters, digits"),
    ("run scenario1 --speed 2", "--speed: is for arenas, and there is none in"),
    ("run scenario1 --arena-workers 2", "--arena-workers: is for arenas, and there"),
    ("run scenario1 --in-process --workers 3", "starts no other processes"),
    *(
        (
            f"run scenario1 --in-process {flag} hub",
            f"{flag} has no effect with --in-proc",
        )
        for flag in ("--access", "--connect", "--fleet", "--listen", *TLS)
    ),
]


@pytest.fixture(scope="module")
def folder(small_arena_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files and folders as careless users have them."""
    folder = tmp_path_factory.mktemp("careless")
    shutil.copytree(small_arena_run, folder / "run")
    (folder / "empty").mkdir()
    (folder / "other").mkdir()
    (folder / "other" / "notes.txt").write_text("mine")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    _write_later_version(folder / "later")
    return folder


def _write_later_version(folder: Path) -> None:
    """Write the folder of a run whose births table has a later version."""
    segments = folder / "segments"
    folder.mkdir()
    description = Description("a", 0, 1, "{}")
    (folder / "run.json").write_text(description_text(description))
    (folder / "state").write_text("stopped")
    schema = TABLES["births"]
    later = schema.with_metadata({**schema.metadata, b"revolve.schema_version": b"99"})
    write_segment(segments / "births-000.arrows", later, [])


@pytest.mark.parametrize(("words", "message"), MISTAKES)
def test_each_mistake_gives_one_line(
    words: str,
    message: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("REVOLVE_CONNECT", "tcp/127.0.0.1:1")
    before = sorted(Path().rglob("*"))
    try:
        code = main(words.split())
    except SystemExit as end:  # argparse ends the process
        code = int(str(end.code))
    said = capfd.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert message in line
    # To resume a finished run is no error.
    assert code == (0 if words == "resume run" else 2)
    assert sorted(Path().rglob("*")) == before


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


def test_restriction_that_no_robot_satisfies_ends_the_run_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    parts = 'part_types = ["schema.parts:CORE", "schema.parts:ACTIVE_HINGE"]'
    limits = "min_parts = 29\nmax_parts = 30"
    Path("rare.toml").write_text(f'name = "a"\n[space]\n{parts}\n{limits}\n')
    words = ["run", "rare.toml", "--quiet", "--in-process", "--births", "15"]
    assert main([*words, "--out", "x"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "space" in line


def test_a_port_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["view", "run", "--serve", f"127.0.0.1:{port}"]) == 2
        said = capfd.readouterr().err
        assert f"--serve 127.0.0.1:{port}: Address already in use" in said
        assert said.count("\n") == 1
