"""Tests of families of robots and the figures that show them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.image import AxesImage

from analysis.figures.family_tree import Best, best_robots, lineage, ordered, row_of
from analysis.figures.pictures import family_tree, gaits
from analysis.figures.robot_pictures import FOUNDERS, RobotPicture
from analysis.figures.robots import lineages
from analysis.measures.families import families, family
from analysis.measures.outputs import schema
from analysis.measures.run_tables import RunTables
from schema.errors import RunFolderError
from schema.robot.ids import BirthId
from schema.tables.last_populations import best_of
from tests.analysis.bodies import Body, part
from tests.analysis.tables import births, population


def body(*genes: int) -> Body:
    """Return a core and bricks on it, with these genes."""
    parts = [part(at, -1 if at == 0 else 0, at - 1, "X") for at in range(len(genes))]
    return [{**one, "gene": gene} for one, gene in zip(parts, genes, strict=True)]


@pytest.fixture
def members() -> pa.Table:
    """Return births 0, 1, 2 (founders), 3 of 0 and 1, 4 of 3 and 1, 5 of 4 and 3."""
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


def test_an_ancestor_is_on_its_nearest_level_only(members: pa.Table) -> None:
    found = family(members, 5, 3)
    assert found.levels == ((5,), (4, 3), (1, 0))
    assert found.edges == ((5, 4), (5, 3), (4, 3), (4, 1), (3, 0), (3, 1))
    assert family(members, 5, 2).edges == ((5, 4), (5, 3), (4, 3))
    assert family(members, 2).levels == ((2,),)


def test_founders_are_robots_without_parents_whose_parts_survive(
    members: pa.Table,
) -> None:
    found = family(members, 5, 2)
    # In 5, 4 and 3 founder 1 has four parts, founder 0 one and founder 2 none. Gene 99
    # was added by mutation.
    assert found.founders == (1, 0)
    assert found.founder_of == {10: 0, 20: 1, 21: 1, 30: 2}


def test_parts_without_identity_have_no_founder() -> None:
    zero, one = (0, 0), (0, 1)
    bodies = [body(0, 0), body(0, 7), body(0, 7)]
    born = births((zero, []), (one, []), ((0, 2), [zero, one]), body=bodies)
    found = family(born, 2)
    assert found.founders == (1,)
    assert found.founder_of == {7: 1}


def test_families_are_those_of_the_fittest_of_the_last_populations(
    members: pa.Table,
) -> None:
    rows = [(15, 4, 0.9), (30, 3, 0.1), (30, 5, 0.3), (30, 2, None)]
    levels = [(0, births, {(0, birth): fitness}) for births, birth, fitness in rows]
    living = population(*levels, is_online=True)
    run = RunTables({"births": members, "population": living})
    (found,) = families(run).to_pylist()
    assert (found["births"], found["birth"], found["members"]) == (30, 5, 5)
    # Bodies differ by their numbers of parts: 2, 3, 2, 2, 1 in the family, so 1 in six
    # pairs and 2 in one; 1, 2, 1 of founders.
    assert found["distance"] == pytest.approx((6 * 1 + 2) / 10)
    assert found["founder_distance"] == pytest.approx(2 / 3)
    assert found["founders"] == 2


def test_the_robot_of_a_family_may_be_an_immigrant() -> None:
    home, away = (0, 0), (1, 0)
    living = population((0, 15, {home: 0.5}), (1, 15, {home: 0.4, away: 0.1}))
    born = births((home, []), (away, []))
    rows = families(RunTables({"births": born, "population": living})).to_pylist()
    names = ("island", "birth_island", "birth")
    assert [[row[name] for name in names] for row in rows] == [[0, 0, 0], [1, 0, 0]]


def test_lineage_is_all_ancestors_parents_first(members: pa.Table) -> None:
    found = lineage(members, "x", 4)
    assert found["order"].to_pylist() == [0, 1, 3, 4]
    assert found["rank"].to_pylist() == [1, 1, 2, 3]
    assert found["parents"].to_pylist() == [[], [], [0, 1], [3, 1]]
    shown = lineages({"lineage": found})
    lines = next(
        layer._data for layer in shown.layers if "segment" in type(layer.geom).__name__
    )
    ends = zip(lines["number"], lines["to"], strict=True)
    assert sorted(ends) == [(3, 0), (3, 1), (4, 1), (4, 3)]


def test_the_best_robot_is_the_fittest_of_the_last_population() -> None:
    rows = [
        {"experiment": "b", "folder": "f", "island": 3, "birth_island": 0, "birth": n,
         "is_last": n != 1, "is_failed": n == 4, "fitness": fitness}
        for n, fitness in enumerate([-0.1, 0.9, -0.3, -0.1, 0.0])
    ]  # fmt: skip
    (found,) = best_robots(pa.Table.from_pylist(rows, schema("robots")))
    assert found == Best("b", Path("f"), 3, 0, 0, -0.1)


def test_of_equally_fit_robots_the_best_is_that_of_the_end_of_a_run() -> None:
    rows = [
        {"experiment": "x", "folder": folder, "island": island, "birth_island": home,
         "birth": birth, "is_last": True, "is_failed": False, "fitness": 0.5}
        for folder, island, home, birth in (
            ("f", 0, 1, 3), ("f", 0, 0, 7), ("f", 1, 0, 4), ("f", 0, 0, 4),
            ("g", 0, 0, 4),
        )
    ]  # fmt: skip
    (found,) = best_robots(pa.Table.from_pylist(rows, schema("robots")))
    assert best_of(rows[:4]) == rows[3]
    assert found == Best("x", Path("f"), 0, 0, 4, 0.5)


def test_row_of_a_robot_is_found_by_its_birth_id(members: pa.Table) -> None:
    assert row_of(Best("x", Path("f"), 0, 0, 4, 0.0), members) == 4
    with pytest.raises(RunFolderError, match="birth 4 is not recorded"):
        row_of(Best("x", Path("f"), 0, 1, 4, 0.0), members)


def test_a_level_is_sorted_by_the_level_below() -> None:
    # 3 is a parent of 2, 4 of 1: sorted by number their lines would cross.
    assert ordered([[0], [1, 2], [3, 4]], [(0, 1), (0, 2), (2, 3), (1, 4)]) == [
        [0],
        [1, 2],
        [4, 3],
    ]


@pytest.fixture
def robot_picture(members: pa.Table) -> RobotPicture:
    relatives = family(members, 5, 3)
    pictures = {row: np.full((9, 16, 3), row, np.uint8) for row in range(6)}
    return RobotPicture(
        Best("scenario1", Path("f"), 0, 0, 5, 0.25),
        (pictures[0], pictures[1]),
        (0.0, 0.5),
        (pictures[0], pictures[1]),
        0.031,
        relatives,
        pictures,
        {row: BirthId(0 if row else 1, row) for row in pictures},
        "page",
    )


def shade(image: AxesImage) -> int:
    """Return the grey level of a picture's corner, which is the robot's row."""
    pixels = image.get_array()
    assert pixels is not None
    return int(pixels[0, 0, 0])


def test_a_tree_shows_each_ancestor_once_and_founders_on_top(
    robot_picture: RobotPicture,
) -> None:
    assert robot_picture.family is not None
    fitness = {BirthId(0, 5): 0.25}
    figure = family_tree(robot_picture, robot_picture.family, fitness, "m/s")
    (axes,) = figure.axes
    heights = [(shade(image), image.get_extent()[2]) for image in axes.images]
    texts = [text.get_text() for text in axes.texts]
    numbers, note = texts[:5], texts[5]
    # 0 was born on another island.
    assert {*numbers} == {"5  0.25", "4", "3", "1", "1:0"}
    assert note == "founders whose parts these robots have"
    assert {*texts[6:8]} == {"founder 1", "founder 1:0"}
    assert texts[8].endswith("fitness [m/s]")
    legend = axes.get_legend()
    assert legend is not None
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["parent", "parent on another level"]
    by_row: dict[int, list[float]] = {}
    for row, height in heights:
        by_row.setdefault(row, []).append(height)
    assert by_row[5] < by_row[4] == by_row[3] < by_row[1]
    # Near founders are shown twice: on their level, and above the dashed line.
    (line,) = [one for one in axes.lines if one.get_linestyle() == "--"]
    dashed = float(np.asarray(line.get_ydata())[0])
    assert [sum(at > dashed for at in by_row[row]) for row in (0, 1, 4)] == [1, 1, 0]
    frames = {tuple(patch.get_edgecolor()[:3]) for patch in axes.patches}
    assert {FOUNDERS[0], FOUNDERS[1]} <= frames


def test_gaits_are_shown_in_rows_with_times(robot_picture: RobotPicture) -> None:
    other = Best("mine", Path("f"), 0, 0, 5, 0.25)
    still = replace(robot_picture, best=other, moved_m=0.0)
    figure = gaits([robot_picture, still], {"scenario1": "weighted velocity"})
    assert len(figure.axes) == 4
    headings = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert headings == [
        "scenario 1, fitness 0.25 (weighted velocity), moved 3.1 cm in 0.5 s",
        "mine, fitness 0.25, stood still in these pictures",
    ]
    assert [axes.get_title() for axes in figure.axes] == ["0.0 s", "0.5 s"] * 2
    assert shade(figure.axes[3].images[0]) == 1
