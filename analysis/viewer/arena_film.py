"""Films of arenas, drawn from the poses of a run: robots that live together."""

import argparse
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from analysis.progress import bars
from analysis.render.files import NoPictures, gait_strip, save_film
from analysis.render.overlay import Overlay
from analysis.render.stage import (
    AZIMUTH,
    HIDDEN_M,
    HIGH,
    Picture,
    Stage,
    add_rods,
    choose_engine,
    furnish,
)
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
from schema.experiment.document import Experiment, body_space, island_experiment
from schema.experiment.settings import ArenaSettings, arena_settings_of
from schema.plugins.permission import allow
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.wire.updates import Update

Poses = Mapping[BirthId, Floats]
"""Pose of each living robot, (7 + joints,): place of the core x, y, z [m], attitude w,
x, y, z, and the angle of every joint by ascending part [rad; m of a slider]."""
_LEAST_REACH_M = 0.5
_RIM_M = 0.005
"""Half height of walls between the camera and the robots [m]."""
_HEIGHTS = (2, 9)
"""Columns of a wall: z of its centre, half its height."""


class ArenaRenderer(AbstractContextManager["ArenaRenderer"]):
    """Renders robots on the ground of their arena; a context manager.

    The camera stands still, so that it sees all robots of some frames.

    Attributes:
        overlay: as of the last picture.
    """

    def __init__(
        self,
        robots: Mapping[BirthId, Robot],
        settings: ArenaSettings,
        frames: Sequence[Poses],
        overlay: Overlay,
        *,
        size: tuple[int, int],
    ) -> None:
        """Build the model of all robots with a pose in a frame, and place the camera.

        Raises:
            ExperimentError: invalid scenery.
        """
        choose_engine()
        from schema.mjcf import model as mjcf  # noqa: PLC0415 - imports MuJoCo

        space, world = body_space(settings.space), settings.simulation
        places = np.array([pose[:2] for poses in frames for pose in poses.values()])
        reach_m = max(_LEAST_REACH_M, float(np.ptp(places, axis=0).max()))

        walls = _lowered(mjcf.ring_wall(settings.arena))

        def furnish_arena(spec: Any) -> None:  # noqa: ANN401 - imported late
            mjcf.add_walls(spec, walls)
            furnish(None, settings.light, reach_m, spec)
            add_rods(overlay.most_rods, reach_m, spec)

        specs = [
            (f"{birth.name}/", mjcf.robot_spec(one, space, world).spec)
            for birth, one in robots.items()
        ]
        model = mjcf.shared_model(
            specs, world, settings.environment, furnish=furnish_arena
        )
        self._stage = Stage(model, size, (AZIMUTH, HIGH), is_fine=False)
        self._starts = {
            birth: int(model.joint(f"{prefix}free").qposadr[0])
            for birth, (prefix, _) in zip(robots, specs, strict=True)
        }
        self.overlay = overlay
        self._paint = model.geom_rgba.copy()
        self._camera = self._framing(frames)

    def __exit__(self, *_: object) -> None:
        self._stage.close()

    def picture(self, poses: Poses, time_s: float = 0.0) -> Picture:
        """Return a picture of robots in their poses; the others are not shown.

        The time is that of the overlay [s], which goes on.
        """
        model, overlay = self._stage.model, self.overlay
        overlay.advance(time_s)
        model.geom_rgba[:] = self._paint
        for birth in self._starts.keys() & overlay.colours.keys():
            root = model.body(f"{birth.name}/root").id
            own = model.body_rootid[model.geom_bodyid] == root
            model.geom_rgba[own, :3] = np.divide(overlay.colours[birth], 255.0)
        self._pose(poses)
        self._stage.show_rods(overlay.rods(time_s, poses))
        return self._stage.picture(*self._camera)

    def _pose(self, poses: Poses) -> None:
        qpos = self._stage.data.qpos.copy()
        for birth, start in self._starts.items():
            if birth in poses:
                qpos[start : start + len(poses[birth])] = poses[birth]
            else:
                qpos[start + 2] = HIDDEN_M
        self._stage.pose(qpos)

    def _framing(self, frames: Sequence[Poses]) -> tuple[Floats, float]:
        """Return the point that the camera looks at, and its distance from there."""
        model, data = self._stage.model, self._stage.data
        # Geoms of the world have no moving root.
        is_own = model.body_dofnum[model.body_rootid[model.geom_bodyid]] > 0
        seen = []
        for poses in frames:
            self._pose(poses)
            is_shown = is_own & (data.geom_xpos[:, 2] > 0.5 * HIDDEN_M)
            places, radii = data.geom_xpos[is_shown], model.geom_rbound[is_shown, None]
            seen += [places + radii * axis for axis in (*np.eye(3), *-np.eye(3))]
        points = np.concatenate(seen)
        look_at, distance_m = self._stage.framing(points)
        self._stage.shadow_m = float(np.linalg.norm(points - look_at, axis=1).max())
        return look_at, distance_m


def _lowered(walls: Floats) -> Floats:
    """Return (W, 10) walls, on the camera's side only a rim, which hides no robot."""
    view = np.radians(AZIMUTH)
    is_near = walls[:, 0] * np.cos(view) + walls[:, 1] * np.sin(view) < 0.0
    lowered = walls.copy()
    lowered[np.ix_(is_near, _HEIGHTS)] = _RIM_M
    return lowered


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
