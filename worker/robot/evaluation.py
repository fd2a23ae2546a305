"""Off-line evaluation of one robot, alone in its environment.

All clocks are integers of physics steps; the wall clock is never read.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import mujoco
import numpy as np
import numpy.typing as npt

from schema.errors import SimulationDiverged, one_line
from schema.experiment.document import body_space
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.mjcf.model import solo_spec
from schema.robot.results import Evaluation, Track
from schema.robot.robot import Robot
from worker.fitness import fitness_of, path_velocity, straight_velocity
from worker.robot.brains import controls_of
from worker.robot.motors import Servos
from worker.robot.noise import Noise, NoiseSource
from worker.robot.sensors import Sensors

Watch = Callable[[mujoco.MjData], None]


def evaluate(
    robot: Robot, settings: EvaluationSettings, identity: Identity = NO_IDENTITY
) -> Evaluation:
    """Return the evaluation of a robot: a pure function of the arguments.

    Args:
        robot: a robot that passes ``check_robot`` in the settings' body space.
        settings: body space, simulation, environment and fitness.
        identity: of the evaluation; only noise depends on it.

    Raises:
        SimulationDiverged: the physics diverged; with reason and simulated time.
        FitnessUndefined: the fitness function raised or gave no finite number.
        ExperimentError: a sensor that has no stimulus in this environment, or an
            unknown fitness function.
        InvalidRobot: more neurons than the limits.
    """
    clock = settings.simulation
    track = simulate(robot, settings, identity=identity)
    return Evaluation(
        fitness_of(track, settings.fitness),
        path_velocity(track),
        straight_velocity(track),
        (clock.warmup_steps + clock.window_steps) * clock.timestep_s,
    )


def simulate(
    robot: Robot,
    settings: EvaluationSettings,
    *,
    watch: Watch | None = None,
    identity: Identity = NO_IDENTITY,
) -> Track:
    """Return the track of a robot that starts at the origin, alone.

    Sensors, controller and commands are updated every ``brain_steps`` from step 0
    on. The position of the core's centre is sampled every ``pose_steps`` of the
    window, both ends included.

    Args:
        robot: a checked robot.
        settings: body space, simulation and environment; fitness does not count.
        watch: called with the state after each tick, before the steps that follow.
        identity: of the evaluation; only noise depends on it.

    Raises:
        SimulationDiverged: the state is not finite, the engine warned or failed, or
            it cannot build the robot.
        ExperimentError: a sensor that has no stimulus in this environment.
        InvalidRobot: more neurons than the limits.
    """
    silence_engine()
    clock, space = settings.simulation, body_space(settings.space)
    try:
        model = solo_spec(robot, space, clock, settings.environment).compile()
    except ValueError as error:
        raise SimulationDiverged(f"cannot be built: {one_line(error)}") from None
    loop = _ControlLoop(robot, settings, model, identity)
    try:
        return loop.run(watch)
    except mujoco.FatalError as error:
        # The engine cannot continue, for example when contacts exceed its memory.
        raise SimulationDiverged(
            f"physics diverged by {loop.data.time:.3f} s: {one_line(error)}"
        ) from None


class _ControlLoop:
    """Closed loop of one robot: sensors, controller, motors.

    Attributes:
        data: the engine's state.
    """

    def __init__(
        self,
        robot: Robot,
        settings: EvaluationSettings,
        model: mujoco.MjModel,
        identity: Identity,
    ) -> None:
        types, simulation = body_space(settings.space), settings.simulation
        self._model, self.data = model, mujoco.MjData(model)
        self._velocities = self.data.qvel.data
        self._simulation = simulation
        self._tick_s = simulation.brain_steps * simulation.timestep_s
        controls = controls_of(settings.brain, settings.space, self._tick_s)
        width = controls.width
        self._sensors = Sensors(robot, types, model, self.data, width=width.inputs)
        self._servos = Servos(robot, types, model, self.data)
        steps = simulation.warmup_steps + simulation.window_steps
        ticks = steps // simulation.brain_steps + 1
        self._controller = controls.solo(robot.brain, ticks)
        self._sensors.write_to(self._controller.readings)
        self._noise: Noise | None = None
        if simulation.sensor_noise or simulation.actuator_noise:
            source = NoiseSource(simulation, width, identity.origin)
            self._noise = Noise(source, (identity.birth,), identity.trial)
        inputs = sum(neuron.layer == "input" for neuron in robot.brain.neurons)
        self._inputs = self._controller.readings[:, :inputs]

    def run(self, watch: Watch | None) -> Track:
        """Step warm-up and window, and return the track of the window."""
        model, data, simulation = self._model, self.data, self._simulation
        core = data.qpos[:3].data
        start = simulation.warmup_steps
        end = start + simulation.window_steps
        positions: list[float] = []
        step, next_tick, next_sample = 0, 0, start
        while True:
            if step == next_sample:
                positions += core.tolist()
                next_sample += simulation.pose_steps
            if step == end:
                break
            if step == next_tick:
                self._tick(step)
                next_tick += simulation.brain_steps
                if watch is not None:
                    watch(data)
            until = min(next_tick, next_sample)
            mujoco.mj_step(model, data, until - step)
            step = until
        if data.warning.number.any() or not math.isfinite(
            data.qvel.sum() + data.qpos.sum()
        ):
            _raise_diverged(data, end * simulation.timestep_s)
        return Track(
            simulation.pose_steps * simulation.timestep_s,
            np.array(positions).reshape(-1, 3),
        )

    def _tick(self, step: int) -> None:
        """Read sensors, update the controller and command the motors."""
        if step:
            # A sum is finite only if all its terms are. No plausible state overflows
            # it, and one velocity that is not a number spreads to all of a robot's.
            if not math.isfinite(sum(self._velocities.tolist())):
                _raise_diverged(self.data, step * self._simulation.timestep_s)
            self._sensors.read(self._tick_s)
        else:
            self._sensors.start()
        tick = step // self._simulation.brain_steps
        if self._noise is None:
            self._servos.drive(self._controller.step(tick))
            return
        self._inputs[:] = self._noise.perturb_readings(tick, self._inputs)
        outputs = self._controller.step(tick)[np.newaxis]
        self._servos.drive(self._noise.perturb_outputs(tick, outputs)[0])


def _raise_diverged(data: mujoco.MjData, time_s: float) -> None:
    reason = warning_names(data.warning.number) or "state not finite"
    raise SimulationDiverged(f"physics diverged by {time_s:.3f} s: {reason}")


def warning_names(counts: npt.NDArray[np.integer]) -> str:
    """Return the names of the engine's warnings whose counts are not 0."""
    return ", ".join(
        mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
        for index in counts.nonzero()[0].tolist()
    )


@lru_cache(maxsize=1)
def silence_engine() -> None:
    """Keep the engine's warnings out of stderr and of its log file.

    The engine still counts them in ``MjData.warning``.
    """
    mujoco.set_mju_user_warning(lambda _message: None)
