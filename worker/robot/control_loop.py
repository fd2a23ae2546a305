"""Control loop of one robot, alone in its environment, one brain tick at a time.

All clocks are integers of physics steps; the wall clock is never read.
"""

import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from msgspec.structs import replace

from schema.errors import SimulationDiverged, one_line
from schema.experiment.document import body_space
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.mjcf.model import solo_spec
from schema.robot.brain import Brain
from schema.robot.robot import Robot
from schema.robot.trace import Floats, Trace
from worker.filters.channels import NEUTRAL
from worker.filters.filters import (
    filtered_outputs,
    filtered_readings,
    filters_of,
)
from worker.measures import functions_of
from worker.robot.banks import GuardedBank, broken_rows
from worker.robot.brains import SoloNetwork, controls_of, solo_brain
from worker.robot.own_sensors import Surroundings
from worker.robot.placed import silence_engine, warning_names
from worker.robot.recording import Channels, EngineView, probed_channels, step_with

Watch = Callable[[mujoco.MjData], None]


class ControlLoop:
    """Simulation of one robot, alone: sensors, brain, motors.

    Sensors, brain and commands are updated every ``brain_steps`` from step 0 on. The
    position of the core's centre is sampled every ``pose_steps`` of the window, both
    ends included, and so are the channels that fitness and measures declare.

    Attributes:
        model, data: of the engine.
        done: whether the window is over.
        now: physics steps since the start.
        watch: called with the state at each tick, after the commands; may be None.
    """

    def __init__(
        self,
        robot: Robot,
        settings: EvaluationSettings,
        identity: Identity = NO_IDENTITY,
        means: Sequence[float] = (),
        place: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Build the model and start at a place in the ground plane [m].

        The robot may have more neurons than ``[space]`` allows in a search; ``means``
        are values for the inputs that ``settings.ablation`` holds at their mean.

        Raises:
            SimulationDiverged: the engine cannot build the robot.
            ExperimentError: a sensor that has no stimulus in this environment, or an
                unknown fitness function or measure.
            InvalidRobot: neurons of other types, or an ablation of another robot.
        """
        silence_engine()
        self._settings = settings = _with_room(settings, robot.brain)
        self._robot = robot
        self._clock, self._light = settings.simulation, settings.environment.light
        self._end = self._clock.evaluation_steps
        self._tick_steps = self._clock.brain_steps
        self.watch: Watch | None = None
        space, ground = body_space(settings.space), settings.environment
        try:
            spec = solo_spec(robot, space, self._clock, ground, place=place)
            self.model: mujoco.MjModel = spec.compile()
        except ValueError as error:
            raise SimulationDiverged(f"cannot be built: {one_line(error)}") from None
        self.data = data = mujoco.MjData(self.model)
        self._core, self._velocities = data.qpos[:3].data, data.qvel.data
        self._view = EngineView(robot, self.model, data, settings)
        probe = self._view.probe if "energy" in probed_channels(settings) else None
        self._working = [] if probe is None else [probe]
        self._start_control()
        state = self.model, data
        self._filters = filters_of(robot, settings, identity, state, means)
        self._channels = None
        if functions_of(settings).channels:
            self._channels = Channels(self._view, settings)
        self._positions: list[float] = []
        self._rows: list[Floats] = []
        self._undisturbed: Floats = self._inputs
        self.now, self._next_sample = 0, self._clock.warmup_steps
        self._tick, self._is_unread, self.done = 0, True, False

    def _start_control(self) -> None:
        """Start the brain."""
        settings, brain = self._settings, self._robot.brain
        self._sensors = self._view.sensors
        ticks = self._end // self._tick_steps + 1
        self._brain = solo_brain(controls_of(settings), brain, ticks)
        if isinstance(self._brain, SoloNetwork):
            self._sensors.write_to(self._brain.readings)
        self._is_guarded = isinstance(self._brain, GuardedBank)
        self._readings = self._sensors.readings
        self._inputs = self._readings[:, : brain.count("input")]
        self._outputs: Floats = np.zeros((1, settings.space.max_outputs))

    def observe(self) -> Floats:
        """Return what the brain receives at the present tick, (1, I).

        At the end of a window that is no tick, that of the last tick.

        Raises:
            SimulationDiverged: the state is not finite, or the engine failed.
            SensorFailed: a sensor of a plug-in raised or gave wrong values.
        """
        if self._is_unread:
            self._is_unread = False
            try:
                self._read_sensors()
            except mujoco.FatalError as error:
                raise self._failure(error) from None
            if self._filters:
                self._undisturbed = self._inputs.copy()
                self._inputs[:] = filtered_readings(
                    self._filters, self._tick, self._inputs
                )
        return self._inputs

    def step(self, action: Floats | None = None) -> None:
        """Command the motors, and step the physics to the next tick or the end.

        An action (M,) is -1 to 1 over the ranges of the motors; None is the robot's own
        brain, which does not tick otherwise. Filters act on both.

        Raises:
            SimulationDiverged: the state is not finite, the engine warned or failed, or
                the brain of a plug-in failed.
            SensorFailed: as of ``observe``.
        """
        self.observe()
        if action is None:
            outputs = self._think()
        else:
            outputs = np.full((1, self._settings.space.max_outputs), NEUTRAL)
            outputs[0, : len(action)] += 0.5 * action
        self._outputs = outputs
        if self._filters:
            outputs = filtered_outputs(self._filters, self._tick, outputs)
        self._view.servos.drive(outputs[0])
        if self.watch is not None:
            self.watch(self.data)
        self._tick += 1
        next_tick = self._tick * self._tick_steps
        try:
            self._step_to(min(next_tick, self._end))
        except mujoco.FatalError as error:
            raise self._failure(error) from None
        self._is_unread = self.now == next_tick
        if self.now == self._end:
            self._finish()

    def trace(self) -> Trace:
        """Return the samples of the window so far."""
        interval_s = self._clock.pose_steps * self._clock.timestep_s
        positions = np.array(self._positions).reshape(-1, 3)
        if self._channels is None:
            return Trace(interval_s, positions, self._view.constants(self._settings))
        return self._channels.trace(self._robot, interval_s, positions, self._rows)

    def _think(self) -> Floats:
        outputs = self._brain.step(self._readings, float(self._tick))
        if not self._is_guarded:
            return outputs
        for reason in broken_rows(self._brain, outputs).values():
            what, _, why = reason.partition(": ")
            time_s = self.now * self._clock.timestep_s
            raise SimulationDiverged(f"{what} by {time_s:.3f} s: {why}")
        return outputs

    def _step_to(self, until: int) -> None:
        """Step the physics with constant commands; sample on the way."""
        model, data, working = self.model, self.data, self._working
        while self.now < until:
            if self.now == self._next_sample:
                # After the tick, as in an arena: a sample has the readings of its step.
                self._sample()
            stop = min(until, self._next_sample)
            step_with(working, model, data, stop - self.now)
            self.now = stop

    def _sample(self) -> None:
        self._positions += self._core.tolist()
        self._next_sample += self._clock.pose_steps
        if self._channels is not None:
            self._rows.append(
                self._view.row(self._channels, 0, self._outputs[0], self._undisturbed)
            )

    def _finish(self) -> None:
        """Add the last sample; its readings are those of the last tick, as in an arena.

        That may be the end, where the brain does not tick.
        """
        self.done = True
        if self._channels is not None:
            self.observe()
        self._sample()
        data = self.data
        if data.warning.number.any() or not math.isfinite(
            data.qvel.sum() + data.qpos.sum()
        ):
            self._raise_diverged()

    def _read_sensors(self) -> None:
        if self.now:
            # A sum is finite only if all its terms are. No plausible state overflows
            # it, and one velocity that is not a number spreads to all of a robot's.
            if not math.isfinite(sum(self._velocities.tolist())):
                self._raise_diverged()
            self._sensors.read(self._clock.tick_s)
        else:
            self._sensors.start()
        if self._sensors.looks:
            # Frames are those of the state before the last step.
            mujoco.mj_kinematics(self.model, self.data)
            age_s, touched = self.now * self._clock.timestep_s, self._sensors.touching()
            self._sensors.look(Surroundings(age_s, touched, light=self._light))

    def _failure(self, error: mujoco.FatalError) -> SimulationDiverged:
        """Return why the engine cannot continue, such as contacts beyond its memory."""
        return SimulationDiverged(
            f"physics diverged by {self.data.time:.3f} s: {one_line(error)}"
        )

    def _raise_diverged(self) -> None:
        time_s = self.now * self._clock.timestep_s
        reason = warning_names(self.data.warning.number) or "state not finite"
        raise SimulationDiverged(f"physics diverged by {time_s:.3f} s: {reason}")


def _with_room(settings: EvaluationSettings, brain: Brain) -> EvaluationSettings:
    """Return settings that hold a brain, also one that their search does not allow."""
    counts = brain.count("input"), brain.count("output"), brain.count("hidden")
    needed = zip(("max_inputs", "max_outputs", "max_hidden"), counts, strict=True)
    more = {key: n for key, n in needed if n > getattr(settings.space, key)}
    if not more:
        return settings
    return replace(settings, space=replace(settings.space, **more))
