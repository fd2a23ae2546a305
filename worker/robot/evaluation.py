"""Off-line evaluation of one robot, alone in its environment."""

from contextlib import suppress
from functools import lru_cache

import numpy as np
from msgspec.structs import replace

from schema.errors import FitnessUndefined, SensorFailed, SimulationDiverged
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.robot.trace import Trace
from schema.wire.messages import Failure, Traced
from schema.wire.trace import pack_trace
from worker.measures import functions_of
from worker.robot.control_loop import ControlLoop, Watch
from worker.robot.disturbances import evaluate_disturbed


def evaluate(
    robot: Robot,
    settings: EvaluationSettings,
    identity: Identity = NO_IDENTITY,
    *,
    watch: Watch | None = None,
) -> Evaluation:
    """Return the evaluation of a robot: a pure function of the arguments.

    With the section ``robust`` it combines several simulations.

    The robot passes ``check_robot``; ``watch`` is that of ``simulate``.

    Raises:
        FitnessUndefined: the fitness function or a measure raised or gave no finite
            number.
        RevolveError: as of ``simulate``.
    """

    def once(drawn: EvaluationSettings, drawn_identity: Identity) -> Evaluation:
        trace = simulate(robot, drawn, watch=watch, identity=drawn_identity)
        return judge(trace, drawn)

    if settings.robust is None:
        return once(settings, identity)
    return evaluate_disturbed(once, settings, settings.robust, identity)


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
    except (SimulationDiverged, SensorFailed, FitnessUndefined) as error:
        outcome = Failure(str(error))
    if is_disturbed:
        with suppress(SimulationDiverged, SensorFailed):
            trace = simulate(robot, settings, identity=identity)
    return Traced(outcome, None if trace is None else pack_trace(trace))


def judge(trace: Trace, settings: EvaluationSettings) -> Evaluation:
    """Return the evaluation of a trace of ``simulate``; raises as ``evaluate``."""
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
    means: tuple[float, ...] = ()
    if settings.ablation is not None and settings.ablation.has_means:
        means = mean_inputs(robot, replace(settings, ablation=None), identity)
    loop = ControlLoop(robot, settings, identity, means)
    loop.watch = watch
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
