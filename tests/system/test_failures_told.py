"""Failures are reported by the summary, by status, and before a resume."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from coordinator.cli.status import main as status
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunDetails, RunFolder, read_state
from coordinator.storage.folder_status import check_rewritable, folder_status
from coordinator.storage.journal import Journal
from schema.errors import RunFolderError
from schema.experiment.file import experiment_text, read_experiment
from schema.tables.columns import TABLES
from schema.tables.files import parquet_path

pytestmark = pytest.mark.system

Stage = Any
Until = Callable[[Callable[[], bool], str], None]

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
function = "{fitness}"
"""

FITNESS = """
from worker.fitness import thesis

def few(track, settings):
    value = thesis(track, settings)
    if value > 0.005:
        raise ValueError("too fast to see")
    return value

def none(track, settings):
    raise ValueError("nobody looked")
"""


def _write(stage: Stage, name: str, fitness: str) -> str:
    (stage.folder / "judge.py").write_text(FITNESS)
    text = SHORT.format(name=name, fitness=fitness)
    (stage.folder / f"{name}.toml").write_text(text)
    return f"{name}.toml"


def _run(stage: Stage, *words: str, code: int = 0) -> str:
    said: str = stage.run("run", *words, "--in-process", "--quiet", code=code)
    return said


def test_a_run_without_any_fitness_names_no_best_robot(stage: Stage) -> None:
    source = _write(stage, "blind", "judge:none")
    said = _run(stage, source, "--out", "a b", code=1)
    assert "12 births; no robot of the last population has a fitness" in said
    assert "12 of 12 evaluations failed, all: " in said
    assert "nobody looked" in said
    assert "best robot" not in said
    assert not (stage.folder / "a b" / "best.yaml").exists()
    assert "revolve view 'a b'" in said
    assert "best -" in stage.run("status", "a b")


def test_a_run_reports_failed_evaluations_and_the_reason(stage: Stage) -> None:
    said = _run(stage, _write(stage, "dim", "judge:few"), "--out", "a")
    failed = [line for line in said.splitlines() if "evaluations failed" in line]
    assert len(failed) == 1
    assert "too fast to see" in failed[0]
    assert "of 12 evaluations failed, all: " in failed[0]
    assert "best robot: birth " in said
    assert (stage.folder / "a" / "best.yaml").exists()


def test_a_campaign_reports_runs_without_any_fitness(stage: Stage) -> None:
    sources = [
        _write(stage, "blind", "judge:none"),
        _write(stage, "seeing", "worker.fitness:thesis"),
    ]
    said = _run(stage, *sources, "--out", "both", code=1)
    assert "both/blind-0: 12 of 12 evaluations failed, all: " in said
    assert "seeing-0" not in said
    assert "2 runs are finished" in said
    again = stage.run("resume", "both", "--in-process", "--quiet", code=1)
    assert "2 of 2 runs are already finished" in again
    # A campaign of one run has a reason to tell, too.
    (stage.folder / "both" / "blind-0" / "state").write_text("tired")
    shutil.rmtree(stage.folder / "both" / "seeing-0")
    text = (stage.folder / "both" / "campaign.toml").read_text()
    text = text[: text.rindex("[[experiments]]")]
    (stage.folder / "both" / "campaign.toml").write_text(text)
    alone = stage.run("resume", "both", "--in-process", "--quiet", code=1)
    assert "blind-0 failed: both/blind-0/state: must be one of running" in alone


@pytest.fixture(scope="module")
def made(once: Any) -> Path:  # noqa: ANN401 - the fixture
    """Return a folder with a campaign of two finished runs."""

    def make(stage: Stage) -> None:
        words = ("--repeats", "2", "--out", "all/twice")
        _run(stage, _write(stage, "seeing", "worker.fitness:thesis"), *words)

    folder: Path = once("failures-told", make)
    return folder / "all"


