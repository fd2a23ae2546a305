"""Tests of failure reports in the summary, in status and before a resume."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from coordinator.cli.status import main as status
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunFolder
from coordinator.storage.folder_status import check_rewritable, folder_status
from coordinator.storage.journal import Journal
from revolve import command as revolve
from schema.errors import RunFolderError
from schema.experiment.file import experiment_text, read_experiment
from schema.tables.columns import TABLES
from schema.tables.description import RunDetails, read_state
from schema.tables.last_populations import last_populations
from tests.system.conftest import Once
from tests.system.flipping import flip
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

SHORT = """
name = "{name}"
births = 12
[selection]
population = 6
children = 6
[simulation]
window_steps = 400
[fitness]
function = "{fitness}"
"""

ARENA = """
name = "arena"
births = 30
[selection]
population = 6
[simulation]
warmup_steps = 200
window_steps = 400
[arena]
population_limit = 12
population_floor = 5
[fitness]
function = "judge:none"
"""

FITNESS = """
from worker.fitness import thesis

def few(track, settings):
    value = thesis(track, settings)
    # The check before the run has traces on the ground.
    if value > 0.005 and track.core_position[0, 2] > 0.0:
        raise ValueError("too fast to see")
    return value - 1.0

def none(track, settings):
    if not track.core_position[0, 2]:
        return 0.0
    raise ValueError("nobody looked")
"""
QUIET = ("--in-process", "--quiet")


def _write(workspace: Workspace, name: str, fitness: str) -> str:
    (workspace.folder / "judge.py").write_text(FITNESS)
    text = SHORT.format(name=name, fitness=fitness)
    (workspace.folder / f"{name}.toml").write_text(text)
    return f"{name}.toml"


def test_run_without_any_fitness_has_no_best_robot(workspace: Workspace) -> None:
    source = _write(workspace, "blind", "judge:none")
    output = workspace.run("run", source, *QUIET, "--out", "a b", code=1)
    assert "12 births; no robot of the last population has a fitness" in output
    assert "12 of 12 evaluations failed, all: " in output
    assert "nobody looked" in output
    assert "best robot" not in output
    assert not (workspace.folder / "a b" / "best.yaml").exists()
    assert "revolve view 'a b'" in output
    assert "best -" in workspace.run("status", "a b")


def test_run_reports_failed_evaluations_and_the_reason(workspace: Workspace) -> None:
    source = _write(workspace, "dim", "judge:few")
    output = workspace.run("run", source, *QUIET, "--out", "a")
    (failed,) = [line for line in output.splitlines() if "evaluations failed" in line]
    assert "too fast to see" in failed
    assert "of 12 evaluations failed, all: " in failed
    # No failed robot outlives one with a negative fitness.
    last = last_populations(workspace.folder / "a")
    assert [row["fitness"] < 0.0 for row in last] == [True] * 6
    assert "best robot of the last population: birth " in output
    assert (workspace.folder / "a" / "best.yaml").exists()


def test_campaign_reports_runs_without_any_fitness(workspace: Workspace) -> None:
    sources = [
        _write(workspace, "blind", "judge:none"),
        _write(workspace, "seeing", "worker.fitness:thesis"),
    ]
    output = workspace.run("run", *sources, *QUIET, "--out", "both", code=1)
    assert "both/blind-0: 12 of 12 evaluations failed, all: " in output
    assert "seeing-0" not in output
    assert "2 runs finished" in output
    again = workspace.run("resume", "both", *QUIET, code=1)
    assert "2 of 2 runs already finished" in again
    # A campaign of one run reports the reason, too.
    (workspace.folder / "both" / "blind-0" / "state").write_text("tired")
    shutil.rmtree(workspace.folder / "both" / "seeing-0")
    file = workspace.folder / "both" / "campaign.toml"
    text = file.read_text()
    text = text[: text.rindex("[[experiments]]")]
    # As one of an earlier version.
    file.write_text(re.sub("digest = .*", "", text, count=1))
    alone = workspace.run("resume", "both", *QUIET, code=1)
    assert "both/blind-0/state: damaged: must be one of running" in alone
    assert "both/blind-0: 12 of 12 evaluations failed, all: " in alone


def test_arena_without_any_fitness_reports_the_reason(workspace: Workspace) -> None:
    (workspace.folder / "judge.py").write_text(FITNESS)
    (workspace.folder / "arena.toml").write_text(ARENA)
    output = workspace.run("run", "arena.toml", *QUIET, "--out", "a", code=1)
    assert "no robot is left that can have a child" in output
    assert "deaths were failures, all: " in output
    assert "nobody looked" in output
    assert "already finished" in workspace.run("resume", "a", "--in-process", code=1)


@pytest.fixture(scope="module")
def campaign_folder(once: Once) -> Path:
    """Return a folder with a campaign of two finished runs, ``twice``."""

    def make(workspace: Workspace) -> None:
        source = _write(workspace, "seeing", "worker.fitness:thesis")
        workspace.run("run", source, *QUIET, "--repeats", "2", "--out", "all/twice")

    return once("failures-told", make) / "all"


@pytest.fixture
def twice(
    campaign_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """Return a copy of the campaign below the current folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(campaign_folder, tmp_path / "all")
    return Path("all/twice")


