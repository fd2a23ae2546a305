"""Off-line evaluation: one robot, alone, from birth to a number.

All clocks are integers of physics steps; nothing here looks at the wall's.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import cast

import mujoco
import numpy as np

from schema.errors import FitnessUndefined, SimulationDiverged, one_line
from schema.experiment.document import Fitness, Simulation, Space, body_space
from schema.experiment.environment import Environment
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings, fitness_function
from schema.mjcf.model import solo_model
from schema.robot.results import Evaluation, Track
from schema.robot.robot import Robot
from worker.fitness import FitnessFunction, path_velocity, straight_velocity
from worker.robot.controller import pack, widths
from worker.robot.noise import Noise, Source
from worker.robot.sensors import Senses, Servos
from worker.robot.solo import Solo


def evaluate(
    robot: Robot, settings: EvaluationSettings, identity: Identity = NO_IDENTITY
) -> Evaluation:
    """Return how a robot does: a pure function of the arguments.

    Args:
        robot: a robot that passes ``check_robot`` in the settings' body space.
        settings: the world, its clocks and what is maximised.
        identity: which evaluation it is; nothing but noise depends on it.

    Raises:
        SimulationDiverged: the physics did; reason and simulated time.
        FitnessUndefined: the fitness function raised or gave no finite number.
        ExperimentError: a sensor that the world has nothing for, a fitness
            function that does not exist.
        InvalidRobot: more neurons than the limits.
    """
    space, simulation = settings.space, settings.simulation
    world = settings.environment
    track = simulate(robot, space, simulation, world, identity=identity)
    value = judge(track, settings.fitness)
    clock = settings.simulation
    return Evaluation(
        value,
        path_velocity(track),
        straight_velocity(track),
        (clock.warmup_steps + clock.window_steps) * clock.timestep_s,
    )


def judge(track: Track, fitness: Fitness) -> float:
    """Return the fitness of a track.

    Args:
        track: (T, 3) positions; T >= 2.
        fitness: names the function and its weights.

    Raises:
        FitnessUndefined: it raised, or gave no finite number.
    """
    function = cast("FitnessFunction", fitness_function(fitness))
    try:
        value = float(function(track, fitness))
    except Exception as error:
        raise FitnessUndefined(
            f"{fitness.function} raised {type(error).__name__}: {error}"
        ) from error
    if not math.isfinite(value):
        raise FitnessUndefined(
            f"{fitness.function} must return a finite number, got {value}"
        )
    return value


def simulate(
    robot: Robot,
    space: Space,
    simulation: Simulation,
    environment: Environment,
    *,
    watch: Callable[[mujoco.MjData], None] | None = None,
    identity: Identity = NO_IDENTITY,
) -> Track:
    """Return where a robot goes, alone, standing at the origin at first.

    Brain, sensors and commands change every ``brain_steps`` from birth on; the
    position of the core's centre is taken every ``pose_steps`` of the window,
    its first and last moment included.

    Args:
        robot: a checked robot.
        space: part types and limits.
        simulation: the world's numbers and its clocks.
        environment: what it stands in.
        watch: is shown the state after each tick, before the steps that follow.
        identity: which evaluation it is; nothing but noise depends on it.

    Raises:
        SimulationDiverged: a number that is none, a warning of the engine, or that
            it gave up or cannot build the robot.
        ExperimentError: a sensor that the world has nothing for.
        InvalidRobot: more neurons than the limits.
    """
    silence_engine()
    try:
        model = solo_model(robot, body_space(space), simulation, environment)
    except ValueError as error:
        raise SimulationDiverged(f"cannot be built: {one_line(error)}") from None
    life = _Life(robot, space, simulation, model, identity=identity)
    try:
        return _live(life, model, simulation, watch)
    except mujoco.FatalError as error:
        # It cannot go on with this robot, say for want of room for all contacts.
        raise SimulationDiverged(
            f"physics diverged by {life.data.time:.3f} s: {one_line(error)}"
        ) from None


def _live(
    life: "_Life",
    model: mujoco.MjModel,
    simulation: Simulation,
    watch: Callable[[mujoco.MjData], None] | None,
) -> Track:
    """Let a robot live, and return where it goes."""
    start = simulation.warmup_steps
    end = start + simulation.window_steps
    positions: list[float] = []
    step, next_tick, next_sample = 0, 0, start
    while True:
        if step == next_sample:
            positions += life.core.tolist()
            next_sample += simulation.pose_steps
        if step == end:
            break
        if step == next_tick:
            life.tick(step)
            next_tick += simulation.brain_steps
            if watch is not None:
                watch(life.data)
        until = min(next_tick, next_sample)
        mujoco.mj_step(model, life.data, until - step)
        step = until
    _check_warnings(life.data, end * simulation.timestep_s)
    return Track(
        simulation.pose_steps * simulation.timestep_s,
        np.array(positions).reshape(-1, 3),
    )


class _Life:
    """One robot's closed loop: what it feels, thinks and does at a tick."""

    def __init__(
        self,
        robot: Robot,
        space: Space,
        simulation: Simulation,
        model: mujoco.MjModel,
        *,
        identity: Identity,
    ) -> None:
        types, width = body_space(space), widths(space)
        self.data = mujoco.MjData(model)
        self.core = self.data.qpos[:3].data
        self._velocities = self.data.qvel.data
        self._model = model
        self._timestep_s = simulation.timestep_s
        self._brain_steps = simulation.brain_steps
        self._tick_s = simulation.brain_steps * simulation.timestep_s
        self._senses = Senses(robot, types, model, width=width.inputs)
        self._servos = Servos(robot, types, model)
        ends = simulation.warmup_steps + simulation.window_steps
        self._controller = Solo(
            pack(robot.brain, width), width, self._tick_s, ends // self._brain_steps + 1
        )
        self._senses.show(self._controller.readings)
        source = Source(simulation, width, identity.origin)
        self._is_noisy = not source.is_silent
        self._noise = Noise(source, (identity.birth,), identity.trial)
        inputs = sum(neuron.layer == "input" for neuron in robot.brain.neurons)
        self._felt = self._controller.readings[:, :inputs]

    def tick(self, step: int) -> None:
        """Read, think and command; ``step`` counts from birth."""
        if step:
            # A sum is finite only if all its terms are; nothing plausible overflows
            # it, and one velocity that is no number breaks all of a robot's.
            if not math.isfinite(sum(self._velocities.tolist())):
                _raise_diverged(self.data, step * self._timestep_s)
            self._senses.read(self._model, self.data, self._tick_s)
        else:
            self._senses.start(self._model, self.data)
        tick = step // self._brain_steps
        if not self._is_noisy:
            self._servos.drive(self.data, self._controller.step(tick))
            return
        self._felt[:] = self._noise.blur(tick, self._felt)
        outputs = self._controller.step(tick)[np.newaxis]
        self._servos.drive(self.data, self._noise.shake(tick, outputs)[0])


def _check_warnings(data: mujoco.MjData, time_s: float) -> None:
    """Raise if the engine warned of anything, or the state is not of numbers."""
    if data.warning.number.any() or not math.isfinite(
        data.qvel.sum() + data.qpos.sum()
    ):
        _raise_diverged(data, time_s)


def _raise_diverged(data: mujoco.MjData, time_s: float) -> None:
    names = [
        mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
        for index in data.warning.number.nonzero()[0].tolist()
    ]
    reason = ", ".join(names) or "state not finite"
    raise SimulationDiverged(f"physics diverged by {time_s:.3f} s: {reason}")


@lru_cache(maxsize=1)
def silence_engine() -> None:
    """Keep the engine's warnings out of stderr and of a file where we stand.

    They are counted all the same, and whoever steps a model reads the counts.
    """
    mujoco.set_mju_user_warning(lambda _message: None)
