"""Bodies of robots: whether they can be built, and how much two of them differ."""

from pathlib import Path

from analyzer.report import analyze
from revolve.experiment import Experiment, document_of
from revolve.robot import Robot, checked, plain
from schema.agent.extras import extra
from schema.experiment.document import Vetting, island_experiment
from schema.formats.files import settings_of, types_for
from schema.robot.results import Report
from schema.robot.robot import Robot as PlainRobot


def vet(
    robot: Robot | PlainRobot, experiment: Experiment | str | Path | None = None
) -> Report:
    """Return the report of the analyzer on a body, made in this process.

    Arguments and errors are those of ``evaluate``; a robot without an experiment may
    have all built-in types, as in ``revolve robot check``.
    """
    named = experiment or (robot.experiment if isinstance(robot, Robot) else None)
    own = island_experiment(document_of(named), 0) if named else None
    types = types_for(settings_of(own))
    return analyze(checked(robot, types), types[0], own.vetting if own else Vetting())


def body_distance(first: Robot | PlainRobot, second: Robot | PlainRobot) -> int:
    """Return the tree edit distance of two bodies; brains are ignored.

    A part more or less costs 1, another type 1, and another slot of its parent 1.

    Raises:
        InvalidRobot: parts in another order than depth first by slot.
        RevolveError: the extra ``analysis`` is not installed.

    Source: Hupkes 2016, section 6.2.1; the figures about diversity use it, too.
    """
    with extra("body_distance needs", "analysis"):
        from schema.robot.body_distance import body_distances  # noqa: PLC0415
    return int(body_distances(plain(first), [plain(second)])[0])
