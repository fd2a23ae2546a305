"""Tests of jobs that came to an agent together."""

from typing import Any

import pytest

from schema.agent.inbox import TURN_S, Inbox
from schema.agent.job_service import WaitingJobs
from schema.agent.network import Agent
from schema.agent.request_handler import ReplyCounts, Server
from schema.limits import BUNDLE_BYTES, MOST_BUNDLED
from schema.robot.results import Evaluation
from schema.wire.codec import decode, encode
from schema.wire.messages import Call, Replies, Reply, Request

Sent = list[list[int]]


class Query:
    """Query that keeps what is replied to it; ``ends`` counts how often it ends."""

    def __init__(self, payload: bytes) -> None:
        self.payload = Payload(payload)
        self.attachment = None
        self.replies: list[list[Reply]] = []
        self.refusals: list[str] = []
        self.ends = 0

    def reply(self, _key: object, data: bytes) -> None:
        self.replies.append(decode(Replies, data, BUNDLE_BYTES))

    def reply_err(self, reason: str) -> None:
        self.refusals.append(reason)

    def drop(self) -> None:
        self.ends += 1

    @property
    def places(self) -> Sent:
        """Places of the jobs in each reply."""
        return [[each.place for each in reply] for reply in self.replies]


class Payload(bytes):
    def to_bytes(self) -> bytes:
        return bytes(self)


def jobs(count: int, number: int = 0) -> bytes:
    requests = (Request("r", 1, number + n, Call(b"\xc0"), b"") for n in range(count))
    return encode([encode(each) for each in requests])


def waiting(*queries: Query) -> Any:  # noqa: ANN401 - keys and queries are made up
    inbox: Inbox[Any] = Inbox()
    for each in queries:
        inbox.put(each)
    made = WaitingJobs("key", ReplyCounts())  # type: ignore[arg-type]
    assert made.take_all(inbox)
    return made


def server(clock: "Clock", *durations_s: float) -> Server:
    """Server whose jobs take these times [s]."""
    left = iter(durations_s)

    def compute(request: Request) -> Evaluation:
        clock.now_s += next(left)
        return Evaluation(float(request.number), 0.0, 0.0, 1.0)

    return Server(compute, Agent("worker", "w", "tcp/h:1", version="1"))


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("schema.agent.job_service.time", made)
    return made


def test_replies_to_quick_jobs_travel_together(clock: Clock) -> None:
    query = Query(jobs(3))
    turns, work = waiting(query), server(clock, 0.0, 0.5 * TURN_S, 0.0)
    for _ in range(3):
        assert not query.ends
        turns.do_next(work)
    assert (query.places, query.ends) == ([[0, 1, 2]], 1)


def test_a_reply_that_took_long_is_sent_with_those_before(clock: Clock) -> None:
    query = Query(jobs(4))
    turns, work = waiting(query), server(clock, 0.0, 2.0 * TURN_S, 0.0, 0.0)
    for _ in range(3):
        turns.do_next(work)
    assert query.places == [[0, 1]]
    turns.send_replies()
    assert query.places == [[0, 1], [2]]
    turns.do_next(work)
    assert (query.places, query.ends) == ([[0, 1], [2], [3]], 1)


def test_quick_jobs_that_take_long_together_are_answered(clock: Clock) -> None:
    query = Query(jobs(5))
    turns, work = waiting(query), server(clock, *[0.4 * TURN_S] * 5)
    for _ in range(5):
        turns.do_next(work)
    assert query.places == [[0, 1, 2], [3, 4]]


def test_jobs_whose_replies_are_sent_do_not_count_any_more(clock: Clock) -> None:
    query = Query(jobs(3))
    turns, work = waiting(query), server(clock, *[0.6 * TURN_S] * 3)
    turns.do_next(work)
    turns.send_replies()
    turns.do_next(work)
    assert query.places == [[0]]
    turns.do_next(work)
    assert query.places == [[0], [1, 2]]


def test_replies_do_not_wait_for_another_coordinators_job(clock: Clock) -> None:
    one, other = Query(jobs(3)), Query(jobs(3, number=5))
    other.attachment = Payload(b"another")  # type: ignore[assignment]
    shares = (0.6, 0.6, 2.0, 0.3, 0.0)
    work = server(clock, *[share * TURN_S for share in shares])
    turns, sent = waiting(one, other), []
    for _ in shares:
        turns.do_next(work)
        sent.append((str(one.places), str(other.places)))
    assert sent == [
        ("[]", "[]"),
        ("[[0, 1]]", "[]"),
        ("[[0, 1]]", "[[0]]"),
        ("[[0, 1]]", "[[0]]"),
        ("[[0, 1], [2]]", "[[0], [1]]"),
    ]


def test_dropped_jobs_get_no_reply_and_end_their_query(clock: Clock) -> None:
    query = Query(jobs(3))
    turns = waiting(query)
    turns.do_next(server(clock, 0.0))
    turns.drop_all()
    assert (query.places, query.ends) == ([[0]], 1)


@pytest.mark.parametrize("data", [b"", b"?", encode([]), jobs(MOST_BUNDLED + 1)])
def test_a_malformed_query_is_refused(data: bytes) -> None:
    query, counts = Query(data), ReplyCounts()
    inbox: Inbox[Any] = Inbox()
    inbox.put(query)
    assert not WaitingJobs("key", counts).take_all(inbox)  # type: ignore[arg-type]
    assert (counts.refused, counts.malformed) == (1, 1)
    assert (len(query.refusals), query.replies, query.ends) == (1, [], 1)
