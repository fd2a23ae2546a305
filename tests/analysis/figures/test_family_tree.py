"""Families by hand, and in the pictures that are made of them."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.image import AxesImage

from analysis.figures.family_tree import (
    Best,
    best_robots,
    family,
    lineage,
    ordered,
    row_of,
)
from analysis.figures.graphviz import NoDot, ordered_by_dot
from analysis.figures.pictures import FOUNDERS, family_tree, gaits
from analysis.figures.robot_pictures import RobotPicture
from analysis.figures.robots import lineages
from analysis.measures.outputs import schema
from schema.robot.ids import BirthId
from tests.analysis.bodies import Body, part
from tests.analysis.tables import births


def body(*genes: int) -> Body:
    """Return a core and bricks on it, with these genes."""
    parts = [part(at, -1 if at == 0 else 0, at - 1, "X") for at in range(len(genes))]
    return [{**one, "gene": gene} for one, gene in zip(parts, genes, strict=True)]


@pytest.fixture
def people() -> pa.Table:
    """Return 0, 1, 2 (founders), 3 of 0 and 1, 4 of 3 and 1, 5 of 4 and 3."""
    zero: tuple[int, int] = (0, 0)
    one, three, four = (0, 1), (0, 3), (0, 4)
    return births(
        (zero, []),
        (one, []),
        ((0, 2), []),
        (three, [zero, one]),
        (four, [three, one]),
        ((0, 5), [four, three]),
        body=[body(10), body(20, 21), body(30), body(20, 10), body(20, 21, 99),
              body(20, 99)],
        rank=[1, 1, 1, 2, 3, 4],
    )  # fmt: skip


def test_each_stands_where_it_is_nearest(people: pa.Table) -> None:
    found = family(people, 5, 3)
    assert found.levels == ((5,), (4, 3), (1, 0))
    assert found.edges == ((5, 4), (5, 3), (4, 3), (4, 1), (3, 0), (3, 1))
    assert family(people, 5, 2).edges == ((5, 4), (5, 3), (4, 3))
    assert family(people, 2).levels == ((2,),)


def test_founders_are_those_whose_parts_live_on(people: pa.Table) -> None:
    found = family(people, 5, 2)
    # In 5, 4 and 3: three parts are 1's, and its 21 once more; one is 0's. Gene 99
    # came by mutation, 2 left nothing.
    assert found.founders == (1, 0)
    assert found.paint == {10: 0, 20: 1, 21: 1, 30: 2}


def test_lineage_is_all_ancestors_parents_first(people: pa.Table) -> None:
    found = lineage(people, "x", 4)
    assert found["order"].to_pylist() == [0, 1, 3, 4]
    assert found["rank"].to_pylist() == [1, 1, 2, 3]
    assert found["parents"].to_pylist() == [[], [], [0, 1], [3, 1]]
    shown = lineages({"lineage": found})
    lines = next(
        layer._data for layer in shown.layers if "segment" in type(layer.geom).__name__
    )
    ends = zip(lines["number"], lines["to"], strict=True)
    assert sorted(ends) == [(3, 0), (3, 1), (4, 1), (4, 3)]


def test_a_lineage_over_islands_has_those_whose_rows_stand_behind() -> None:
    # 0:1 is a child of 0:0 and of 1:0, a migrant whose row comes later.
    family = births(((0, 0), []), ((0, 1), [(0, 0), (1, 0)]), ((1, 0), []),
                    rank=[1, 2, 1])  # fmt: skip
    found = lineage(family, "x", 1)
    assert found["order"].to_pylist() == [0, 2, 1]
    assert found["number"].to_pylist() == [0, 0, 1]
    shown = lineages({"lineage": found})
    lines = next(
        layer._data for layer in shown.layers if "segment" in type(layer.geom).__name__
    )
    assert list(zip(lines["number"], lines["to"], strict=True)) == [(1, 0), (1, 0)]
    shown.draw()


def test_the_best_is_the_fittest_of_the_last() -> None:
    rows = [
        {"experiment": "b", "folder": "f", "birth_island": 0, "birth": n,
         "is_last": n != 1, "fitness": fitness}
        for n, fitness in enumerate([0.1, 0.9, 0.3, 0.3])
    ]  # fmt: skip
    (found,) = best_robots(pa.Table.from_pylist(rows, schema("robots")))
    assert found == Best("b", Path("f"), 0, 2, 0.3)


def test_a_robot_has_its_row(people: pa.Table) -> None:
    assert row_of(Best("x", Path("f"), 0, 4, 0.0), people) == 4
    assert row_of(Best("x", Path("f"), 1, 4, 0.0), people) == -1


def test_levels_follow_the_one_below() -> None:
    # 3 is a parent of 2, 4 of 1: sorted by number their lines would cross.
    assert ordered([[0], [1, 2], [3, 4]], [(0, 1), (0, 2), (2, 3), (1, 4)]) == [
        [0],
        [1, 2],
        [4, 3],
    ]


def test_dot_is_asked_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NoDot, match="not installed"):
        ordered_by_dot([[0], [1, 2]], [(0, 1), (0, 2)])
    program = tmp_path / "dot"
    plain = "graph 1 2 2\\nnode 0 1 0 1 1\\nnode 1 1.8 1 1 1\\nnode 2 0.5 1 1 1\\nstop"
    program.write_text(f"#!/bin/sh\nread -r all\nprintf '{plain}'\n")
    program.chmod(0o755)
    assert ordered_by_dot([[0], [1, 2]], [(0, 1), (0, 2)]) == [[0], [2, 1]]
    program.write_text("#!/bin/sh\nexit 1\n")
    with pytest.raises(NoDot, match="does not answer"):
        ordered_by_dot([[0], [1, 2]], [(0, 1), (0, 2)])


@pytest.fixture
def robot_picture(people: pa.Table) -> RobotPicture:
    relatives = family(people, 5, 3)
    pictures = {who: np.full((9, 16, 3), who, np.uint8) for who in range(6)}
    return RobotPicture(
        Best("scenario1", Path("f"), 0, 5, 0.25),
        (pictures[0], pictures[1]),
        (0.0, 0.5),
        relatives,
        pictures,
        {who: BirthId(0 if who else 1, who) for who in pictures},
        lineage(people, "scenario1", 5),
    )


def shade(image: AxesImage) -> int:
    """Return the grey of a picture's corner, which is the robot's row."""
    pixels = image.get_array()
    assert pixels is not None
    return int(pixels[0, 0, 0])


def test_a_tree_shows_everybody_once_and_founders_on_top(
    robot_picture: RobotPicture,
) -> None:
    assert robot_picture.family is not None
    levels = ordered(robot_picture.family.levels, robot_picture.family.edges)
    fitness = {BirthId(0, 5): 0.25}
    (axes,) = family_tree(robot_picture, levels, fitness).axes
    heights = [(shade(image), image.get_extent()[2]) for image in axes.images]
    told = {
        text.get_text().split("  ")[0]: text.get_text().split("  ")[-1]
        for text in axes.texts
    }
    assert told["5"] == "0.250 m/s"
    # 0 was born on another island.
    assert set(told) == {"5", "4", "3", "1", "1:0", "founder 1", "founder 1:0"}
    by_who: dict[int, list[float]] = {}
    for who, height in heights:
        by_who.setdefault(who, []).append(height)
    assert by_who[5] < by_who[4] == by_who[3] < by_who[1]
    # Founders that are near stand twice: in their level, and above the dashed line.
    (line,) = [one for one in axes.lines if one.get_linestyle() == "--"]
    dashed = float(np.asarray(line.get_ydata())[0])
    assert [sum(at > dashed for at in by_who[who]) for who in (0, 1, 4)] == [1, 1, 0]
    frames = {tuple(patch.get_edgecolor()[:3]) for patch in axes.patches}
    assert {FOUNDERS[0], FOUNDERS[1]} <= frames


def test_gaits_stand_in_rows_with_their_times(robot_picture: RobotPicture) -> None:
    figure = gaits([robot_picture, robot_picture])
    assert len(figure.axes) == 4
    assert figure.axes[0].get_title(loc="left") == "scenario 1, 0.250 m/s"
    assert figure.axes[3].get_title() == "0.5 s"
    assert shade(figure.axes[3].images[0]) == 1
