"""``revolve view RUN --save arena.html``: an arena that moves in a browser."""

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.page.content import grounds, moving, page
from analysis.render.files import NoPictures, writing
from analysis.viewer.arena_film import check_film
from analysis.viewer.body import numbers_of
from analysis.viewer.flags import FILM_S
from analysis.viewer.replay import read_past, read_poses, rows_by_robot, span_of
from analysis.viewer.scene import scene_of
from schema.agent.log import tell_user
from schema.robot.robot import Robot
from schema.tables.files import read_table
from schema.wire.updates import Update

_BETWEEN = 1.1
"""Distance of arenas side by side, by the width of one."""


def arena_page(options: argparse.Namespace) -> int:
    """Write a page of the arenas of a run; return the exit code.

    Raises:
        RunFolderError: the folder has no run, or the run has no robot yet.
        NoPictures: the flags conflict, there are no poses, or the file cannot be
            written.
    """
    check_film(options)
    folder: Path = options.run
    run, experiment, news = read_past(folder)
    scene = scene_of(experiment)
    span = span_of(options, FILM_S, NoPictures)
    poses: dict[int, list[pa.Table]] = {}
    for island, rows in read_poses(folder, *span):
        poses.setdefault(island, []).append(rows)
    if not poses:
        raise NoPictures(
            f"{folder}: no poses of an arena between {span[0]:g} and {span[1]:g} s; "
            "for robots off-line use: revolve robot page"
        )
    bodies = {one.birth: one.body for one in news.births}
    robots: list[dict[str, Any]] = []
    around: list[dict[str, Any]] = []
    for column, (island, tables) in enumerate(poses.items()):
        shift = np.zeros(10)
        shift[0] = 2.0 * _BETWEEN * scene.extent_m * column
        place = scene.islands.index(island)
        walls = scene.walls[place] + shift
        around += grounds(scene.surfaces[place] if not column else (), walls)
        for birth, rows in rows_by_robot(pa.concat_tables(tables)):
            body = bodies[birth]
            assert body is not None
            times = rows["sim_time_s"].to_numpy()
            path = np.hstack(numbers_of(rows))
            path[:, 0] += shift[0]
            interval_s = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
            robots.append(
                moving(
                    birth.name, Robot(body), scene.space, path, interval_s=interval_s,
                    start_s=float(times[0]), is_plain=True,
                )
            )  # fmt: skip
    content = {"robots": robots, "grounds": around, "curves": _curves(folder, news)}
    lead = (
        f"{span[0]:g} to {span[1]:g} s of simulated time. Drag to turn, scroll to "
        "zoom; click the name of a robot to follow it."
    )
    title = f"{run.experiment}: {folder.resolve().name}"
    with writing(options.save):
        options.save.write_text(page(title, lead, content), "utf-8")
    tell_user(f"saved {options.save}; --from and --until choose another time")
    return 0


def _curves(folder: Path, news: Update) -> list[dict[str, Any]]:
    changes: Counter[float] = Counter()
    for birth in news.births:
        if birth.sim_time_s is not None:
            changes[birth.sim_time_s] += 1
    for death in news.deaths:
        changes[death.sim_time_s] -= 1
    times = sorted(changes)
    alive = np.cumsum([changes[time_s] for time_s in times]).tolist()
    samples = read_table(folder, "fitness", ["sim_time_s", "fitness", "is_mature"])
    mature = samples.filter(pc.field("is_mature") & pc.field("fitness").is_valid())
    means = mature.group_by("sim_time_s").aggregate([("fitness", "mean")])
    means = means.sort_by("sim_time_s")
    return [
        {"title": "robots alive", "times": times, "values": alive},
        {
            "title": "mean fitness of mature robots",
            "times": means["sim_time_s"].to_pylist(),
            "values": means["fitness_mean"].to_pylist(),
        },
    ]
