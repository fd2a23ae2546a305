"""Robots of an arena: engine view, network, sliding window, window fitness."""

from collections import deque

import numpy as np

from schema.errors import FitnessUndefined
from schema.experiment.document import Simulation
from schema.experiment.settings import ArenaSettings
from schema.parts import Vector
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.robot.trace import Floats, Trace
from schema.wire.arena import Casualty, Judgement
from schema.wire.protobuf import encode_robot
from worker.clusters.models import Body
from worker.measures import functions_of
from worker.robot.brains import Controls
from worker.robot.recording import Channels

LEAST_SHARE = 0.25
"""Share of the window that a robot must have lived to have a fitness."""
_NO_FITNESS = Evaluation(0.0, 0.0, 0.0, 0.0)


class FitnessWindow:
    """The latest positions of one robot: the window of its fitness.

    The first sample is taken after the warm-up, so that neither the fall nor the
    position in the air counts (traps B2, B19 of the original). From then on the
    window holds the last ``window_steps``, both ends included, or those since it was
    restarted.

    Attributes:
        born: step of birth.
        positions: of the core's centre, oldest first, world frame [m].
        rows: of the channels of these samples; none if no channel is recorded.
    """

    def __init__(self, simulation: Simulation, born: int) -> None:
        self.born = born
        self._clock = simulation
        self._intervals = simulation.window_steps // simulation.pose_steps
        self.positions: deque[Vector] = deque(maxlen=self._intervals + 1)
        self.rows: deque[Floats] = deque(maxlen=self._intervals + 1)

    def add(self, step: int, position: Vector, row: Floats | None = None) -> None:
        """Add a sample, one every ``pose_steps`` of the arena."""
        if step - self.born >= self._clock.warmup_steps:
            self.positions.append(position)
            if row is not None:
                self.rows.append(row)

    def restart(self) -> None:
        """Forget all samples but the last one."""
        for samples in (self.positions, self.rows):
            for _ in range(len(samples) - 1):
                samples.popleft()

    @property
    def is_mature(self) -> bool:
        """Whether it covers a whole window after the warm-up."""
        return len(self.positions) > self._intervals

    @property
    def has_fitness(self) -> bool:
        """Whether it covers enough of a window for a fitness."""
        return len(self.positions) - 1 >= max(1, LEAST_SHARE * self._intervals)

    def trace(self, channels: Channels, robot: Robot) -> Trace:
        """Return the trace of the samples, at least two."""
        interval_s = self._clock.pose_steps * self._clock.timestep_s
        return channels.trace(robot, interval_s, np.array(self.positions), self.rows)


class ArenaRobot:
    """A living robot of an arena.

    Attributes:
        robot: its parts and its present brain.
        view: its present slice of the engine's state.
        place: of the core's centre at the last sample, world frame [m].
        encoded: bytes of ``robot``, for snapshots.
        packed: its brain in the form of its brain type.
        states: (K,) of its brain after the last tick; a row of the batch.
        brain_start: step from which the age of its brain counts.
        outputs: (O,) of its brain at the last tick, unclipped; (0,) if no channel
            records them.
        work_j: of its motors since the last report [J], if it is measured.
    """

    def __init__(
        self,
        birth: BirthId,
        body: Body,
        controls: Controls,
        window: FitnessWindow,
        place: Vector,
    ) -> None:
        """Initialise in its own cluster, with a brain that starts at its birth."""
        self.birth, self.body, self.view = birth, body, body.solo.views[0]
        self.window, self.place = window, place
        self.work_j = 0.0
        has_outputs = "outputs" in body.channels.names
        self.outputs = np.zeros(has_outputs * body.robot.brain.count("output"))
        self.set_brain(body.robot.brain, controls, window.born)

    def set_brain(self, brain: Brain, controls: Controls, start: int) -> None:
        """Replace the brain; all its states are 0.

        Until ``start``, the step of its first tick, commands are held; its age counts
        from then on.

        Raises:
            SimulationDiverged: the code of a user does not take the brain.
        """
        self.packed = controls.pack(brain)
        self.robot = Robot(self.body.robot.parts, brain)
        self.encoded = encode_robot(self.robot)
        self.states = controls.rest()
        self.brain_start = start

    def judgement(self, step: int, settings: ArenaSettings) -> Judgement | Casualty:
        """Return its window fitness, or a casualty if it or a measure is undefined.

        Velocities and fitness are 0, and there are no measures, until the window is
        long enough for a fitness.
        """
        age_s = (step - self.window.born) * settings.simulation.timestep_s
        x, y, z = self.view.qpos[:3].tolist()
        place, is_mature = (x, y, z), self.window.is_mature
        evaluation = _NO_FITNESS
        if self.window.has_fitness:
            trace = self.window.trace(self.body.channels, self.robot)
            try:
                evaluation = functions_of(settings).evaluation(trace, age_s)
            except FitnessUndefined as error:
                reason = f"fitness undefined: {error}"
                return Casualty(self.birth, step, reason, place)
        return Judgement(
            self.birth,
            age_s,
            evaluation.path_velocity,
            evaluation.straight_velocity,
            evaluation.fitness,
            is_mature=is_mature,
            place=place,
            measures=evaluation.measures,
        )
