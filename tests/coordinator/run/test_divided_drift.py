"""A divided arena whose workers all leave, and one of another platform takes over."""

from typing import Any

import pytest

from coordinator.dispatch.events import Joined, Left, Returned, Ticked
from coordinator.dispatch.fleet import JobRouter
from coordinator.parts import arena_parts
from coordinator.run.run_context import RunContext
from coordinator.run.shard_requests import ShardRequests
from schema.agent.request_handler import answer as answer_to
from schema.experiment.identity import Origin
from schema.limits import ADVANCE_REQUEST_BYTES
from schema.wire.arena import AdvanceShard, Changes, Insertion
from schema.wire.codec import decode
from schema.wire.messages import Request
from tests.coordinator.arena_world import experiment
from tests.coordinator.run.test_advance_checks import (
    CLIENT,
    FIRST,
    NEXT,
    SECOND,
    UNTIL,
    Kept,
    NoDeaths,
)
from tests.coordinator.sent_requests import ROBOT, SentJobs
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

LATER_S = 100.0


def works(agents: SentJobs, count: int) -> list[AdvanceShard]:
    """Return the newest requests."""
    found = []
    for _, _, payload in agents.sent[-count:]:
        work = decode(Request, payload, ADVANCE_REQUEST_BYTES).work
        assert isinstance(work, AdvanceShard)
        found.append(work)
    return found


def test_one_worker_of_another_platform_continues_the_whole_arena(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both parts move to it, and only one of its two answers counts."""
    monkeypatch.setattr(arena_parts, "GROWTH_M", -1.0)
    agents = SentJobs()
    fleet = JobRouter(agents, allows_drift=True)
    context, kept = RunContext.of("run", 3, experiment(9), Origin()), Kept()
    requests = ShardRequests(context, kept, fleet, parts=2)
    worker = Jobs(Shards(NoDeaths))

    def answered(number: int, agent: str, payload: bytes, now_s: float) -> list[Any]:
        data = answer_to(worker.answer, decode(Request, payload, ADVANCE_REQUEST_BYTES))
        fleet.tell(Returned(number, agent, "ok", data))
        return [requests.take(end) for end in fleet.listen(0.0, now_s).get(CLIENT, ())]

    for name in ("one", "two"):
        fleet.tell(Joined(name, "worker", 1, "any"))
    born = tuple(Insertion(each, ROBOT, (0.0, 0.0)) for each in (FIRST, SECOND))
    requests.send(AdvanceShard(0, 0, UNTIL, Changes((), born), True))
    (reached,) = answered(*agents.sent[-1], 0.0)
    kept.write(0, UNTIL, reached.snapshot)
    requests.commit(reached.event)
    requests.send(AdvanceShard(0, 1, NEXT, Changes(), False))
    assert {work.part and work.part.number for work in works(agents, 2)} == {0, 1}

    for name in ("one", "two"):
        fleet.tell(Left(name))
    fleet.tell(Joined("three", "worker", 1, "other"))
    for now_s in (0.0, LATER_S):
        fleet.tell(Ticked(now_s))
        fleet.listen(0.0, now_s)
    assert [work.part for work in works(agents, 2)] == [None, None]
    taken = [
        reached
        for sent in agents.sent[-2:]
        for reached in answered(*sent, LATER_S)
        if reached is not None
    ]
    (reached,) = taken
    assert reached.event.advance.step == NEXT
    assert requests.commit(reached.event) is not None
