"""Simulation and evaluation of single robots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from msgspec.structs import replace

from revolve.arguments import whole_number
from revolve.children import SIMULATOR
from revolve.experiment import Experiment, document_of
from revolve.robot import DEFAULT, Robot, task_of
from schema.errors import NO_MESSAGE, ExperimentError, SimulationDiverged, shown
from schema.experiment.document import island_experiment
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.limits import LONGEST_REASON, MOST_TRIAL, printable
from schema.robot.results import Evaluation
from schema.robot.robot import Robot as PlainRobot
from schema.robot.trace import Trace, check_channels
from schema.wire.messages import Failure, Traced
from schema.wire.trace import unpack_trace


@dataclass(frozen=True, slots=True)
class Result:
    """Result of an evaluation, or the reason why there is none.

    Attributes:
        fitness: higher is better, finite; None if the evaluation failed.
        path_velocity: path length over time in the ground plane [m/s].
        straight_velocity: net distance over time in the ground plane [m/s].
        simulated_s: simulated time [s].
        measures: named numbers of the experiment.
        failure: why there is no fitness; empty if there is one.
        trace: recording of the robot; None if the simulation failed, or from a fleet
            that was not asked for it. With ``[robust]`` it is that of a simulation
            without disturbances, which did not give the fitness.
    """

    fitness: float | None = None
    path_velocity: float | None = None
    straight_velocity: float | None = None
    simulated_s: float | None = None
    measures: Mapping[str, float] = field(default_factory=dict)
    failure: str = ""
    trace: Trace | None = field(default=None, compare=False, repr=False)


def evaluate(
    robot: Robot | PlainRobot,
    experiment: Experiment | str | Path | None = None,
    *,
    trial: int = 0,
    record: Sequence[str] = (),
) -> Result:
    """Return the evaluation of a robot: a function of the arguments alone.

    It runs in a process of its own, which is started with the first call and used
    again. The result equals that of ``revolve robot simulate`` to the last bit.
    With ``simulation.evaluation_s`` it takes the shortest time, that of warm-up and
    window: only runs draw other ones.

    Args:
        robot: to evaluate.
        experiment: whose simulation and fitness apply, those of island 0; None: the
            robot's own, else ``scenario1``.
        trial: number of the evaluation, 0 to 1,000,000: each has noise, pushes and
            disturbances of its own. Without any, all trials are equal.
        record: names of channels that the trace has beside those that the experiment's
            functions declare, such as ``"joint_angle"``; see ``Trace``. They change no
            result.

    Returns:
        The result. Diverged physics, an undefined fitness and a crash are results with
        a failure.

    Raises:
        InvalidRobot: the robot is not well formed for this experiment.
        ExperimentError: an invalid experiment or plug-in, or a sensor that has no
            stimulus in its environment; no such channel.
        RevolveError: another trial.
    """
    return _simulated(robot, experiment, trial, record, is_judged=True)


def simulate(
    robot: Robot | PlainRobot,
    experiment: Experiment | str | Path | None = None,
    *,
    trial: int = 0,
    record: Sequence[str] = (),
) -> Trace:
    """Return the recording of a robot that starts at the origin, alone.

    Args:
        robot: to simulate.
        experiment: as for ``evaluate``; its fitness is not computed.
        trial: as for ``evaluate``.
        record: as for ``evaluate``.

    Raises:
        SimulationDiverged: the physics diverged, a sensor of a plug-in failed, or the
            process crashed.
        InvalidRobot: as for ``evaluate``.
        ExperimentError: as for ``evaluate``.
        RevolveError: as for ``evaluate``.
    """
    result = _simulated(robot, experiment, trial, record, is_judged=False)
    if result.trace is None:
        raise SimulationDiverged(result.failure)
    return result.trace


def _simulated(
    robot: Robot | PlainRobot,
    experiment: Experiment | str | Path | None,
    trial: int,
    record: Sequence[str],
    *,
    is_judged: bool,
) -> Result:
    settings = settings_for(robot, experiment, record)
    task = task_of(robot, settings, outside_of_runs(trial), is_judged=is_judged)
    outcome = SIMULATOR.do(task)
    traced = outcome.traced or Traced(Failure(outcome.failure), None)
    return result_of(traced, settings, task.robot)


def settings_for(
    robot: Robot | PlainRobot | None,
    experiment: Experiment | str | Path | None,
    record: Sequence[str] = (),
) -> EvaluationSettings:
    """Return the settings of an evaluation that records some channels.

    Raises:
        ExperimentError: no such experiment or file, or an invalid document; channels
            that are not a list of names, or one that does not exist.
    """
    given: object = record
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise ExperimentError(f"record: must be a list of names, got {shown(given)}")
    check_channels("record", record)
    own = robot.experiment if isinstance(robot, Robot) else None
    document = document_of(experiment or own or DEFAULT)
    settings = evaluation_settings_of(island_experiment(document, 0))
    return replace(settings, record=tuple(record)) if record else settings


def outside_of_runs(trial: object) -> Identity:
    """Return the identity of an evaluation of a robot that was born in no run."""
    number = whole_number("trial", trial, most=MOST_TRIAL)
    return replace(NO_IDENTITY, trial=number)


def result_of(
    outcome: object, settings: EvaluationSettings, robot: PlainRobot
) -> Result:
    """Return a worker's evaluation of a robot, or its failure, as a result."""
    trace = None
    if isinstance(outcome, Traced):
        if outcome.trace is not None:
            trace = unpack_trace(outcome.trace, robot)
        outcome = outcome.outcome
    if isinstance(outcome, Failure):
        why = printable(outcome.reason, LONGEST_REASON) or NO_MESSAGE
        return Result(failure=why, trace=trace)
    assert isinstance(outcome, Evaluation)
    return Result(
        outcome.fitness,
        outcome.path_velocity,
        outcome.straight_velocity,
        outcome.simulated_s,
        dict(zip(settings.measures.labels, outcome.measures, strict=True)),
        trace=trace,
    )