Told = Callable[..., str]


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Return a function that runs a command here, and returns what it writes."""

    def run(*words: str | Path, code: int = 0) -> str:
        assert revolve.main([*map(str, words)]) == code
        written = capsys.readouterr()
        return written.out + written.err

    return run


def test_damaged_run_does_not_hide_other_runs(
    told: Told, twice: Path, campaign_folder: Path
) -> None:
    damage = "seeing-0/run.json: damaged: must have a key 'name'"
    (twice / "seeing-0" / "run.json").write_text("{}")
    output = told("status", "all", code=1)
    assert f"damaged: all/twice/{damage}" in output
    assert "1 of 2 runs finished" in output
    assert "twice/seeing-0  damaged" in output
    # A damaged run does not prevent the other run from starting again.
    shutil.rmtree(twice / "seeing-1")
    output = told("resume", twice, *QUIET, code=1)
    assert f"seeing-0 failed: all/twice/{damage}" in output
    assert read_state(twice / "seeing-1") == "finished"
    assert compare(twice / "seeing-1", campaign_folder / "twice" / "seeing-1") == []


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("state", "", "must be one of running, stopped, finished, got b''"),
        ("births.parquet", "", "births.parquet: damaged"),
        ("births.parquet", None, "is finished, but its tables are missing"),
    ],
    ids=["state", "births.parquet", "no tables"],
)
def test_damaged_and_missing_files_are_reported(
    twice: Path, file: str, content: str | None, message: str
) -> None:
    run = twice / "seeing-0"
    assert folder_status(run).births == 12
    (path,) = run.glob(f"**/{file}")
    if content is None:
        path.unlink()
    else:
        path.write_text(content)
    with pytest.raises(RunFolderError, match=message):
        folder_status(run)


def test_narrow_terminal_does_not_truncate_the_status(
    told: Told, campaign_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    output = told("status", campaign_folder)
    assert "2 of 2 runs finished, 24 of 24 births" in output
    assert "no coordinator is running" not in output
    for name in ("twice/seeing-0", "twice/seeing-1"):
        (line,) = [line for line in output.splitlines() if name in line]
        assert line.split()[1:6] == ["finished", "12", "of", "12", "best"]


def test_missing_file_of_the_best_robot_is_written_again(
    told: Told, twice: Path
) -> None:
    """A process may have been killed after its run, before it wrote the file."""
    file = twice / "seeing-1" / "best.yaml"
    sound = file.read_bytes()
    said = "best.yaml was missing; best robot of the last population: its file: "
    for folder in (twice / "seeing-1", twice):
        file.unlink()
        output = told("resume", folder, *QUIET)
        assert "already finished" in output
        assert f"{said}{twice}/seeing-1" in output
        assert file.read_bytes() == sound
    assert "was missing" not in told("resume", twice, *QUIET)


def test_missing_and_damaged_tables_of_a_campaign_are_written_again(
    told: Told, twice: Path, campaign_folder: Path
) -> None:
    shutil.rmtree(twice / "seeing-0" / "tables")
    (path,) = (twice / "seeing-1").rglob("evaluations.parquet")
    flip(path, 800)
    output = told("resume", twice, *QUIET)
    assert "tables are missing" in output
    assert "writing such tables again from the journal" in output
    assert f"{path.name}: damaged (its SHA-256" in output
    assert compare(twice, campaign_folder / "twice") == []
    output = told("resume", twice, *QUIET)
    assert "2 of 2 runs already finished" in output
    assert "damaged" not in output


def test_refused_resume_does_not_change_the_folder(told: Told, twice: Path) -> None:
    """Lost rows are rewritten only from an intact journal."""
    run = twice / "seeing-0"
    shutil.rmtree(run / "tables")
    (run / "state").unlink()
    (run / "segments").mkdir()
    schema = TABLES["births"].serialize().to_pybytes()
    (run / "segments" / "births-001.arrows").write_bytes(schema)
    journal = run / "journal.bin"
    flip(journal, 320)
    assert "journal.bin: damaged at byte" in told("resume", run, *QUIET, code=2)
    for spoil in (journal.unlink, journal.touch):
        spoil()
        assert "journal.bin: is lost" in told("resume", run, *QUIET, code=2)
    assert [path.name for path in (run / "segments").iterdir()] == ["births-001.arrows"]


def test_tables_are_rewritable_only_with_the_journal(tmp_path: Path) -> None:
    experiment = read_experiment("scenario3")
    details = RunDetails("scenario3", 0, 1, experiment_text(experiment))
    with RunFolder(tmp_path, details) as folder:
        (tmp_path / "state").write_text("finished")
        with pytest.raises(RunFolderError, match="state: damaged: is 'finished'"):
            folder_status(tmp_path)
        folder.seal({"births": "0" * 64})
    for read in (check_rewritable, folder_status):
        with pytest.raises(RunFolderError, match="put a copy of the tables in their"):
            read(tmp_path)
    with Journal.open(tmp_path):
        pass
    check_rewritable(tmp_path)
    with pytest.raises(RunFolderError, match="to write them again"):
        folder_status(tmp_path)


def test_status_follows_a_link_to_a_run(
    tmp_path: Path, campaign_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "here").symlink_to(campaign_folder / "twice" / "seeing-0")
    (tmp_path / "stranger").mkdir()
    (tmp_path / "stranger" / "run.json").write_text('{"name": "not ours"}')
    (tmp_path / "again").symlink_to(tmp_path)
    assert status(["status", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert "1 of 1 run finished, 12 of 12 births" in output


@pytest.mark.parametrize("repeats", [(), ("--repeats", "2")])
def test_wrong_address_leaves_the_folder_usable(
    told: Told,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    repeats: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    text = SHORT.format(name="seeing", fitness="worker.fitness:thesis")
    Path("seeing.toml").write_text(text)
    words = ("run", "seeing.toml", *repeats, "--out", "new", "--quiet")
    output = told(*words, "--connect", "tcp/127.0.0.1:1", code=2)
    assert "no hub at tcp/127.0.0.1:1" in output
    told(*words, "--in-process")
