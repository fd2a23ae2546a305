"""Tests of the files of figures and films."""

import io
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from PIL import Image, ImageSequence
from rich.progress import Progress

from analysis.figures import figure_writer
from analysis.figures.catalogue import Figure, missing
from analysis.figures.family_tree import Best
from analysis.figures.figure_writer import FigureWriter, draw_figures, film
from analysis.figures.robot_pictures import RobotPicture
from analysis.render.stage import Picture
from tests.analysis.drawn import table


def tree_of(experiment: str) -> Figure:
    return Figure(
        f"G-{experiment}", "Ancestry", "", (), lambda _: plt.figure(figsize=(1, 1)),
        "robots", f"ancestry-of-{experiment}",
    )  # fmt: skip


def robot_of(experiment: str, shade: int) -> RobotPicture:
    pictures = tuple(np.full((8, 8, 3), shade, np.uint8) for _ in range(2))
    best = Best(experiment, Path("f"), 0, 0, 1, 0.1)
    return RobotPicture(best, (), (), pictures, 0.0, None, {}, {}, "page")


def test_each_experiment_has_files_of_its_own(tmp_path: Path) -> None:
    writer = FigureWriter(tmp_path)
    names = ("a b", "A-b", "sw-map=maps/a.png", f"sw-list=[{'1,' * 200}]")
    for experiment in names:
        writer.add(tree_of(experiment), {})
    films = [writer.add_film(robot_of(name, 60 * at)) for at, name in enumerate(names)]
    pictures = [one.files[1] for one in writer.drawn]
    assert [path.name for path in pictures[:3]] == [
        "G-ancestry-of-a-b.png",
        "G-ancestry-of-A-b-2.png",
        "G-ancestry-of-sw-map=maps-a.png.png",
    ]
    assert {path for path in pictures if path.is_file()} == {*tmp_path.glob("*.png")}
    assert len({*pictures}) == len({*tmp_path.glob("*.pdf")}) == len(names)
    assert [path.name for _, path in films[:3]] == [
        "best-robot-of-a-b.gif",
        "best-robot-of-A-b-2.gif",
        "best-robot-of-sw-map=maps-a.png.gif",
    ]
    for at, (_, path) in enumerate(films):
        with Image.open(path) as shown:
            assert abs(int(np.asarray(shown.convert("L"))[4, 4]) - 60 * at) < 8


def test_a_left_out_figure_removes_only_its_own_earlier_files(tmp_path: Path) -> None:
    (tmp_path / "6.2-fitness.png").touch()
    writer = FigureWriter(tmp_path)
    writer.add(tree_of("b"), {})
    for number in ("G-ancestry", "6.2"):
        writer.add(missing(number, "there is none"), {})
    assert [path.name for path in tmp_path.glob("*.png")] == ["G-ancestry-of-b.png"]


def test_a_caption_is_a_text_file_beside_its_figure(tmp_path: Path) -> None:
    figure = replace(tree_of("b"), caption=lambda tables: f"Of {tables['name']}.")
    FigureWriter(tmp_path).add(figure, {"name": table("runs", [])})
    text = (tmp_path / "G-ancestry-of-b.txt").read_text()
    assert text.startswith("Ancestry. Of pyarrow.Table")


def test_figures_of_robots_name_what_is_missing(tmp_path: Path) -> None:
    """A robot that was evaluated before its run was interrupted is in no population."""
    names = ("outcomes", "progression", "runs", "populations", "extremities",
             "findings")  # fmt: skip
    robot = {"experiment": "scenario1", "folder": "f", "fitness": 0.1, "is_last": False}
    tables = {name: table(name, []) for name in names} | {
        "robots": table("robots", [robot])
    }
    found = draw_figures(tables, {}, tmp_path, lambda: NotImplemented, Progress())
    why = {one.what: one.why for one in found.left_out}
    assert why["figure 6.10"] == "no evaluated robot is in a recorded population"
    assert why["figure 6.18"] == (
        "no evaluated robot of scenario1 is in a recorded population"
    )


DRAW = """
import sys
from pathlib import Path
from analysis.figures.style import save
from matplotlib import pyplot
save(pyplot.subplots()[0], Path(sys.argv[1]))
"""


def test_figures_do_not_depend_on_a_users_settings(tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_text("axes.facecolor: red\nfont.size: 40\n")
    drawn = []
    for name, settings in (("plain", {}), ("users", {"MATPLOTLIBRC": str(tmp_path)})):
        command = [sys.executable, "-c", DRAW, str(tmp_path / name)]
        subprocess.run(command, env={**os.environ, **settings}, check=True)
        drawn.append((tmp_path / name).with_suffix(".png").read_bytes())
    assert drawn[0] == drawn[1]


def read(stored: bytes) -> list[tuple[Picture, float]]:
    """Return the pictures of a film, and for how long each is shown [ms]."""
    with Image.open(io.BytesIO(stored)) as shown:
        assert shown.info["loop"] == 0
        return [
            (np.asarray(frame.convert("RGB")), frame.info["duration"])
            for frame in ImageSequence.Iterator(shown)
        ]


def test_a_film_has_all_pictures_and_repeats() -> None:
    pictures = [np.full((20, 30, 3), shade, np.uint8) for shade in (0, 100, 200)]
    found = read(film(pictures, 0.1))
    assert [time_ms for _, time_ms in found] == [100, 100, 100]
    for (shown, _), given in zip(found, pictures, strict=True):
        assert shown.shape == (20, 30, 3)
        assert shown[10, 15] == pytest.approx(given[10, 15], abs=8)


def test_a_film_above_the_limit_loses_colours_then_pictures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(1)
    pictures = [rng.integers(0, 255, (40, 40, 3), np.uint8) for _ in range(8)]
    monkeypatch.setattr(figure_writer, "MOST_BYTES", 5000)
    stored = film(pictures, 0.1)
    assert len(stored) <= 5000
    found = read(stored)
    assert 1 < len(found) < 8
    # The film lasts as long as before.
    assert sum(time_ms for _, time_ms in found) == pytest.approx(800)
