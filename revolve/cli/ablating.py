"""Re-evaluation of the robots of finished runs without some sensors and motors."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from analysis.comparison.ablation import COLUMNS, RANDOM, summary
from analysis.comparison.robustness import table_of
from analysis.figures.ablation import ablation
from coordinator.evolution.generation import random_brain
from coordinator.evolution.random_streams import Purpose, stream
from revolve.cli.reevaluation import Job, reevaluated, write_results
from revolve.cli.winners import Chosen, chosen_robots
from revolve.robot import plain
from schema.experiment.document import REVOLVE_ANGLE, body_space
from schema.robot.ids import BirthId
from worker.robot.ablation import all_ablations

STEM = "ablation"


def ablate_runs(
    folders: Sequence[Path], out: Path, *, robots: int, brains: int, workers: int
) -> None:
    """Re-evaluate robots of runs; write the table and the figure, print a line each.

    Args:
        folders: of finished runs.
        out: folder to write to.
        robots: greatest number of robots of a run's last populations.
        brains: number of random brains for each body.
        workers: worker processes on this machine.

    Raises:
        RunFolderError: no run, an unfinished one, or a folder that cannot be written.
        RevolveError: no worker is left.
    """
    chosen = chosen_robots(folders, robots)
    for name in dict.fromkeys(one.document.encoding.type for one in chosen):
        if brains and name != REVOLVE_ANGLE:
            print(
                f"left out: random brains: encoding {name!r} makes body and brain of "
                "one genome"
            )
    jobs = [job for one in chosen for job in _jobs(one, brains)]
    write_results(
        lambda: table_of(reevaluated(jobs, workers), COLUMNS),
        folders,
        out / STEM,
        summary,
        ablation,
    )


def _jobs(one: Chosen, brains: int) -> Iterator[Job]:
    """Yield the evaluations of a robot."""
    settings, robot = one.settings, plain(one.robot)
    yield Job(one, None, settings, robot)
    for change in all_ablations(robot, body_space(settings.space)):
        columns = {
            "group": change.group,
            "scope": change.scope,
            "kind": change.kind,
            "part": change.part,
            "channel": change.channel,
            "change": change.name,
        }
        yield Job(one, columns, replace(settings, ablation=change.ablation), robot)
    # Other encodings make body and brain of one genome.
    if one.document.encoding.type != REVOLVE_ANGLE:
        return
    birth = BirthId(one.row["island"], one.row["birth"])
    for number in range(brains):
        rng = stream(one.run.seed, one.run.number, birth, number, Purpose.OTHER_BRAIN)
        columns = {
            "group": RANDOM,
            "scope": "one",
            "kind": "",
            "part": None,
            "channel": number,
            "change": f"random brain {number + 1}",
        }
        yield Job(one, columns, settings, random_brain(rng, robot, one.document))
