"""Off-line evaluation of one robot, alone in its environment.

All clocks are integers of physics steps; the wall clock is never read.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import mujoco
import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from schema.errors import (
    FitnessUndefined,
    SensorFailed,
    SimulationDiverged,
    one_line,
)
from schema.experiment.brains import with_room
from schema.experiment.document import body_space
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.mjcf.model import solo_spec
from schema.robot.results import Evaluation, Floats
from schema.robot.robot import Robot
from schema.robot.trace import Trace
from worker.fitness import path_velocity, straight_velocity
from worker.measures.functions import functions_of
from worker.robot.ablation import Ablated
from worker.robot.brains import controls_of
from worker.robot.calibration import Calibrated
from worker.robot.devices import Sensors, Servos
from worker.robot.disturbances import combined, disturbances
from worker.robot.light import read_light
from worker.robot.noise import Noise, NoiseSource
from worker.robot.own_sensors import Surroundings
from worker.robot.pushes import Pushes
from worker.robot.recording import Channels, Recorder
from worker.robot.solo_brains import solo_brain

Watch = Callable[[mujoco.MjData], None]


def evaluate(
    robot: Robot,
    settings: EvaluationSettings,
    identity: Identity = NO_IDENTITY,
    *,
    watch: Watch | None = None,
) -> Evaluation:
    """Return the evaluation of a robot: a pure function of the arguments.

    With the section ``robust`` it combines several simulations.

    Args:
        robot: a robot that passes ``check_robot`` in the settings' body space.
        settings: body space, simulation, environment, fitness and measures.
        identity: of the evaluation; noise, pushes and disturbances depend on it.
        watch: as for ``simulate``, of each simulation.

    Raises:
        SimulationDiverged: the physics diverged; with reason and simulated time.
        SensorFailed: a sensor of a plug-in raised or gave wrong values.
        FitnessUndefined: the fitness function or a measure raised or gave no finite
            number.
        ExperimentError: a sensor that has no stimulus in this environment, or an
            unknown fitness function or measure.
        InvalidRobot: neurons of other types than the experiment's.
    """
    if settings.robust is None:
        return judge(
            simulate(robot, settings, watch=watch, identity=identity), settings
        )
    found: list[Evaluation] = []
    for drawn, own in disturbances(settings, settings.robust, identity):
        try:
            trace = simulate(robot, drawn, watch=watch, identity=own)
            found.append(judge(trace, drawn))
        except (SimulationDiverged, SensorFailed, FitnessUndefined) as error:
            number = f"draw {len(found) + 1} of {settings.robust.draws}"
            raise type(error)(f"{number}: {error}") from None
    return combined(found, settings.robust)


def judge(trace: Trace, settings: EvaluationSettings) -> Evaluation:
    """Return the evaluation of a trace.

    Args:
        trace: that ``simulate`` returned for these settings.
        settings: simulation, fitness and measures.

    Raises:
        FitnessUndefined: the fitness function or a measure raised or gave no finite
            number.
        ExperimentError: an unknown fitness function or measure.
    """
    clock, functions = settings.simulation, functions_of(settings)
    return Evaluation(
        functions.fitness.value(trace),
        path_velocity(trace),
        straight_velocity(trace),
        clock.evaluation_steps * clock.timestep_s,
        tuple(each.value(trace) for each in functions.measures),
    )


def simulate(
    robot: Robot,
    settings: EvaluationSettings,
    *,
    watch: Watch | None = None,
    identity: Identity = NO_IDENTITY,
) -> Trace:
    """Return the trace of a robot that starts at the origin, alone.

    Sensors, controller and commands are updated every ``brain_steps`` from step 0
    on. The position of the core's centre is sampled every ``pose_steps`` of the
    window, both ends included, and so are the channels that fitness and measures
    declare. The robot may have more neurons than ``[space]`` allows in a search.

    Args:
        robot: a checked robot.
        settings: body space, simulation and environment; of fitness and measures only
            the channels that they declare.
        watch: called with the state after each tick, before the steps that follow.
        identity: of the evaluation; noise and pushes depend on it.

    Raises:
        SimulationDiverged: the state is not finite, the engine warned or failed, or
            it cannot build the robot.
        SensorFailed: a sensor of a plug-in raised or gave wrong values.
        ExperimentError: a sensor that has no stimulus in this environment, or an
            unknown fitness function or measure.
        InvalidRobot: neurons of other types, or an ablation of another robot.
    """
    means: tuple[float, ...] = ()
    if settings.ablation is not None and settings.ablation.has_means:
        means = mean_inputs(robot, replace(settings, ablation=None), identity)
    return _run(_loop(robot, settings, identity, means), watch)


@lru_cache(maxsize=4)
def mean_inputs(
    robot: Robot, settings: EvaluationSettings, identity: Identity = NO_IDENTITY
) -> tuple[float, ...]:
    """Return the mean of each input of a brain over all ticks of an evaluation, (I,).

    Inputs are what the brain receives: readings after calibration and noise.

    Args:
        robot: a checked robot.
        settings: as for ``simulate``.
        identity: of the evaluation.

    Raises:
        RevolveError: as for ``simulate``.
    """
    loop = _loop(robot, settings, identity)
    rows: list[list[float]] = []
    _run(loop, lambda _data: rows.append(loop.inputs[0].tolist()))
    return tuple(np.mean(rows, axis=0).tolist())


def _loop(
    robot: Robot,
    settings: EvaluationSettings,
    identity: Identity,
    means: tuple[float, ...] = (),
) -> "_ControlLoop":
    """Return the control loop of a robot; ``means`` are those of ``mean_inputs``."""
    silence_engine()
    settings = with_room(settings, robot.brain)
    clock, space = settings.simulation, body_space(settings.space)
    try:
        model = solo_spec(robot, space, clock, settings.environment).compile()
    except ValueError as error:
        raise SimulationDiverged(f"cannot be built: {one_line(error)}") from None
    loop = _ControlLoop(robot, settings, model, identity)
    if settings.ablation is not None:
        loop.ablated = Ablated(settings.ablation, robot, means)
    return loop


def _run(loop: "_ControlLoop", watch: Watch | None) -> Trace:
    """Return the trace of a loop that has not run.

    Raises:
        SimulationDiverged: also if the engine cannot continue, for example when
            contacts exceed its memory.
    """
    try:
        return loop.run(watch)
    except mujoco.FatalError as error:
        raise SimulationDiverged(
            f"physics diverged by {loop.data.time:.3f} s: {one_line(error)}"
        ) from None


class _ControlLoop:
    """Closed loop of one robot: sensors, controller, motors.

    Attributes:
        data: the engine's state.
        inputs: (1, I) what the brain received at the last tick; unused inputs left out.
        ablated: held inputs and dead motors; None if all work.
    """

    def __init__(
        self,
        robot: Robot,
        settings: EvaluationSettings,
        model: mujoco.MjModel,
        identity: Identity,
    ) -> None:
        types, simulation = body_space(settings.space), settings.simulation
        self._robot = robot
        self._model, self.data = model, mujoco.MjData(model)
        self._velocities = self.data.qvel.data
        self._simulation = simulation
        self._tick_s = simulation.tick_s
        controls = controls_of(settings)
        width = controls.width
        self._light = settings.environment.light
        self._sensors = Sensors(
            robot,
            types,
            model,
            self.data,
            width=width.inputs,
            has_light=self._light is not None,
            counts_gap=settings.environment.counts_gap,
        )
        self._servos = Servos(robot, types, model, self.data)
        steps = simulation.evaluation_steps
        ticks = steps // simulation.brain_steps + 1
        self._controller = solo_brain(controls, robot.brain, ticks)
        self._sensors.write_to(self._controller.readings)
        self._calibrated: Calibrated | None = None
        further: tuple[Floats, Floats] | None = None
        if settings.calibration:
            self._calibrated = Calibrated(
                robot, types, settings.calibration, tick_s=self._tick_s, width=width
            )
            further = self._calibrated.noise
        self.ablated: Ablated | None = None
        self._noise: Noise | None = None
        if simulation.sensor_noise or simulation.actuator_noise or further:
            source = NoiseSource(simulation, width, identity.origin, further)
            self._noise = Noise(source, (identity.birth,), identity.trial)
        self._pushes: Pushes | None = None
        if settings.environment.push_impulse:
            environment = settings.environment
            self._pushes = Pushes(environment, simulation, identity, model, self.data)
        self.inputs = self._controller.readings[:, : robot.brain.count("input")]
        self._channels = Channels(robot, model, settings)
        self._recorder: Recorder | None = None
        if self._channels.names:
            self._recorder = Recorder(self._channels, robot, model, self.data)
            self._recorder.readings = self.inputs

    def run(self, watch: Watch | None) -> Trace:
        """Step warm-up and window, and return the trace of the window."""
        model, data, simulation = self._model, self.data, self._simulation
        core = data.qpos[:3].data
        start = simulation.warmup_steps
        end = start + simulation.window_steps
        positions: list[float] = []
        recorder = self._recorder
        step, next_tick, next_sample = 0, 0, start
        while True:
            is_sample = step == next_sample
            if is_sample:
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
            if recorder is None:
                mujoco.mj_step(model, data, until - step)
            else:
                # After the tick, as in an arena: a sample has the readings of its step.
                if is_sample:
                    recorder.sample()
                recorder.step(until - step)
            step = until
        if recorder is not None:
            self._sample_end(recorder, end, is_tick=end == next_tick)
        if data.warning.number.any() or not math.isfinite(
            data.qvel.sum() + data.qpos.sum()
        ):
            _raise_diverged(data, end * simulation.timestep_s)
        return self._channels.trace(
            self._robot,
            simulation.pose_steps * simulation.timestep_s,
            np.array(positions).reshape(-1, 3),
            recorder.rows if recorder is not None else (),
        )

    def _sample_end(self, recorder: Recorder, end: int, *, is_tick: bool) -> None:
        """Add the last sample, with readings that the controller does not see.

        Between two ticks, it has the readings of the last one, as in an arena.
        """
        if is_tick:
            self._sensors.read(self._tick_s)
            self._read_light()
            self._read_own(end)
            recorder.readings = self._sensors.readings
        recorder.sample()

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
        self._read_light()
        self._read_own(step)
        tick = step // self._simulation.brain_steps
        if self._pushes is not None:
            self._pushes.apply(tick)
        if self._noise is None and self._calibrated is None and self.ablated is None:
            self._servos.drive(self._controller.step(tick))
            return
        if self._recorder is not None:
            self._recorder.readings = self.inputs.copy()
        self._servos.drive(self._disturbed(tick))

    def _disturbed(self, tick: int) -> Floats:
        """Update the controller with disturbed readings; return disturbed outputs."""
        noise, calibrated, ablated = self._noise, self._calibrated, self.ablated
        if calibrated is not None:
            self.inputs[:] = calibrated.readings(self.inputs)
        if noise is not None:
            self.inputs[:] = noise.perturb_readings(tick, self.inputs)
        if ablated is not None:
            ablated.hold(self.inputs)
        outputs = self._controller.step(tick)
        if calibrated is not None:
            outputs = calibrated.outputs(outputs)
        if noise is not None:
            outputs = noise.perturb_outputs(tick, outputs[np.newaxis])[0]
        return outputs if ablated is None else ablated.outputs(outputs)

    def _read_light(self) -> None:
        if self._light is not None:
            mujoco.mj_kinematics(self._model, self.data)
            world = self._model, self.data
            read_light(self._light, self._sensors, world, (world,))

    def _read_own(self, step: int) -> None:
        if self._sensors.own is not None:
            # Frames are those of the state before the last step.
            mujoco.mj_kinematics(self._model, self.data)
            age_s = step * self._simulation.timestep_s
            around = Surroundings(age_s, self._sensors.touching(), light=self._light)
            self._sensors.own.read(self._sensors.readings[0], around)


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
