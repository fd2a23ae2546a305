"""Runs from Python against runs by the command."""

import html
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

import revolve as rv
from coordinator.storage.compare import compare
from coordinator.storage.folder_status import folder_status
from revolve.command import main
from schema.tables.columns import TABLES
from tests.system.documents import SEASONS

pytestmark = pytest.mark.system

BIRTHS = 20
OLD = Path(__file__).parents[1] / "data" / "runs-3063df1"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> rv.Run:
    """Return a finished run of an experiment with changes."""
    experiment = rv.Experiment.read("scenario1", selection={"population": 5})
    folder = tmp_path_factory.mktemp("runs") / "a"
    return rv.run(experiment, seed=7, births=BIRTHS, out=folder, workers=1)


def test_run_equals_that_of_the_command(done: rv.Run, tmp_path: Path) -> None:
    file = tmp_path / "scenario1.toml"
    file.write_text(done.experiment.to_toml())
    words = ["run", str(file), "--seed", "7", "--in-process", "--quiet"]
    assert main([*words, "--out", str(tmp_path / "b")]) == 0
    assert compare(done.folder, tmp_path / "b") == []
    assert rv.resume(done.folder).births.equals(done.births)


def test_rows_of_another_table_are_not_births(done: rv.Run) -> None:
    needed = "island, birth, genome, robot"
    for rows, expected in (
        (done.evaluations, f"with the columns {needed}, has no genome, robot$"),
        (done.births.select(["birth", "genome"]), "has no island, robot$"),
        (done.births.to_pylist(), "births: must be a pyarrow.Table, got a list$"),
    ):
        with pytest.raises(rv.RevolveError, match=expected):
            done.robots(rows)


def test_robots_of_an_arena_have_the_settings_of_the_time_of_their_birth(
    tmp_path: Path,
) -> None:
    """A number of births, which rows without a time have, is no point of an arena."""
    seasons = rv.Experiment.from_toml(SEASONS)
    done = rv.run(seasons, seed=4, births=7, out=tmp_path / "a", workers=1)
    births = done.births
    times_s = births["sim_time_s"].to_pylist()
    worlds = [robot.experiment for robot in done.robots(births)]
    assert worlds == [done.experiment.at(time_s) for time_s in times_s]
    assert worlds != [done.experiment.at(number) for number in range(len(worlds))]
    with pytest.raises(rv.RevolveError, match=r"sim_time_s, has no sim_time_s$"):
        done.robots(births.drop_columns(["sim_time_s"]))


def test_run_has_every_table(done: rv.Run) -> None:
    for name in TABLES:
        # The method `archive` has the robots, too.
        table = done.table(name) if name == "archive" else getattr(done, name)
        assert table.schema.names[0] == "record"
        assert table.equals(done.table(name))
        assert set(table["run_id"].to_pylist()) <= {done.run_id}
        assert set(table["seed"].to_pylist()) <= {7}
    assert (done.births.num_rows, done.state, done.seed) == (BIRTHS, "finished", 7)


def test_best_robot_has_the_best_fitness(done: rv.Run) -> None:
    best = done.best_ever(2)
    assert len(best) == 2
    greatest = pc.max(done.evaluations["fitness"]).as_py()
    assert rv.evaluate(best[0]).fitness == greatest
    assert rv.evaluate(best[1]).fitness <= greatest
    assert done.robots()[3] == done.robot(done.births["birth"][3].as_py())
    with pytest.raises(rv.RunFolderError, match="has no birth 999"):
        done.robot(999)


def test_wrong_numbers_and_names_are_refused(done: rv.Run) -> None:
    assert done.best(0) == done.best_ever(0) == []
    assert len(done.best_ever(10**6)) == BIRTHS
    wrong: Any = "3"
    for name, ask in (
        ("count", lambda: done.best(-1)),
        ("number", lambda: done.robot(wrong)),
        ("island", lambda: done.robot(3, wrong)),
    ):
        with pytest.raises(rv.RevolveError, match=f"^{name}: must be a whole number"):
            ask()
    with pytest.raises(rv.RunFolderError, match="'birth'; did you mean 'births'"):
        done.table("birth")


