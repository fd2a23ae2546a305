"""Archive maps: which run and robots they show, and how the report shows them."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.figures import archive_maps as archive_maps_module
from analysis.figures.archive_maps import (
    ArchiveMap,
    archive_maps,
    draw_map,
    map_caption,
    map_figures,
    map_texts,
)
from analysis.measures.load import LoadedRun
from analysis.render.plan import Outline
from analysis.report.interactive import interactive
from schema.errors import RunFolderError
from schema.experiment.document import Experiment
from schema.experiment.grid import Grid
from tests.analysis.drawn import table

SQUARE = Outline(np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)]), "#111111")
GRID = Grid(("size", "energy", "turning"), bounds=((0, 30), (0, 1), (0, 1)),
            bins=(3, 2, 2))  # fmt: skip


def cell(folder: str, name: str, fitness: float, birth: int = 0) -> dict[str, Any]:
    return {"experiment": "e", "folder": folder, "island": 0, "cell": name,
            "birth_island": 0, "birth": birth, "fitness": fitness}  # fmt: skip


def made(
    grid: Grid, *rows: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> ArchiveMap:
    def outlines(_: LoadedRun, robots: list[Any]) -> list[list[Outline]]:
        return [[SQUARE]] * len(robots)

    monkeypatch.setattr(archive_maps_module, "_outlines", outlines)
    settings = Experiment(name="e", grid=grid)
    runs = {
        Path(name): LoadedRun(Path(name), "e", 0, 1, "finished", "", settings)
        for name in ("a", "b")
    }
    (one,), problems = archive_maps(table("cells", list(rows)), runs)
    assert not problems
    return one


def test_a_map_has_the_fittest_of_the_fullest_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of three measures the first two are shown, of islands the best."""
    one = made(
        GRID,
        cell("a", "0/0/0", 9.0), cell("a", "0/0/1", 8.0),
        cell("b", "0/0/0", 1.0), cell("b", "0/0/1", 2.0, birth=4),
        cell("b", "2/1/0", 3.0), cell("b", "2/1/0", 4.0, birth=7) | {"island": 1},
        monkeypatch=monkeypatch,
    )  # fmt: skip
    assert one.folder == Path("b")
    shown = [(each.x, each.y, each.fitness, each.robot) for each in one.cells]
    assert sorted(shown) == [(0, 0, 2.0, "0:4"), (2, 1, 4.0, "0:7")]
    caption = map_caption(one)
    assert "3 of 12 cells" in caption
    assert "over all bins of turning" in caption
    (figure,) = map_figures([one], {}, {"e": "m/s"})
    axes, bar = figure.drawn({"cells": table("cells", [cell("b", "0/0/0", 1.0)])}).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("size", "energy [J]")
    assert bar.get_ylabel() == "fitness [m/s]"


def test_the_page_tells_robot_and_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    one = made(
        GRID, cell("a", "0/0/0", 1.0), cell("a", "2/1/0", 2.0, birth=5),
        monkeypatch=monkeypatch,
    )  # fmt: skip
    text = interactive(draw_map({}, one, ""), map_texts(one), "map")
    second, first = re.findall(
        r'<g class="robot"><title>(.*?)</title>', text, re.DOTALL
    )
    assert first.startswith("robot 0:0: fitness 1\nsize 0 to 10\nenergy 0 to 0.5")
    assert second.startswith("robot 0:5: fitness 2\nsize 20 to 30\nenergy 0.5 to 1")
    # Bins are counted from the lower left; y of SVG is downwards.
    places = re.findall(r'</title>\s*<path d="M ([\d.]+) ([\d.]+)', text)
    (right, top), (left, bottom) = (tuple(map(float, each)) for each in places)
    assert right > left
    assert bottom > top


def test_one_measure_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = Grid(("size",), bounds=((0, 30),), bins=(3,))
    one = made(grid, cell("a", "1", 1.0), monkeypatch=monkeypatch)
    assert [(each.x, each.y) for each in one.cells] == [(1, 0)]
    wide, high = draw_map({}, one, "").get_size_inches()
    assert high < wide / 2
    assert [*map_texts(one).values()] == ["robot 0:0: fitness 1\nsize 10 to 20"]


def test_robots_that_cannot_be_read_are_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        raise RunFolderError("a: births is damaged")

    monkeypatch.setattr(archive_maps_module, "_map", fail)
    maps, problems = archive_maps(
        table("cells", [cell("a", "0/0/0", 1.0)]),
        {Path("a"): None},  # type: ignore[dict-item]
    )
    (figure,) = map_figures(maps, problems, {})
    assert (figure.number, figure.nothing) == ("P-e", "a: births is damaged")
