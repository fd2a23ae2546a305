"""The best robot of a run is the same in its last lines, its tables and its report."""

from pathlib import Path

import pytest

from coordinator.storage.folder_status import folder_status
from schema.experiment.document import body_space
from schema.experiment.file import own_experiment
from schema.formats.files import read_robot
from schema.tables.files import read_table
from schema.tables.last_populations import best_ever
from schema.wire.born import robot_of_birth
from schema.wire.updates import individual

pytestmark = pytest.mark.system


def test_the_file_of_the_best_robot_is_that_of_the_last_population(
    small_arena_run: Path,
) -> None:
    """Also in an arena, whose robots are judged again after the last birth."""
    rows = read_table(small_arena_run, "population").to_pylist()
    births = max(row["births"] for row in rows)
    judged = [
        row for row in rows if row["births"] == births and row["fitness"] is not None
    ]
    best = max(judged, key=lambda row: row["fitness"])
    (island,) = folder_status(small_arena_run).islands
    assert island.best == best["fitness"]
    (document,) = read_table(small_arena_run, "runs")["document"].to_pylist()
    experiment = own_experiment(document)
    (row,) = [
        row
        for row in read_table(small_arena_run, "births").to_pylist()
        if individual(row) == individual(best)
    ]
    born = robot_of_birth(row["genome"], row["robot"], experiment)
    space = body_space(experiment.space)
    kept = read_robot(small_arena_run / "best.yaml", space)
    assert [part.kind for part in kept.parts] == [part.kind for part in born.parts]
    weights = [edge.weight for edge in born.brain.connections]
    assert [edge.weight for edge in kept.brain.connections] == weights
    assert next(best_ever(small_arena_run))["fitness"] >= best["fitness"]
