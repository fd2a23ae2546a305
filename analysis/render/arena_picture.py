"""Pictures of the robots that live together in an arena."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

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
from schema.experiment.document import body_space
from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats

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
