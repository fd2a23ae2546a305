"""Re-evaluation of the robots of finished runs under changes of the simulation."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec.structs import replace

from analysis.comparison.robustness import COLUMNS, summary, table_of
from analysis.figures.robustness import robustness
from revolve.cli.reevaluation import Job, reevaluated, write_results
from revolve.cli.winners import Chosen, chosen_robots
from worker.robot.robustness import all_changes

STEM = "robustness"


def rejudge_runs(folders: Sequence[Path], out: Path, workers: int) -> None:
    """Re-evaluate robots of runs; write the table and the figure, print a line each.

    Args:
        folders: of finished runs.
        out: folder to write to.
        workers: worker processes on this machine.

    Raises:
        RunFolderError: no run, an unfinished one, or a folder that cannot be written.
        RevolveError: no worker is left.
    """
    jobs = [job for one in chosen_robots(folders) for job in _jobs(one)]
    write_results(
        lambda: table_of(reevaluated(jobs, workers), COLUMNS),
        folders,
        out / STEM,
        summary,
        robustness,
    )


def _jobs(one: Chosen) -> Iterator[Job]:
    """Yield the evaluations of a robot, without ``[robust]``."""
    settings = replace(one.settings, robust=None)
    yield Job(one, None, settings, one.robot)
    for change in all_changes(settings):
        columns = {"group": change.group, "change": change.name}
        yield Job(one, columns, change.settings, one.robot)
