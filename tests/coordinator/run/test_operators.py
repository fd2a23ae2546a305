"""Orders of operators: which run they go to."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from coordinator.dispatch.fleet import Fleet
from coordinator.network.local import LocalAgents
from coordinator.run.operators import answer_operator
from coordinator.run.scheduler import Planned, RunScheduler
from coordinator.run.session import RunSession
from coordinator.storage.folder import RunDetails, RunFolder
from coordinator.storage.folder_status import unbegun_status
from schema.experiment.file import experiment_text
from schema.wire.operator import (
    OperatorReply,
    OperatorRequest,
    PauseArena,
    decode_operator_reply,
    encode_operator_request,
)
from tests.coordinator.arena_world import experiment

DETAILS = RunDetails("arena", 0, 1, experiment_text(experiment(30)))


@contextmanager
def started(path: Path) -> Iterator[RunScheduler]:
    """Start a run of an arena in a folder."""
    fleet = Fleet(LocalAgents({}, ""))
    scheduler = RunScheduler(
        [Planned(unbegun_status(path, DETAILS), lambda: RunFolder(path, DETAILS))],
        fleet,
        open_run=lambda held, _watched: RunSession(held, fleet),
        most=1,
        conclude=lambda _run: None,
        report=lambda *_: None,
    )
    scheduler.turn(0.0, lambda: 0.0)
    try:
        yield scheduler
    finally:
        scheduler.close()


def ask(scheduler: RunScheduler, name: str) -> OperatorReply:
    request = OperatorRequest("x", 0, PauseArena(), name)
    data = answer_operator(scheduler, encode_operator_request(request), 0.0)
    return decode_operator_reply(data)


@pytest.mark.parametrize("given", [".", "link", "real"])
def test_a_run_is_named_by_its_folder_without_links(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str
) -> None:
    real = tmp_path / "real"
    real.mkdir()
    (tmp_path / "link").symlink_to(real)
    monkeypatch.chdir(real if given == "." else tmp_path)
    with started(Path(given)) as scheduler:
        (run,) = scheduler.status(0.0).runs
        assert Path(run.folder).name == "real"
        refused = ask(scheduler, "other")
        assert refused.is_refused
        reply = ask(scheduler, "real")
        assert not reply.is_refused, reply.text
