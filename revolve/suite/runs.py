"""Runs of the suite, and the scores of their best robots."""

from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn

import coordinator.__main__
from analysis.progress import bars
from coordinator.plugins.checks import refuse_faulty
from coordinator.storage import campaign as campaigns
from coordinator.storage.lock import FolderLock
from revolve.evaluation import Result
from revolve.experiment import Experiment, document_of
from revolve.fleet import Fleet
from revolve.runs import Run
from revolve.suite.protocol import Protocol, obeying
from revolve.suite.score import Score, TaskScore
from schema.agent.version import VERSION
from schema.errors import RunFolderError


def evolve(protocol: Protocol, source: str, folder: Path, workers: int) -> int:
    """Start or resume the runs of an experiment; return the exit code of ``resume``.

    ``source`` is a shipped name or a path, ``folder`` that of the campaign.

    Raises:
        ExperimentError: an invalid experiment or plug-in, or one that does not obey.
        RunFolderError: the folder is in use, or holds other runs.
    """
    tasks = obeying(protocol, Experiment.read(source), source)
    refuse_faulty(campaigns.read_drafts([source]))
    documents = tuple(map(document_of, tasks.values()))
    wanted = campaigns.Campaign(documents, protocol.repeats, protocol.seed)
    with FolderLock(folder):
        if not campaigns.is_campaign(folder):
            campaigns.refuse_used(folder, wanted)
            campaigns.write_campaign(folder, wanted)
        elif campaigns.read_campaign(folder) != wanted:
            why = "holds runs of another experiment or version; choose another folder"
            raise RunFolderError(f"{folder}: {why}")
    words = ["resume", str(folder), "--workers", str(workers)]
    return coordinator.__main__.main(words)


def score_runs(protocol: Protocol, source: str, folder: Path, workers: int) -> Score:
    """Return the score of finished runs, without intervals and comparisons.

    Raises:
        RunFolderError: a table is damaged.
        RevolveError: no worker is left.
    """
    runs = [
        Run(folder / f"{task}-{number}")
        for task in protocol.tasks
        for number in range(protocol.repeats)
    ]
    tasks = {task: TaskScore([], [], []) for task in protocol.tasks}
    bar = ("{task.description}", BarColumn(), MofNCompleteColumn())
    with Fleet(workers) as fleet, bars("evaluating the best robots", *bar) as progress:
        jobs = {run: [*_submitted(run, protocol, fleet)] for run in runs}
        for run in progress.track(runs, description="best robots"):
            first, *later = [job.result().fitness or 0.0 for job in jobs[run]]
            tasks[run.name].evaluations.append(_evaluations(run))
            tasks[run.name].first.append(first)
            tasks[run.name].later.append(sum(later) / len(later))
    experiment = Experiment.read(source)
    replaced = {"name", "births"}.union(*protocol.tasks.values())
    own = {k: v for k, v in experiment.settings.items() if k not in replaced}
    version = (protocol.version, protocol.digest, VERSION)
    return Score(experiment.name, own, *version, tasks)


def _submitted(
    run: Run, protocol: Protocol, fleet: Fleet
) -> Iterator["Future[Result]"]:
    """Yield the evaluations of a run's best robot in the first and later windows."""
    (robot,) = run.best_ever()
    for number in range(1 + protocol.later_windows):
        yield fleet.submit(robot, in_window(run.experiment, number))


def in_window(experiment: Experiment, number: int) -> Experiment:
    """Return an experiment whose evaluations begin a number of windows later."""
    clock = experiment.settings["simulation"]
    start = clock["warmup_steps"] + number * clock["window_steps"]
    return experiment.replace(simulation={"warmup_steps": start})


def _evaluations(run: Run) -> int:
    trials = run.learning.num_rows
    # A newborn that learns has one row of evaluations, for all of its trials.
    newborns = run.births.num_rows if trials else 0
    return int(run.evaluations.num_rows - newborns + trials)