def test_a_damaged_run_does_not_hide_others(stage: Stage, made: Path) -> None:
    shutil.copytree(made, stage.folder / "all")
    twice = stage.folder / "all" / "twice"
    told = "seeing-0/run.json: cannot be read: Object missing required field `name`"
    (twice / "seeing-0" / "run.json").write_text("{}")
    said = stage.run("status", "all", code=1)
    assert f"damaged: all/twice/{told}" in said
    assert "1 of 2 runs finished" in said
    assert "twice/seeing-0  damaged" in said
    # The other run is restarted in spite of the damaged one.
    shutil.rmtree(twice / "seeing-1")
    said = stage.run("resume", "all/twice", "--in-process", "--quiet", code=1)
    assert f"seeing-0 failed: all/twice/{told}" in said
    assert read_state(twice / "seeing-1") == "finished"
    assert compare(twice / "seeing-1", made / "twice" / "seeing-1") == []


@pytest.mark.parametrize(
    ("file", "content", "told"),
    [
        ("state", "", "must be one of running, stopped, finished, got ''"),
        ("births.parquet", "", "births.parquet: cannot be read"),
        ("births.parquet", None, "is finished, but its tables are missing"),
    ],
    ids=["state", "births.parquet", "no tables"],
)
def test_damaged_and_missing_files_are_reported(
    tmp_path: Path, made: Path, file: str, content: str | None, told: str
) -> None:
    run = tmp_path / "run"
    shutil.copytree(made / "twice" / "seeing-0", run)
    assert folder_status(run).births == 12
    (path,) = run.glob(f"**/{file}")
    if content is None:
        path.unlink()
    else:
        path.write_text(content)
    with pytest.raises(RunFolderError, match=told):
        folder_status(run)


