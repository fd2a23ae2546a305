"""Start and resume runs and campaigns."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from coordinator.cli.campaign_table import outcome_of, show_outcomes
from coordinator.cli.deployment import Deployment
from coordinator.cli.main_loop import execute_runs
from coordinator.cli.summary import Conclusion, conclude, has_evaluated, restore_best
from coordinator.run.lengthening import lengthen, refuse_fewer
from coordinator.run.scheduler import Planned
from coordinator.run.session import RunSession
from coordinator.storage.campaign import (
    Campaign,
    check_adopted,
    forget_campaign,
    is_campaign,
    read_campaign,
    refuse_used,
    write_campaign,
)
from coordinator.storage.folder import (
    RunFolder,
    holds_run,
    read_details,
    refuse_other_version,
)
from coordinator.storage.folder_status import (
    births_of,
    check_rewritable,
    folder_status,
    table_damages,
    unbegun_status,
)
from coordinator.storage.hints import command, stopped
from coordinator.storage.lock import FolderLock
from coordinator.storage.rewriting import is_rewritten
from schema.agent.log import tell_error, tell_user, warn_user
from schema.agent.stopping import STOPPED, advise, tell_stopped
from schema.errors import NetworkError, RevolveError, RunFolderError, counted
from schema.experiment.file import experiment_from_text, experiment_text, with_births
from schema.plugins.kept import refuse_other
from schema.tables.description import STATE, read_description, read_state
from schema.tables.files import is_sealed
from schema.wire.status import RunStatus


def start(folder: Path, campaign: Campaign, deployment: Deployment) -> int:
    """Run the only run of a campaign in a new folder; return the exit code.

    Raises:
        RunFolderError: the folder is used or locked, or the disk fails.
        NetworkError: the address cannot be listened on, or no hub answers.
        ExperimentError: no robot meets the experiment's restrictions.
    """
    ((_, details),) = campaign.runs(folder)
    return _execute_run(folder, RunFolder(folder, details), deployment)


def start_campaign(folder: Path, campaign: Campaign, deployment: Deployment) -> int:
    """Run a campaign in a folder; return the exit code.

    Runs that the folder already holds become part of the campaign.

    Raises:
        RunFolderError: the folder is used or locked, or the disk fails.
        NetworkError: the address cannot be listened on, or no hub answers.
    """
    with FolderLock(folder):
        refuse_used(folder, campaign)
        planned, failed = _plan(folder, campaign)
        begun = _count_begun(folder, campaign)
        write_campaign(folder, campaign)
        try:
            return _execute_campaign(folder, planned, failed, deployment)
        except NetworkError:
            if _count_begun(folder, campaign) == begun:
                forget_campaign(folder)
            raise


def resume(folder: Path, deployment: Deployment) -> int:
    """Continue the run or the campaign of a folder; return the exit code.

    A run for which ``finished_code`` has one must not be resumed.

    Raises:
        RunFolderError: the folder holds neither, another coordinator has locked it,
            its journal is damaged, or the disk fails.
        NetworkError: the address cannot be listened on, or no hub answers.
        ExperimentError: no robot meets a run's restrictions.
    """
    if is_campaign(folder):
        with FolderLock(folder):
            planned, failed = _plan(folder, read_campaign(folder))
            return _execute_campaign(folder, planned, failed, deployment)
    return _execute_run(folder, RunFolder(folder), deployment)


def lengthen_all(folder: Path, births: int) -> None:
    """Give a run, or all runs of a campaign, another number of births.

    Their plug-ins must be allowed. All runs are looked at before the first is changed.

    Raises:
        ExperimentError, RunFolderError: as of ``lengthen``.
    """
    if not is_campaign(folder):
        lengthen(folder, births)
        return
    with FolderLock(folder):
        campaign = read_campaign(folder)
        experiments = tuple(
            with_births(experiment_text(each), births, f"{folder}: {each.name}")
            for each in campaign.experiments
        )
        begun = [path for path, _ in campaign.runs(folder) if holds_run(path)]
        for path in begun:
            refuse_other_version(path)
            refuse_fewer(path, births, max(births_of(path).values(), default=0))
        for path in begun:
            lengthen(path, births)
        write_campaign(folder, replace(campaign, experiments=experiments))


def finished_code(folder: Path, groups: Sequence[Path] = ()) -> int | None:
    """Return the exit code of a run that needs no resumption, and tell the user so.

    The file of its best robot is written if it is missing. None is of a campaign, of a
    run that is not finished or whose tables are to be written again, and of no run; a
    single group of islands may have to serve its migrants. ``groups``: folders of all
    groups, if there are several.

    Raises:
        RunFolderError: a damaged table cannot be written again, or another version of
            Revolve Islands began a run that is to be continued.
    """
    if groups:
        for one in groups:
            if _is_to_be_rewritten(one) or read_state(one) != "finished":
                return None
        tell_user(f"{folder}: already finished")
        return 0 if any(map(has_evaluated, groups)) else 1
    if is_campaign(folder) or not holds_run(folder):
        return None
    if read_description(folder).group.of > 1:
        return None
    if _is_to_be_rewritten(folder) or read_state(folder) != "finished":
        # Before its plug-ins are looked at.
        refuse_other_version(folder)
        return None
    tell_user(f"{folder}: already finished")
    restore_best(folder)
    return 0 if has_evaluated(folder) else 1


def _execute_run(folder: Path, held: RunFolder, deployment: Deployment) -> int:
    """Execute the run of a locked folder, print its summary, return the exit code."""
    conclusions: list[Conclusion] = []
    advise(stopped(folder, deployment.resume_flags))
    with held:
        status = unbegun_status(folder, held.details)
        try:
            scheduler = execute_runs(
                folder,
                [Planned(status, lambda: held)],
                deployment,
                lambda run: conclusions.append(conclude(run.held.path, run.experiment)),
                lambda _status, _error: None,  # raised below
            )
        except NetworkError:
            held.forget()
            raise
    for _, error in scheduler.failed:
        raise error
    if not scheduler.is_finished:
        tell_stopped()
        return STOPPED
    print(conclusions[0].text)
    return 0 if conclusions[0].has_evaluated else 1


def _count_begun(folder: Path, campaign: Campaign) -> int:
    """Return how many of a campaign's runs have a folder."""
    return sum(holds_run(path) for path, _ in campaign.runs(folder))


