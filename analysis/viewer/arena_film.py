"""Films of arenas, drawn from the poses of a run."""

import argparse
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from analysis.progress import bars
from analysis.render.arena_picture import ArenaRenderer, Poses
from analysis.render.files import NoPictures, gait_strip, save_film
from analysis.render.overlay import Overlay
from analysis.render.stage import Picture
from analysis.viewer.flags import FILM_S
from analysis.viewer.replay import (
    frames_of,
    last_time,
    read_past,
    read_poses,
    span_of,
)
from analysis.viewer.scene import scene_of
from schema.agent.log import tell_user
from schema.experiment.document import Experiment, island_experiment
from schema.experiment.settings import arena_settings_of
from schema.plugins.permission import allow
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.updates import Update

SPEED = 2.0
"""Simulated time by time of the film."""
_SIZE = 640, 480
_COLUMNS = 2
"""Arenas side by side."""

Frames = Mapping[float, Poses]
"""Poses of an arena's robots by simulated time [s], ascending."""


def film(options: argparse.Namespace) -> int:
    """Write a film of the arenas of a run; return the exit code.

    Raises:
        RunFolderError: the folder has no run, or the run has no robot yet.
        NoPictures: the flags conflict, there are no poses, or the file cannot be
            written.
    """
    check_film(options)
    out: Path = options.save
    span = span_of(options, FILM_S, NoPictures)
    pictures, times_s = draw_film(options.run, span, _SIZE)
    interval_s = (times_s[-1] - times_s[0]) / max(1, len(times_s) - 1)
    save_film(pictures, out, interval_s / SPEED)
    tell_user(
        f"saved {out}: {times_s[0]:g} to {times_s[-1]:g} s at {SPEED:g} times real "
        "time; --from and --until choose others"
    )
    return 0


def check_film(options: argparse.Namespace) -> None:
    """Refuse flags of ``revolve view`` that a film or page does not take.

    Raises:
        NoPictures: the flags conflict.
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
        hint = "; of one robot: revolve robot render or page" if options.robot else ""
        raise NoPictures(f"--save {out}: a film takes no {', '.join(given)}{hint}")
    if options.run is None:
        raise NoPictures(f"--save {out}: a film needs a run folder")
    if not out.absolute().parent.is_dir():
        raise NoPictures(f"--save {out}: no such folder: {out.parent}")


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
    _, experiment, news = read_past(folder)
    islands: dict[int, dict[float, Poses]] = {}
    for island, table in read_poses(folder, *span):
        islands.setdefault(island, {}).update(frames_of(table))
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
                _renderer(experiment, island, frames, news, size)
            )
            for island, frames in islands.items()
        }
        pictures = []
        for time_s in bar.track(times_s, description="rendering"):
            beside = [
                renderers[island].picture(frames.get(time_s, {}), time_s)
                for island, frames in islands.items()
            ]
            texts = [
                f"{time_s:.2f} s   {one.overlay.text}".rstrip()
                for one in renderers.values()
            ]
            pictures.append(gait_strip(beside, texts, columns=_COLUMNS))
    return pictures, times_s


def _renderer(
    experiment: Experiment,
    island: int,
    frames: Frames,
    news: Update,
    size: tuple[int, int],
) -> ArenaRenderer:
    bodies = {one.birth: one.body for one in news.births}
    robots: dict[BirthId, Robot] = {}
    for birth in sorted({birth for poses in frames.values() for birth in poses}):
        body = bodies[birth]
        assert body is not None
        robots[birth] = Robot(body)
    settings = arena_settings_of(island_experiment(experiment, island))
    overlay = Overlay(one for one in news.samples if one.island == island)
    return ArenaRenderer(robots, settings, list(frames.values()), overlay, size=size)
