"""Runs of a campaign in parallel: results as alone, all workers busy."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from pathlib import Path

import pytest
from msgspec.structs import replace

import tests.analyzers
import tests.null_workers
from coordinator.dispatch.events import DispatchEvent, Joined, Returned
from coordinator.dispatch.fleet import Agents, JobRouter
from coordinator.network.local import LocalAgents
from coordinator.run.scheduler import SLACK, Planned, RunScheduler
from coordinator.run.session import RunSession
from coordinator.storage.campaign import Campaign
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunFolder
from coordinator.storage.folder_status import folder_status, unbegun_status
from coordinator.storage.lock import LOCK
from schema.errors import RevolveError, RunFolderError
from schema.experiment.file import read_experiment
from schema.tables.description import read_state
from schema.wire.status import RunStatus
from tests.coordinator.sent_requests import SentJobs

BIRTHS = 24
EXPERIMENTS = tuple(
    replace(read_experiment(name), births=BIRTHS) for name in ("scenario2", "scenario1")
)
CLOCK = partial(next, map(float, count()))
CAMPAIGN = Campaign(EXPERIMENTS, 2, 3)


def local(kind: type[LocalAgents] = LocalAgents) -> LocalAgents:
    answers = {
        "analyzer": tests.analyzers.answer,
        "worker": tests.null_workers.answer,
    }
    return kind(answers, "any")  # type: ignore[arg-type]


def plan(folder: Path, campaign: Campaign = CAMPAIGN) -> list[Planned]:
    """Return the runs of a campaign, resumed where they exist."""
    planned = []
    for path, details in campaign.runs(folder):
        if path.exists():
            planned.append(Planned(folder_status(path), partial(RunFolder, path)))
        else:
            status = unbegun_status(path, details)
            planned.append(Planned(status, partial(RunFolder, path, details)))
    return planned


def scheduler_of(
    planned: list[Planned],
    agents: Agents,
    report: Callable[[RunStatus, RevolveError], None] = lambda *_: None,
) -> RunScheduler:
    fleet = JobRouter(agents)
    return RunScheduler(
        planned,
        fleet,
        open_run=lambda held, _watched: RunSession(held, fleet),
        most=50,
        conclude=lambda _run: None,
        report=report,
    )


def conduct(scheduler: RunScheduler, turns: int = 10**6) -> None:
    for _ in range(turns):
        if scheduler.is_finished:
            return
        scheduler.turn(0.0, CLOCK)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the same runs, run one after the other."""
    folder = tmp_path_factory.mktemp("alone")
    for planned in plan(folder):
        conduct(scheduler_of([planned], local()))
    return folder


def test_runs_side_by_side_give_the_results_of_single_runs(
    tmp_path: Path, alone: Path
) -> None:
    scheduler = scheduler_of(plan(tmp_path), local())
    conduct(scheduler)
    status = scheduler.status(0.0)
    assert {run.state for run in status.runs} == {"finished"}
    assert (status.births, status.wanted) == (4 * BIRTHS, 4 * BIRTHS)
    for path, _ in CAMPAIGN.runs(alone):
        assert compare(path, tmp_path / path.name) == []
    repeats = compare(tmp_path / "scenario1-0", tmp_path / "scenario1-1")
    assert repeats != []


def test_stopped_runs_resume_and_finished_ones_are_not_started(
    tmp_path: Path, alone: Path
) -> None:
    for turns in (30, 60, 60):
        scheduler = scheduler_of(plan(tmp_path), local())
        conduct(scheduler, turns)
        scheduler.stop()
        assert not scheduler.is_finished
        assert scheduler.active == []
    states = {path: read_state(path) for path, _ in CAMPAIGN.runs(tmp_path)}
    assert "stopped" in states.values()
    conduct(scheduler_of(plan(tmp_path), local()))
    for path, _ in CAMPAIGN.runs(alone):
        assert compare(path, tmp_path / path.name) == []
    assert scheduler_of(plan(tmp_path), local()).is_finished


def test_rate_is_known_at_the_first_query(tmp_path: Path) -> None:
    scheduler = scheduler_of(plan(tmp_path), local())
    scheduler.do_chores(0.0)
    conduct(scheduler, 100)
    status = scheduler.status(2.0)
    assert status.births_per_s == status.births / 2.0 > 0.0


def test_error_in_a_run_that_was_taken_over_is_the_takeover(tmp_path: Path) -> None:
    """It was suspended just after it had checked that it owned the run."""
    scheduler = scheduler_of(plan(tmp_path)[:1], local())
    conduct(scheduler, 30)
    (run,) = scheduler.active
    (run.held.path / LOCK).unlink()
    conduct(scheduler_of(plan(tmp_path)[:1], local()))
    with pytest.raises(RunFolderError):
        run.do_chores()
    scheduler.guard(run, broken)
    ((_, error),) = scheduler.failed
    assert "coordinator 2 has taken it over" in str(error)
    assert scheduler.active == []


