"""Islands with rules that keep diversity: archives, migrants, and equal runs."""

from itertools import cycle
from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.evolution.breeding import Individual
from schema.experiment.document import Experiment, SelectionSection
from schema.experiment.grid import Grid, cell_name, cell_of
from schema.experiment.migration import Migration
from tests.coordinator.archipelago_run import ARENA, ArchipelagoRun
from tests.documents import parse_experiment
from tests.system.documents import DIVERSE

DOCUMENT = parse_experiment(DIVERSE, "diverse.toml")
GRID = Grid(measures=DOCUMENT.measures.labels, bounds=((0, 1), (0, 1)), bins=(3, 3))
MIGRATION = Migration(
    topology="ring", epoch=6, migrants=3, emigrants="random", replaced="rule"
)
EXPERIMENT = replace(DOCUMENT, grid=GRID, migration=MIGRATION)


def archive_rows(run: ArchipelagoRun, island: int = 0) -> list[Any]:
    return [row for row in run.rows("archive") if row["island"] == island]


def identity(row: Any) -> tuple[int, int]:  # noqa: ANN401 - a row of a table
    home = row["birth_island"]
    return row["island"] if home is None else home, row["birth"]


def content(rows: list[Any]) -> dict[str, tuple[int, int]]:
    """Return who rows of the table ``archive`` leave in each entry."""
    last = {row["entry"]: row for row in rows}
    return {at: identity(row) for at, row in last.items() if row["birth"] is not None}


@pytest.fixture(scope="module")
def lived() -> ArchipelagoRun:
    return ArchipelagoRun(EXPERIMENT).live()


def test_runs_are_equal_whatever_the_order_of_answers(lived: ArchipelagoRun) -> None:
    other = ArchipelagoRun(EXPERIMENT, order=cycle([3, 1, 4, 1, 5]), slow=(2,))
    assert other.live().outcome == lived.outcome


def test_the_population_of_map_elites_is_its_archive(lived: ArchipelagoRun) -> None:
    population: tuple[Individual, ...] = lived.islands[0].population
    cells = {cell_name(cell_of(GRID, one.measures)): one for one in population}
    assert len(cells) == len(population)
    assert content(archive_rows(lived)) == {at: one.birth for at, one in cells.items()}
    natives = [row for row in lived.rows("evaluations") if row["island"] == 0]
    for row in natives:
        elite = cells[cell_name(cell_of(GRID, dict(row["measures"])))]
        assert elite.fitness >= row["fitness"]


def test_the_rule_of_the_receiver_judges_migrants(lived: ArchipelagoRun) -> None:
    sent = [row for row in lived.rows("migrations") if row["to"] == 0]
    arrived = {(row["birth_island"], row["birth"]) for row in sent}
    entered = {identity(row) for row in archive_rows(lived)}
    assert arrived & entered
    assert arrived - entered


@pytest.mark.parametrize("rule", ["novelty", "age-layered"])
def test_arenas_select_parents_by_rules_of_diversity(rule: str) -> None:
    novelty = {"distance": "body", "every": 4, "capacity": 3}
    selection = SelectionSection(
        population=5,
        tournament_size=2,
        parents=rule,
        parents_parameters=novelty if rule == "novelty" else {},
    )
    arena = Experiment("test", births=20, selection=selection, islands=(ARENA,))
    by_fitness = replace(arena, selection=SelectionSection(population=5))
    run, other = (ArchipelagoRun(each).live() for each in (arena, by_fitness))
    assert run.rows("births") != other.rows("births")
    rows = archive_rows(run)
    entries = [row["entry"] for row in rows if row["birth"] is not None]
    expected = {f"0:{number}" for number in range(0, 20, 4)}
    assert set(entries) == (expected if rule == "novelty" else set())
    assert all(row["sim_time_s"] > 0 for row in rows)
    assert len(content(rows)) == (3 if rule == "novelty" else 0)
