"""Pushes: horizontal impulses on a robot's core during an off-line evaluation."""

from math import cos, pi, sin
from typing import cast

import mujoco

from schema.experiment.document import Simulation
from schema.experiment.environment import Environment
from schema.experiment.identity import Identity
from schema.robot.trace import Floats
from worker.filters.random_streams import DrawPurpose, stream


class Pushes:
    """Pushes on one robot.

    A push is a constant force at the centre of mass of the core's segment, from one
    brain tick to the next. Its impulse is ``environment.push_impulse``. Its direction
    in the ground plane is uniform and depends only on the identity of the evaluation
    and on the number of the push. The first push comes after one interval.
    """

    def __init__(
        self,
        environment: Environment,
        simulation: Simulation,
        identity: Identity,
        model: mujoco.MjModel,
        data: mujoco.MjData,
    ) -> None:
        tick_s = simulation.tick_s
        self._every = max(1, round(environment.push_interval_s / tick_s))
        steps = simulation.evaluation_steps
        count = steps // simulation.brain_steps // self._every + 1
        rng = stream(
            DrawPurpose.PUSHES, identity.origin, identity.birth, identity.trial
        )
        angles = rng.uniform(0.0, 2.0 * pi, count).tolist()
        force = environment.push_impulse / tick_s
        self._forces = [(force * cos(each), force * sin(each)) for each in angles]
        row = data.xfrc_applied[model.body("root").id]
        self._applied = cast("memoryview[float]", row.data)

    def readings(self, _tick: int, values: Floats) -> Floats:
        """Return the readings, which pushes do not change."""
        return values

    def outputs(self, tick: int, values: Floats) -> Floats:
        """Set the force on the robot until the next tick; return the outputs."""
        number, since = divmod(tick, self._every)
        is_push = number > 0 and since == 0
        fx, fy = self._forces[number - 1] if is_push else (0.0, 0.0)
        self._applied[0], self._applied[1] = fx, fy
        return values
