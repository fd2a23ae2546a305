"""Re-evaluation of the robots of finished runs under changes, or without some parts."""

from argparse import Namespace
from collections.abc import Iterator

from msgspec.structs import replace

from analysis.comparison import ablation, robustness
from analysis.figures.changes import ablation as ablation_figure
from analysis.figures.changes import robustness as robustness_figure
from coordinator.evolution.generation import random_brain
from coordinator.evolution.random_streams import Purpose, stream
from revolve.cli.reevaluation import ReevaluationJob, Study
from revolve.cli.winners import Chosen, chosen_robots
from revolve.robot import plain
from schema.experiment.document import REVOLVE_ANGLE, body_space
from schema.robot.ids import BirthId
from worker.filters.ablation import all_ablations
from worker.robot.robustness import all_changes


def study_of(command: str) -> Study:
    """Return what ``robustness`` or ``ablate`` evaluates and writes."""
    if command == "robustness":
        return Study(
            "robustness",
            robustness.COLUMNS,
            robustness.summary,
            robustness_figure,
            _change_jobs,
        )
    return Study(
        "ablation",
        ablation.COLUMNS,
        ablation.summary,
        ablation_figure,
        _ablation_jobs,
    )


def _change_jobs(options: Namespace) -> list[ReevaluationJob]:
    return [job for one in chosen_robots(options.runs) for job in _changes(one)]


def _ablation_jobs(options: Namespace) -> list[ReevaluationJob]:
    chosen = chosen_robots(options.runs, options.robots)
    for name in dict.fromkeys(one.document.encoding.type for one in chosen):
        if options.brains and name != REVOLVE_ANGLE:
            print(
                f"left out: random brains: encoding {name!r} makes body and brain of "
                "one genome"
            )
    return [job for one in chosen for job in _ablations(one, options.brains)]


def _changes(one: Chosen) -> Iterator[ReevaluationJob]:
    """Yield the evaluations of a robot, without ``[robust]``."""
    settings = replace(one.settings, robust=None)
    yield ReevaluationJob(one, None, settings, one.robot)
    for change in all_changes(settings):
        columns = {"group": change.group, "change": change.name}
        yield ReevaluationJob(one, columns, change.settings, one.robot)


def _ablations(one: Chosen, brains: int) -> Iterator[ReevaluationJob]:
    """Yield the evaluations of a robot, and of its body with some random brains."""
    settings, robot = one.settings, plain(one.robot)
    yield ReevaluationJob(one, None, settings, robot)
    for change in all_ablations(robot, body_space(settings.space)):
        columns = {
            "group": change.group,
            "scope": change.scope,
            "kind": change.kind,
            "part": change.part,
            "channel": change.channel,
            "change": change.name,
        }
        yield ReevaluationJob(
            one, columns, replace(settings, ablation=change.ablation), robot
        )
    # Other encodings make body and brain of one genome.
    if one.document.encoding.type != REVOLVE_ANGLE:
        return
    birth = BirthId(one.row["island"], one.row["birth"])
    for number in range(brains):
        rng = stream(one.run.seed, one.run.number, birth, number, Purpose.OTHER_BRAIN)
        columns = {
            "group": ablation.RANDOM,
            "scope": "one",
            "kind": "",
            "part": None,
            "channel": number,
            "change": f"random brain {number + 1}",
        }
        yield ReevaluationJob(
            one, columns, settings, random_brain(rng, robot, one.document)
        )