def _plan(folder: Path, campaign: Campaign) -> tuple[list[Planned], list[Path]]:
    """Return all runs of a campaign, and the finished ones without any evaluation."""
    planned, failed = [], []
    for path, details in campaign.runs(folder):
        status = unbegun_status(path, details)
        try:
            if not holds_run(path):
                planned.append(Planned(status, partial(RunFolder, path, details)))
                continue
            known = read_details(path)
            status = (
                unbegun_status(path, known)
                if _is_to_be_rewritten(path)
                else folder_status(path)
            )
            if status.state == "finished":
                restore_best(path)
                if not has_evaluated(path):
                    failed.append(path)
            else:
                refuse_other(path, read_description(path).plugins)
        except RevolveError as error:
            # The damaged run fails when the scheduler opens it; the others continue.
            planned.append(Planned(status, partial(_raise, error)))
            continue
        check_adopted(path, known, details)
        theirs, ours = (
            experiment_from_text(each.document).births for each in (known, details)
        )
        if theirs != ours:
            tell_user(f"{path}: keeps its own number of births, {theirs} (not {ours})")
        planned.append(Planned(status, partial(RunFolder, path)))
    return planned, failed


def _is_to_be_rewritten(folder: Path) -> bool:
    """Return whether a run's state or finished tables are damaged; tell the user so.

    Those that a rewriting has removed count.
    """
    if is_rewritten(folder):
        return True
    try:
        if read_state(folder) != "finished":
            return False
    except RunFolderError as error:
        tell_user(f"{error}; continuing where the journal ends")
        return True
    if not is_sealed(folder):
        tell_user(
            f"{folder / STATE}: damaged: is 'finished', but the run has no finished "
            "tables; continuing where the journal ends"
        )
        return True
    damages = table_damages(folder)
    for damage in damages:
        warn_user(damage)
    if damages:
        check_rewritable(folder)
        tell_user(f"{folder}: writing such tables again from the journal")
    return bool(damages)


def _raise(error: RevolveError) -> RunFolder:
    raise error


def _execute_campaign(
    folder: Path, planned: Sequence[Planned], failed: list[Path], deployment: Deployment
) -> int:
    """Execute a campaign's runs, print the outcome, return the exit code.

    ``failed`` are folders of finished runs in which all evaluations failed.
    """
    advise(stopped(folder, deployment.resume_flags))
    finished = sum(one.is_finished for one in planned)
    if finished:
        tell_user(f"{finished} of {counted(len(planned), 'run')} already finished")

    def conclude_run(run: RunSession) -> None:
        conclusion = conclude(run.held.path, run.experiment)
        if conclusion.failures:
            warn_user(f"{run.held.path}: {conclusion.failures}")
        if not conclusion.has_evaluated:
            failed.append(run.held.path)

    scheduler = execute_runs(folder, planned, deployment, conclude_run, _report)
    if not scheduler.is_finished:
        tell_stopped()
        return STOPPED
    broken = {
        *(str(path.resolve()) for path in failed),
        *(status.folder for status, _ in scheduler.failed),
    }
    show_outcomes(
        outcome_of(
            Path(one.status.folder),
            one.status.name,
            has_failed=one.status.folder in broken,
        )
        for one in planned
    )
    if scheduler.failed:
        tell_user(
            f"{len(scheduler.failed)} of {counted(len(planned), 'run')} failed; after "
            f"fixing the cause, run: {command('resume', folder)} (with a plug-in that "
            "has changed: start new runs)"
        )
        return 1
    runs = counted(len(planned), "run")
    print(f"{runs} finished\ntry next:\n  {command('analyze', folder)}")
    return 1 if failed else 0


def _report(status: RunStatus, error: RevolveError) -> None:
    tell_error(f"{status.name}-{status.run} failed: {error}")