class Fencing(LocalAgents):
    """Agents that refuse the first jobs as those of a replaced coordinator."""

    fenced = 5

    def receive(
        self, timeout_s: float, _pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        events = super().receive(timeout_s)
        for place, event in enumerate(events):
            if self.fenced and isinstance(event, Returned):
                self.fenced -= 1
                told = Returned(event.number, event.agent, "fenced", reason="epoch 9")
                return [*events[:place], told]
        return events


def test_a_run_goes_on_if_agents_say_without_reason_that_it_was_taken_over(
    tmp_path: Path, alone: Path
) -> None:
    scheduler = scheduler_of(plan(tmp_path)[:1], local(Fencing))
    conduct(scheduler)
    assert scheduler.failed == []
    ((path, _), *_) = CAMPAIGN.runs(alone)
    assert compare(path, tmp_path / path.name) == []
    faults = scheduler.status(0.0).faults
    assert {fault.kind for fault in faults} == {"fenced"}
    assert sum(fault.count for fault in faults) == 5


def test_a_run_stops_at_once_if_agents_say_so_and_its_folder_too(
    tmp_path: Path,
) -> None:
    scheduler = scheduler_of(plan(tmp_path)[:1], local(Fencing))
    scheduler.turn(0.0, CLOCK)
    (run,) = scheduler.active
    (run.held.path / LOCK).unlink()
    with RunFolder(run.held.path):
        conduct(scheduler, 3)
    ((_, error),) = scheduler.failed
    assert "coordinator 2 has taken it over" in str(error)
    assert scheduler.status(0.0).faults == ()


def broken() -> None:
    raise RunFolderError("finished with 15 rows, and more came")


def test_runs_are_started_until_requests_are_twice_the_credits(tmp_path: Path) -> None:
    one_at_a_time = replace(
        EXPERIMENTS[0], selection=replace(EXPERIMENTS[0].selection, population=5)
    )
    details = Campaign((one_at_a_time,), 30, 1).runs(tmp_path)
    planned = [
        Planned(unbegun_status(path, each), partial(RunFolder, path, each))
        for path, each in details
    ]
    silent = SentJobs(
        Joined("one", "worker", 1, "p"),
        Joined("two", "worker", 1, "p"),
        Joined("judge", "analyzer", 1, "p"),
    )
    scheduler = scheduler_of(planned, silent)
    scheduler.turn(0.0, lambda: 0.0)
    assert len(scheduler.active) == 1
    scheduler.turn(0.0, lambda: 1.0)
    # Five founders of each are open; credits are 2 x 2.
    assert scheduler.fleet.dispatch.pending == 10
    assert scheduler.fleet.dispatch.pending >= SLACK * scheduler.fleet.dispatch.credits
    assert len(scheduler.active) == 2
    scheduler.close()


def test_run_that_cannot_start_stops_no_other(tmp_path: Path, alone: Path) -> None:
    planned = plan(tmp_path)
    said: list[str] = []
    (tmp_path / "scenario2-1").mkdir()
    (tmp_path / "scenario2-1" / "mine.txt").write_text("not empty")
    scheduler = scheduler_of(
        planned, local(), lambda details, error: said.append(f"{details.run} {error}")
    )
    conduct(scheduler)
    assert [type(error) for _, error in scheduler.failed] == [RunFolderError]
    assert len(said) == 1
    assert said[0].startswith("1 ")
    assert "mine.txt" in said[0]
    states = [run.state for run in scheduler.status(0.0).runs]
    assert sorted(states) == ["failed", "finished", "finished", "finished"]
    assert compare(alone / "scenario2-0", tmp_path / "scenario2-0") == []


def test_run_whose_disk_fails_stops_no_other(tmp_path: Path, alone: Path) -> None:
    scheduler = scheduler_of(plan(tmp_path), local())
    conduct(scheduler, 60)
    # Another coordinator has opened it since, by its epoch.
    victim = scheduler.active[0].held.path
    (victim / "epoch").write_text("7")
    scheduler.do_chores(0.0)
    conduct(scheduler)
    assert [status.name for status, _ in scheduler.failed] == [
        victim.name.rpartition("-")[0]
    ]
    others = [path for path, _ in CAMPAIGN.runs(alone) if path.name != victim.name]
    for path in others:
        assert compare(path, tmp_path / path.name) == []