def test_best_robot_ever_of_an_arena_has_the_best_mature_sample(tmp_path: Path) -> None:
    with ZipFile(OLD / "arena.zip") as archive:
        archive.extractall(tmp_path)
    arena_run = rv.Run(tmp_path / "undisturbed")
    samples = arena_run.fitness.filter(pc.field("is_mature"))
    row = samples.take(pc.sort_indices(samples, [("fitness", "descending")])[:1])
    assert arena_run.best_ever() == [arena_run.robot(row["birth"][0].as_py())]


def test_best_robot_is_that_of_the_file(done: rv.Run, tmp_path: Path) -> None:
    """Also in an arena, where robots that had more fitness before may be dead."""
    with ZipFile(OLD / "arena.zip") as archive:
        archive.extractall(tmp_path)
    for each in (done, rv.Run(tmp_path / "undisturbed")):
        kept = rv.Robot.read(each.folder / "best.yaml")
        assert each.best() == [kept]
        assert each.best()[0].experiment == kept.experiment
        population = each.population
        last = population.filter(
            pc.field("births") == pc.max(population["births"]).as_py()
        )
        judged = last.filter(pc.is_valid(last["fitness"])).num_rows
        assert len(each.best(10**6)) == judged
        bests = [island.best for island in folder_status(each.folder).islands]
        assert bests == [pc.max(last["fitness"]).as_py()]


@pytest.mark.parametrize("name", ["", "arena", "archipelago"])
def test_notebook_gets_births_of_all_islands_and_the_best_sample(
    done: rv.Run, tmp_path: Path, name: str
) -> None:
    run = done
    if name:
        with ZipFile(OLD / f"{name}.zip") as archive:
            archive.extractall(tmp_path)
        run = rv.Run(tmp_path / "undisturbed")
    shown, births = run._repr_html_(), run.births.num_rows
    assert f"<td>{births} of {births}</td>" in shown
    assert html.escape(str(run.folder)) in shown
    assert "<th>best ever</th><td>" in shown
    assert "<th>best of the last population</th><td>" in shown


def test_used_and_missing_folders_raise_the_line_of_the_command(
    done: rv.Run, tmp_path: Path
) -> None:
    with pytest.raises(rv.RunFolderError, match=r"holds a run.*revolve[.]read opens"):
        rv.run("scenario1", births=15, out=done.folder)
    with pytest.raises(rv.RunFolderError, match="no run in or below this folder"):
        rv.read(tmp_path)
    with pytest.raises(rv.RunFolderError, match="missing: no such folder"):
        rv.resume(tmp_path / "missing")
    with pytest.raises(rv.RunFolderError, match="several runs; give one of them, "):
        rv.Run(done.folder.parent)
    with pytest.raises(rv.ExperimentError, match="did you mean 'scenario"):
        rv.run("scenario", births=3, out=tmp_path / "x")


def test_analysis_has_tables_and_a_report(
    done: rv.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command itself is tested in tests/system/test_analyze.py."""
    with pytest.raises(rv.RevolveError, match="required: FOLDER"):
        rv.analyze()
    with pytest.raises(rv.RunFolderError, match="no such folder"):
        rv.analyze(tmp_path / "missing")
    with pytest.raises(rv.RevolveError, match=r"style: must be .*'drak'; did you"):
        rv.analyze(done, style="drak")
    out = tmp_path / "report"

    def write(words: list[str], *, is_quiet: bool) -> None:
        look = ["--out", str(out), "--width", "page", "--style", "dark"]
        lists = ["--figures", "6.3,H", "--format", "pdf"]
        assert words == ["analyze", str(done.folder), "a", *look, *lists]
        assert is_quiet
        (out / "measures").mkdir(parents=True)
        pq.write_table(done.births, out / "measures" / "robots.parquet")
        (out / "report.html").write_text("<!doctype html>")

    monkeypatch.setattr("revolve.reports.run_command", write)
    wanted = ("6.3", "H")
    found = rv.analyze(done, "a", out=out, figures=wanted, format=["pdf"], style="dark")
    assert found.report.read_text().startswith("<!")
    assert found.table("robots").num_rows == BIRTHS
    with pytest.raises(rv.RunFolderError, match="did you mean 'robots'"):
        found.table("robot")
