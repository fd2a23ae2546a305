"""Off-line evaluation of one robot, alone in its environment."""

from functools import lru_cache

import numpy as np
from msgspec.structs import replace

from schema.errors import FitnessUndefined, SensorFailed, SimulationDiverged
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.robot.trace import Trace
from worker.measures.functions import evaluation_of
from worker.robot.control_loop import ControlLoop, Watch
from worker.robot.disturbances import combined, disturbances


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
    evaluations: list[Evaluation] = []
    for drawn, drawn_identity in disturbances(settings, settings.robust, identity):
        try:
            trace = simulate(robot, drawn, watch=watch, identity=drawn_identity)
            evaluations.append(judge(trace, drawn))
        except (SimulationDiverged, SensorFailed, FitnessUndefined) as error:
            number = f"draw {len(evaluations) + 1} of {settings.robust.draws}"
            raise type(error)(f"{number}: {error}") from None
    return combined(evaluations, settings.robust)


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
    clock = settings.simulation
    return evaluation_of(trace, settings, clock.evaluation_steps * clock.timestep_s)


def simulate(
    robot: Robot,
    settings: EvaluationSettings,
    *,
    watch: Watch | None = None,
    identity: Identity = NO_IDENTITY,
) -> Trace:
    """Return the trace of a robot alone, as ``ControlLoop`` simulates it.

    Args:
        robot: a checked robot.
        settings: as of ``ControlLoop``.
        watch: called with the state at each tick, after the commands.
        identity: of the evaluation; noise and pushes depend on it.

    Raises:
        RevolveError: as of ``ControlLoop`` and its ``step``.
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

    Args:
        robot: a checked robot.
        settings: as for ``simulate``.
        identity: of the evaluation.

    Raises:
        RevolveError: as for ``simulate``.
    """
    loop = ControlLoop(robot, settings, identity)
    rows: list[list[float]] = []
    while not loop.done:
        rows.append(loop.observe()[0].tolist())
        loop.step()
    return tuple(np.mean(rows, axis=0).tolist())
