"""Off-line evaluation of one robot, alone in its environment."""

from contextlib import suppress
from functools import lru_cache

import numpy as np
from msgspec.structs import replace

from schema.errors import FAILURES, RevolveError, SensorFailed, SimulationDiverged
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.robot.trace import Floats, Trace
from schema.wire.messages import Failure, Traced
from schema.wire.trace import pack_trace
from worker.measures import functions_of
from worker.robot.control_loop import ControlLoop, Watch
from worker.robot.disturbances import combined, disturbances


class EvaluationLoop:
    """Evaluation of one robot, one brain tick at a time.

    With the section ``robust`` it is several simulations, one after the other, of which
    ``loop`` is the present or last one.
    """

    def __init__(
        self,
        robot: Robot,
        settings: EvaluationSettings,
        identity: Identity = NO_IDENTITY,
        *,
        place: tuple[float, float] = (0.0, 0.0),
        watch: Watch | None = None,
    ) -> None:
        """Start the first simulation, as ``ControlLoop`` with its errors.

        The robot passes ``check_robot``; ``watch`` is that of ``simulate``.
        """
        self._robot, self._place, self._watch = robot, place, watch
        self._rules, self._evaluations = settings.robust, list[Evaluation]()
        self._draws = [(settings, identity)]
        if self._rules is not None:
            self._draws = [*disturbances(settings, self._rules, identity)]
        try:
            self.loop = self._start()
        except FAILURES as error:
            raise self._named(error) from error.__cause__

    @property
    def done(self) -> bool:
        """Whether all simulations are over."""
        return len(self._evaluations) == len(self._draws)

    def step(self, action: Floats | None = None) -> None:
        """Do a tick of the present simulation; after its last one start the next.

        It raises as ``ControlLoop``, its ``step`` and ``judge``.
        """
        try:
            self.loop.step(action)
            if not self.loop.done:
                return
            settings, _ = self._draws[len(self._evaluations)]
            self._evaluations.append(judge(self.loop.trace(), settings))
            if not self.done:
                self.loop = self._start()
        except FAILURES as error:
            raise self._named(error) from error.__cause__

    def fitness(self) -> float | None:
        """Return the fitness, or that of two or more samples so far; else None."""
        if self.done:
            return self.result().fitness
        trace, functions = self.loop.trace(), functions_of(self._draws[0][0])
        return functions.fitness.value(trace) if trace.duration_s > 0.0 else None

    def result(self) -> Evaluation:
        """Return the evaluation; all simulations are over."""
        assert self.done
        if self._rules is None:
            return self._evaluations[0]
        return combined(self._evaluations, self._rules)

    def _start(self) -> ControlLoop:
        settings, identity = self._draws[len(self._evaluations)]
        means: tuple[float, ...] = ()
        if settings.ablation is not None and settings.ablation.has_means:
            unchanged = replace(settings, ablation=None)
            means = mean_inputs(self._robot, unchanged, identity)
        loop = ControlLoop(self._robot, settings, identity, means, self._place)
        loop.watch = self._watch
        return loop

    def _named(self, error: RevolveError) -> RevolveError:
        """Return an error that names the simulation, if there are several."""
        if self._rules is None:
            return error
        number = f"draw {len(self._evaluations) + 1} of {len(self._draws)}"
        return type(error)(f"{number}: {error}")


def evaluate(
    robot: Robot,
    settings: EvaluationSettings,
    identity: Identity = NO_IDENTITY,
    *,
    watch: Watch | None = None,
) -> Evaluation:
    """Return the evaluation of a robot: a pure function of the arguments.

    It raises as ``EvaluationLoop`` and its ``step``.
    """
    evaluation = EvaluationLoop(robot, settings, identity, watch=watch)
    while not evaluation.done:
        evaluation.step()
    return evaluation.result()


def evaluate_traced(
    robot: Robot,
    settings: EvaluationSettings,
    identity: Identity,
    *,
    is_judged: bool = True,
) -> Traced:
    """Return the evaluation of a robot, or why it failed, and its trace.

    With the section ``robust`` the trace is that of a simulation without disturbances,
    which has no part in the fitness. There is none if that simulation fails. Unless
    ``is_judged``, only that simulation is done.

    It raises as ``evaluate``, but for failures.
    """
    outcome: Evaluation | Failure = Failure("")
    trace: Trace | None = None
    is_disturbed = is_judged and settings.robust is not None
    try:
        if is_disturbed:
            outcome = evaluate(robot, settings, identity)
        else:
            trace = simulate(robot, settings, identity=identity)
            outcome = judge(trace, settings) if is_judged else outcome
    except FAILURES as error:
        outcome = Failure(str(error))
    if is_disturbed:
        with suppress(SimulationDiverged, SensorFailed):
            trace = simulate(robot, settings, identity=identity)
    return Traced(outcome, None if trace is None else pack_trace(trace))


def judge(trace: Trace, settings: EvaluationSettings) -> Evaluation:
    """Return the evaluation of a trace of ``simulate``; raises ``FitnessUndefined``."""
    clock = settings.simulation
    simulated_s = clock.evaluation_steps * clock.timestep_s
    return functions_of(settings).evaluation(trace, simulated_s)


def simulate(
    robot: Robot,
    settings: EvaluationSettings,
    *,
    watch: Watch | None = None,
    identity: Identity = NO_IDENTITY,
) -> Trace:
    """Return the trace of a robot alone, as ``ControlLoop`` simulates it.

    ``watch`` is called with the state at each tick, after the commands.

    It raises as ``ControlLoop`` and its ``step`` do.
    """
    if settings.robust is not None:
        settings = replace(settings, robust=None)
    loop = EvaluationLoop(robot, settings, identity, watch=watch).loop
    while not loop.done:
        loop.step()
    return loop.trace()


@lru_cache(maxsize=4)
def mean_inputs(
    robot: Robot, settings: EvaluationSettings, identity: Identity = NO_IDENTITY
) -> tuple[float, ...]:
    """Return the mean of each input of a brain over all ticks of an evaluation, (I,).

    Inputs are what the brain receives: readings after calibration and noise.
    """
    loop = ControlLoop(robot, settings, identity)
    rows: list[list[float]] = []
    while not loop.done:
        rows.append(loop.observe()[0].tolist())
        loop.step()
    return tuple(np.mean(rows, axis=0).tolist())
