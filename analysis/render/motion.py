"""Motion of robots at the rate of a film, and cameras that show it."""

from collections.abc import Sequence
from copy import copy
from math import cos, sin
from typing import Any

import numpy as np

from analysis.render.flags import CAMERAS
from analysis.render.picture import Frame, RobotRenderer, Simulate
from analysis.render.stage import AZIMUTH, LOW
from schema.experiment.document import body_space
from schema.experiment.scenery import object_count
from schema.experiment.settings import EvaluationSettings
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

Shown = dict[str, tuple[Robot, EvaluationSettings]]
"""Robots and their settings by name."""
_ELEVATIONS = dict(zip(CAMERAS, (LOW, LOW, -6.0, -90.0), strict=True))
"""Elevation of the view by the name of a camera [degrees]."""
_CALM_S = 1.0
"""Time over which a camera that follows a robot averages its places [s]."""
_GAP_M = 0.2
"""Distance between the outer parts of robots side by side [m]."""
_STILL_M = 0.05
"""Way below which a robot has no direction [m]."""


def recorded(
    simulate: Simulate,
    robot: Robot,
    settings: EvaluationSettings,
    interval_s: float,
    commands: list[Floats] | None = None,
) -> list[Floats]:
    """Return the states of an evaluation, (nq,) each, at equal intervals [s].

    The worker's simulation shows a state per tick of the brain; a copy of it is stepped
    from there with the same commands, (M,), which are appended to a list.

    Raises:
        SimulationDiverged: the physics diverged.
    """
    poses: list[Floats] = []
    clock = settings.simulation

    def watch(data: Any) -> None:  # noqa: ANN401 - of a library imported later
        from mujoco import mj_step  # noqa: PLC0415 - after its engine is chosen

        twin = copy(data)
        if commands is not None:
            commands.append(data.ctrl.copy())
        for _ in range(clock.brain_steps):
            if twin.time + 0.5 * clock.timestep_s >= len(poses) * interval_s:
                poses.append(twin.qpos.copy())
            mj_step(twin.model, twin)

    simulate(robot, settings, watch=watch)
    return poses


def lanes(motions: Sequence[Sequence[Floats]], shown: Shown) -> list[Floats]:
    """Return the motions of robots, (T, 7 + J) each, from a start line on.

    Several are side by side, and each is turned so that it ends straight before its
    start. Objects of scenery are left out.
    """
    right = np.array([sin(np.radians(AZIMUTH)), -cos(np.radians(AZIMUTH))])
    ahead = np.array([-right[1], right[0]])
    paths, end_m = [], 0.0
    for poses, (robot, own) in zip(motions, shown.values(), strict=True):
        objects = object_count(own.environment, own.simulation)
        path = np.array(poses)
        path = path[:, : path.shape[1] - 7 * objects]
        if len(motions) == 1:
            return [path]
        way = path[-1, :2] - path[0, :2]
        turn = np.arctan2(right[1], right[0]) - np.arctan2(way[1], way[0])
        turned = _turned(path, turn if np.hypot(*way) > _STILL_M else 0.0)
        across = turned[:, :2] @ ahead
        places = place_parts(robot, shapes_of(robot, body_space(own.space)))[1]
        reach_m = float(np.linalg.norm(places, axis=1).max())
        start_m = end_m + reach_m - across.min()
        turned[:, :2] += start_m * ahead
        end_m = start_m + across.max() + reach_m + _GAP_M
        paths.append(turned)
    return paths


def side_by_side(motions: Sequence[Sequence[Floats]], shown: Shown) -> list[Floats]:
    """Return ``lanes`` as one motion; robots whose motion is shorter wait."""
    paths = lanes(motions, shown)
    return [
        np.concatenate([path[min(at, len(path) - 1)] for path in paths])
        for at in range(max(map(len, paths)))
    ]


def _turned(path: Floats, turn: float) -> Floats:
    """Return states about their first place, (T, nq), turned about the vertical."""
    c, s = cos(turn), sin(turn)
    turned = path.copy()
    turned[:, :2] = (path[:, :2] - path[0, :2]) @ [[c, s], [-s, c]]
    (w, x, y, z), c, s = path[:, 3:7].T, cos(turn / 2), sin(turn / 2)
    turned[:, 3:7] = np.stack(
        [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1
    )
    return turned


def frames(
    renderer: RobotRenderer, poses: Sequence[Floats], camera: str, interval_s: float
) -> list[Frame]:
    """Return the places of a camera of ``CAMERAS``, one per pose; turn it there.

    ``follow`` moves with the robots; the others stand still and see their whole way,
    ``side`` and ``top`` with the way to the right.
    """
    middles = np.array([renderer.middle(pose) for pose in poses])
    way = middles[-1] - middles[0]
    azimuth = AZIMUTH
    if camera in ("side", "top") and np.hypot(*way[:2]) > _STILL_M:
        azimuth = 90.0 + float(np.degrees(np.arctan2(way[1], way[0])))
    renderer.stage.view = azimuth, _ELEVATIONS[camera]
    if camera != "follow":
        return [renderer.framing(poses)] * len(poses)
    reach = round(0.5 * _CALM_S / interval_s)
    window = np.ones(2 * reach + 1) / (2 * reach + 1)
    padded = np.pad(middles, ((reach, reach), (0, 0)), "edge")
    calm = np.stack([np.convolve(row, window, "valid") for row in padded.T], axis=1)
    # Only in the plane: jumps and falls are seen.
    calm[:, 2] = 0.0
    look_at, distance_m = renderer.framing(poses, calm)
    return [(look_at + place, distance_m) for place in calm]
