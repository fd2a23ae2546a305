"""Pictures of one robot, or of several side by side."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial

import numpy as np

from analysis.render.overlay import Rod
from analysis.render.stage import Picture, Stage, add_rods, choose_engine, furnish
from schema.experiment.document import body_space
from schema.experiment.environment import Environment
from schema.experiment.settings import EvaluationSettings
from schema.parts import Vector
from schema.robot.robot import Robot
from schema.robot.trace import Floats, Trace

Simulate = Callable[..., Trace]
"""The worker's simulation of a robot with settings; it may take an ``identity``.

Each tick calls ``watch`` with ``MjData``.
"""
Frame = tuple[Floats, float]
"""Point that a camera looks at, (3,) [m], and its distance from there [m]."""
_REACH_M = 0.5
"""Scale of the scene, for clipping [m]."""
_CORNERS = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
_MOST_FRAMED = 100
"""Poses that decide about the place of a camera, at most."""


class RobotRenderer(AbstractContextManager["RobotRenderer"]):
    """Renders robots on a floor; a context manager.

    Attributes:
        model: MuJoCo model of the robots; poses are its ``qpos``: of one robot with the
            movable objects of its scenery, of several one after the other.
        stage: camera and light.
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        settings: EvaluationSettings,
        *,
        size: tuple[int, int] = (640, 480),
        background: Vector | None = None,
        rods: int = 0,
        is_fine: bool = True,
    ) -> None:
        """Build the model, with one robot in neutral pose.

        Several robots are on a plane. ``background`` is that of ``furnish``, ``rods``
        the greatest number of rods that a picture shows.

        Raises:
            ExperimentError: invalid scenery.
        """
        choose_engine()
        from schema.mjcf import model as mjcf  # noqa: PLC0415 - imports MuJoCo

        space, world = body_space(settings.space), settings.simulation
        light = settings.environment.light

        def furnished(spec: object, light: Vector | None = None) -> None:
            furnish(background, light, _REACH_M, spec)
            add_rods(rods, _REACH_M, spec)

        if isinstance(robots, Robot):
            spec = mjcf.solo_spec(
                robots, space, world, settings.environment,
                furnish=partial(furnished, light=light),
            )  # fmt: skip
            self.model, names = spec.compile(), [""]
        else:
            names = [f"{number}/" for number in range(len(robots))]
            specs = [mjcf.robot_spec(one, space, world).spec for one in robots]
            self.model = mjcf.shared_model(
                list(zip(names, specs, strict=True)), world, Environment(),
                furnish=furnished,
            )  # fmt: skip
        self.stage = Stage(self.model, size, is_fine=is_fine)
        self.stage.pose(self.stage.data.qpos)
        roots = [self.model.body(f"{name}root").id for name in names]
        self._geoms = np.isin(self.model.body_rootid[self.model.geom_bodyid], roots)
        self.starts = [int(self.model.joint(f"{n}free").qposadr[0]) for n in names]

    def __exit__(self, *_: object) -> None:
        self.stage.close()

    def picture(
        self,
        pose: Floats | None = None,
        frame: Frame | None = None,
        rods: Sequence[Rod] = (),
    ) -> Picture:
        """Return a picture of the robots in a pose.

        Args:
            pose: (nq,) ``qpos`` of the model; the previous pose if None.
            frame: place of the camera; None: to see the robots in this pose.
            rods: what else is shown.
        """
        stage = self.stage
        if pose is not None:
            stage.pose(pose)
        frame = frame or self.framing([stage.data.qpos.copy()])
        stage.show_rods(rods)
        return stage.picture(*frame, self.middle(stage.data.qpos))

    def cores(self, pose: Floats) -> Floats:
        """Return the positions of the robots' cores in a pose, (N, 3) [m]."""
        return np.stack([pose[start : start + 3] for start in self.starts])

    def middle(self, pose: Floats) -> Floats:
        """Return the mean of the positions of the robots' cores in a pose, (3,) [m]."""
        return np.asarray(self.cores(pose).mean(axis=0))

    def framing(self, poses: Sequence[Floats], shifts: Floats | None = None) -> Frame:
        """Return the place of a camera that sees robots and their shadows in poses.

        ``shifts``, (T, 3) [m], are subtracted from the places of each pose.
        """
        step = -(-len(poses) // _MOST_FRAMED)
        seen, reaches_m = [], []
        for number in range(0, len(poses), step):
            points = self._corners(poses[number])
            away = points - self.middle(poses[number])
            reaches_m.append(np.linalg.norm(away, axis=1).max())
            seen.append(points if shifts is None else points - shifts[number])
        self.stage.shadow_m = 1.05 * float(max(reaches_m))
        return self.stage.framing(np.concatenate(seen))

    def lowest_m(self, pose: Floats) -> float:
        """Return the height of the robots' lowest point in a pose [m]."""
        return float(self._corners(pose)[:, 2].min())

    def _corners(self, pose: Floats) -> Floats:
        """Return the corners of boxes around all geoms and their shadows, (N, 3)."""
        self.stage.pose(pose)
        data, fall = self.stage.data, self.stage.fall()
        middles, halves = np.split(self.model.geom_aabb[self._geoms, None], 2, 2)
        corners = (middles + halves * _CORNERS).reshape(-1, 8, 3)
        turns = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        places = corners @ turns.swapaxes(1, 2) + data.geom_xpos[self._geoms, None]
        points = places.reshape(-1, 3)
        shadows = points - fall * np.maximum(points[:, 2:], 0.0) / fall[2]
        return np.concatenate([points, shadows])