def test_a_narrow_terminal_does_not_cut_the_status(
    made: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    assert status(["status", str(made)]) == 0
    said = capsys.readouterr().out
    assert "2 of 2 runs finished, 24 of 24 births" in said
    assert "no coordinator is running" not in said
    for name in ("twice/seeing-0", "twice/seeing-1"):
        (line,) = [line for line in said.splitlines() if name in line]
        assert line.split()[1:6] == ["finished", "12", "of", "12", "best"]


def test_missing_tables_are_written_again(stage: Stage, made: Path) -> None:
    run = stage.folder / "run"
    shutil.copytree(made / "twice" / "seeing-0", run)
    words = ("resume", "run", "--in-process", "--quiet")
    assert "already finished" in stage.run(*words)
    shutil.rmtree(run / "tables")
    said = stage.run(*words)
    assert "tables are missing; writing them again from the journal" in said
    assert "12 births" in said
    assert compare(run, made / "twice" / "seeing-0") == []


@pytest.mark.parametrize("tables", ["tables", "no tables"])
def test_a_run_without_its_journal_does_not_start_again(
    stage: Stage, made: Path, tables: str
) -> None:
    run = stage.folder / "run"
    shutil.copytree(made / "twice" / "seeing-0", run)
    (run / "journal.bin").unlink()
    words = ("resume", "run", "--in-process", "--quiet")
    if tables == "tables":
        (run / "state").unlink()
        told = "journal.bin: is lost"
    else:
        shutil.rmtree(run / "tables")
        told = "put a copy of the tables in their place"
    assert told in stage.run(*words, code=2)
    (run / "journal.bin").touch()
    assert told in stage.run(*words, code=2)


def test_a_refusal_changes_nothing(stage: Stage, made: Path) -> None:
    """Rows after a gap are written again only from an intact journal."""
    run = stage.folder / "run"
    shutil.copytree(made / "twice" / "seeing-0", run)
    shutil.rmtree(run / "tables")
    (run / "state").unlink()
    (run / "segments").mkdir()
    schema = TABLES["births"].serialize().to_pybytes()
    (run / "segments" / "births-001.arrows").write_bytes(schema)
    journal = bytearray((run / "journal.bin").read_bytes())
    journal[40] ^= 1
    (run / "journal.bin").write_bytes(journal)
    said = stage.run("resume", "run", "--in-process", "--quiet", code=2)
    assert "journal.bin: damaged at byte" in said
    (run / "journal.bin").unlink()
    said = stage.run("resume", "run", "--in-process", "--quiet", code=2)
    assert "journal.bin: is lost" in said
    assert [path.name for path in (run / "segments").iterdir()] == ["births-001.arrows"]


def test_tables_of_an_arena_are_rewritable_only_with_its_poses(tmp_path: Path) -> None:
    experiment = read_experiment("scenario3")
    details = RunDetails("scenario3", 0, 1, experiment_text(experiment))
    with RunFolder(tmp_path, details), Journal.open(tmp_path):
        pass
    (tmp_path / "state").write_text("finished")
    with pytest.raises(RunFolderError, match="put a copy of the tables in their place"):
        check_rewritable(tmp_path, details)
    with pytest.raises(RunFolderError, match="put a copy of the tables in their place"):
        folder_status(tmp_path)
    poses = parquet_path(tmp_path, "scenario3", 0, "poses")
    poses.parent.mkdir(parents=True)
    poses.touch()
    check_rewritable(tmp_path, details)
    with pytest.raises(RunFolderError, match="to write them again"):
        folder_status(tmp_path)


def test_status_follows_a_link_to_a_run(
    tmp_path: Path, made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "here").symlink_to(made / "twice" / "seeing-0")
    (tmp_path / "stranger").mkdir()
    (tmp_path / "stranger" / "run.json").write_text('{"name": "not ours"}')
    (tmp_path / "again").symlink_to(tmp_path)
    assert status(["status", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "1 of 1 runs finished, 12 of 12 births" in said


def test_an_arena_without_any_fitness_reports_the_reason(stage: Stage) -> None:
    (stage.folder / "judge.py").write_text(FITNESS)
    text = ARENA.format(fitness="judge:none")
    (stage.folder / "arena.toml").write_text(text)
    said = _run(stage, "arena.toml", "--out", "a", code=1)
    assert "too few robots are left to mate" in said
    assert "deaths were failures, all: " in said
    assert "nobody looked" in said
    assert "already finished" in stage.run("resume", "a", "--in-process", code=1)


@pytest.mark.parametrize("repeats", [(), ("--repeats", "2")])
def test_a_wrong_address_leaves_the_folder_usable(
    stage: Stage, repeats: tuple[str, ...]
) -> None:
    source = _write(stage, "seeing", "worker.fitness:thesis")
    words = ("run", source, *repeats, "--out", "new", "--quiet")
    said = stage.run(*words, "--connect", "tcp/127.0.0.1:1", code=2)
    assert "no hub at tcp/127.0.0.1:1" in said
    stage.run(*words, "--in-process")


def test_a_folder_with_foreign_files_gets_no_lock(stage: Stage) -> None:
    (stage.folder / "mine").mkdir()
    (stage.folder / "mine" / "thesis.tex").write_text("years of work")
    source = _write(stage, "seeing", "worker.fitness:thesis")
    said = stage.run("run", source, "--out", "mine", code=2)
    assert "not empty (contains 'thesis.tex')" in said
    assert [path.name for path in (stage.folder / "mine").iterdir()] == ["thesis.tex"]


def test_a_removed_folder_is_reported(stage: Stage, until: Until) -> None:
    words = ("scenario1", "--births", "3000", "--workers", "1", "--out", "gone")
    process = stage.start("run", *words, "--quiet")
    journal = stage.folder / "gone" / "journal.bin"
    until(lambda: journal.exists() and journal.stat().st_size > 2000, "it lives")
    (stage.folder / "gone").rename(stage.folder / "elsewhere")
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "was moved or removed" in err
    details = json.loads((stage.folder / "elsewhere" / "run.json").read_text())
    assert details["name"] == "scenario1"
