"""Films of arenas, drawn from the poses of a run."""

import argparse
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from analysis.measures.load import read_run
from analysis.progress import bars
from analysis.render.arena_picture import ArenaRenderer, Poses
from analysis.render.picture import NoPictures, gait_strip, save_animation
from analysis.render.stage import Picture
from analysis.viewer.flags import FILM_S
from analysis.viewer.replay import (
    last_time,
    read_news,
    read_poses,
    rows_by_robot,
    span_of,
)
from analysis.viewer.scene import scene_of
from schema.agent.log import tell_user
from schema.experiment.document import Experiment, island_experiment
from schema.experiment.file import experiment_from_text
from schema.experiment.settings import arena_settings_of
from schema.plugins.permission import allow
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.description import allow_plugins_of

SPEED = 2.0
"""Simulated time by time of the film."""
_SIZE = 640, 480
_COLUMNS = 2
"""Arenas side by side."""
_POSE = ("sim_time_s", "angles", "x", "y", "z", "qw", "qx", "qy", "qz")

Frames = Mapping[float, Poses]
"""Poses of an arena's robots by simulated time [s], ascending."""


def film(options: argparse.Namespace) -> int:
    """Write a film of the arenas of a run; return the exit code.

    Raises:
        RunFolderError: the folder has no run, or the run has no robot yet.
        NoPictures: the flags conflict, there are no poses, or the file cannot be
            written.
    """
    out: Path = options.save
    allow(options.plugins)
    unfit = {
        "--serve": options.serve,
        "--follow": options.follow,
        "--robot": options.robot,
        "--connect": options.connect,
    }
    if given := [flag for flag, value in unfit.items() if value]:
        hint = "; of one robot: revolve robot render" if options.robot else ""
        raise NoPictures(f"--save {out}: a film takes no {', '.join(given)}{hint}")
    if options.run is None:
        raise NoPictures(f"--save {out}: a film needs a run folder")
    if not out.absolute().parent.is_dir():
        raise NoPictures(f"--save {out}: no such folder: {out.parent}")
    span = span_of(options, FILM_S, NoPictures)
    pictures, times_s = draw_film(options.run, span, _SIZE)
    interval_s = (times_s[-1] - times_s[0]) / max(1, len(times_s) - 1)
    save_animation(pictures, out, interval_s / SPEED)
    tell_user(
        f"saved {out}: {times_s[0]:g} to {times_s[-1]:g} s at {SPEED:g} times real "
        "time; --from and --until choose others"
    )
    return 0


def draw_film(
    folder: Path, span: tuple[float, float], size: tuple[int, int]
) -> tuple[list[Picture], list[float]]:
    """Draw the arenas of a run, side by side, each of a size [pixels].

    Returns:
        A picture of each recorded time in a span [s], and the times [s].

    Raises:
        RunFolderError: the folder has no run, or the run has no robot yet.
        NoPictures: the run has no arena, or no poses are recorded.
    """
    run = read_run(folder)
    allow_plugins_of(folder)
    experiment = experiment_from_text(run.document, is_own=True)
    bodies = {one.birth: one.body for one in read_news(run).births}
    islands = read_frames(folder, *span)
    if not islands:
        if scene_of(experiment).arenas:
            raise NoPictures(
                f"{folder}: no poses of an arena between {span[0]:g} and {span[1]:g} "
                f"s; the run ends at {last_time(folder):g} s"
            )
        raise NoPictures(
            f"{folder}: the run has no arena; for the film of a robot use: revolve "
            "robot render"
        )
    times_s = sorted({time_s for frames in islands.values() for time_s in frames})
    with ExitStack() as stack, bars(f"rendering {len(times_s)} pictures") as bar:
        renderers = {
            island: stack.enter_context(
                _renderer(experiment, island, frames, bodies, size)
            )
            for island, frames in islands.items()
        }
        pictures = []
        for time_s in bar.track(times_s, description="rendering"):
            beside = [
                renderers[island].picture(frames.get(time_s, {}))
                for island, frames in islands.items()
            ]
            times = [time_s] * len(beside)
            pictures.append(gait_strip(beside, times, columns=_COLUMNS))
    return pictures, times_s


def read_frames(folder: Path, start_s: float, end_s: float) -> dict[int, Frames]:
    """Return the poses of a span, by island and time.

    Raises:
        RunFolderError: the table cannot be read.
    """
    islands: dict[int, dict[float, dict[BirthId, np.ndarray]]] = {}
    for island, table in read_poses(folder, start_s, end_s):
        frames = islands.setdefault(island, {})
        for birth, rows in rows_by_robot(table):
            columns = [rows[name].to_pylist() for name in _POSE]
            for time_s, angles, *core in zip(*columns, strict=True):
                frames.setdefault(time_s, {})[birth] = np.array([*core, *angles])
    return {island: dict(sorted(frames.items())) for island, frames in islands.items()}


def _renderer(
    experiment: Experiment,
    island: int,
    frames: Frames,
    bodies: Mapping[BirthId, tuple[Part, ...] | None],
    size: tuple[int, int],
) -> ArenaRenderer:
    robots: dict[BirthId, Robot] = {}
    for birth in sorted({birth for poses in frames.values() for birth in poses}):
        body = bodies[birth]
        assert body is not None
        robots[birth] = Robot(body)
    settings = arena_settings_of(island_experiment(experiment, island))
    return ArenaRenderer(robots, settings, list(frames.values()), size=size)
