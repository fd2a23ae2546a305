"""Tests of the selection of robots to re-simulate."""

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from analysis.viewer.motion import named_robot, selected_robots
from analysis.viewer.recording import ViewerError
from schema.robot.ids import BirthId
from schema.tables.files import parquet_path
from tests.analysis.tables import births, table


def write(folder: Path, **rows: list[dict[str, Any]]) -> None:
    for name in ("evaluations", "fitness", "population"):
        path = parquet_path(folder, "e", 0, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table(name, rows.get(name, [])), path)


def test_the_best_lives_at_the_end_and_the_best_ever_may_be_dead(
    tmp_path: Path,
) -> None:
    fitness = (0.1, 0.5, None, 0.5, 0.3)
    judged = [{"birth": n, "fitness": value} for n, value in enumerate(fitness)]
    last = [
        {"births": 4, "birth": 1, "fitness": 0.5},
        {"births": 5, "birth": 0, "fitness": 0.1},
        {"births": 5, "birth": 4, "fitness": 0.3},
    ]
    young = {"birth": 7, "fitness": 0.9, "is_mature": False}
    # The order of the table does not count.
    write(tmp_path, evaluations=judged[::-1], fitness=[young], population=last)
    said = "best of the last population: 0:4, fitness 0.3000"
    assert named_robot(tmp_path, "best") == (BirthId(0, 4), said)
    said = "best ever: 0:1, fitness 0.5000"
    assert named_robot(tmp_path, "best-ever") == (BirthId(0, 1), said)
    grown = {"birth": 8, "island": 2, "birth_island": 1, "fitness": 0.8}
    grown["is_mature"] = True
    write(tmp_path, evaluations=judged, fitness=[young, grown], population=last)
    birth, said = named_robot(tmp_path, "best-ever")
    assert birth == BirthId(1, 8)
    assert said == (
        "best ever: 1:8, fitness 0.8000 on island 2; shown as on its island of birth"
    )


@pytest.mark.parametrize("name", ["best", "best-ever"])
def test_without_evaluations_there_is_no_best(tmp_path: Path, name: str) -> None:
    write(tmp_path)
    with pytest.raises(ViewerError, match="no robot has a fitness yet"):
        named_robot(tmp_path, name)


def test_ancestry_follows_first_parents_each_once(tmp_path: Path) -> None:
    path = parquet_path(tmp_path, "e", 0, "births")
    path.parent.mkdir(parents=True)
    a, b, c, d = ((0, number) for number in range(4))
    pq.write_table(births((a, []), (b, []), (c, [b, a]), (d, [c, a])), path)
    names = [BirthId(*each) for each in (d, c, a)]
    found = selected_robots(tmp_path, names, has_ancestry=True)
    assert found == [BirthId(*each) for each in (d, c, b, a)]
    with pytest.raises(ViewerError, match="0:9: no robot of that name"):
        selected_robots(tmp_path, [BirthId(0, 9)], has_ancestry=False)
