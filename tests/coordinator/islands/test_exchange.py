"""Groups of islands that exchange migrants have the births of one archipelago."""

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.islands.events import Immigrated
from coordinator.islands.exchange import (
    ASK_S,
    LEAVE_S,
    GroupExchange,
    MigrantsReply,
)
from schema.experiment.document import Islands, island_experiments
from schema.experiment.identity import Group
from schema.limits import MIGRANTS_BYTES
from schema.robot.ids import BirthId
from schema.wire.codec import decode, encode
from schema.wire.migration import MigrantsRequest, Needed
from tests.coordinator.archipelago_run import ARENA, ArchipelagoRun, migrating

OFF_LINE = (Islands(count=3, births=90), Islands(births=40), Islands(births=70))
MIXED = (replace(ARENA, births=14), replace(ARENA, births=24), *OFF_LINE)


class Groups:
    """Groups of an archipelago, without a network between them.

    Attributes:
        now_s: time, which passes by a second whenever no group has an open request.
    """

    def __init__(self, whole: ArchipelagoRun, of: int, orders: Iterator[int]) -> None:
        experiments = dict(enumerate(island_experiments(whole.experiment)))
        self.now_s = 0.0
        self._orders = orders
        self.runs = [
            ArchipelagoRun(whole.experiment, group=Group(number=n, of=of))
            for n in range(of)
        ]
        self.exchanges = [
            GroupExchange(
                "test",
                b"digest",
                run.group,
                islands=run.islands,
                experiments=experiments,
                outbox=run.outbox,
                now_s=0.0,
            )
            for run in self.runs
        ]

    def live(self) -> None:
        for run in self.runs:
            run.start()
        for _ in range(100_000):
            waiting = [run for run in self.runs if run.waiting]
            if not waiting and all(x.is_done(self.now_s) for x in self.exchanges):
                break
            if waiting:
                waiting[next(self._orders) % len(waiting)].turn()
            else:
                self.now_s += 1.0
            self.exchange(next(self._orders) % len(self.runs))
        assert all(one.is_finished for run in self.runs for one in run.islands.values())

    def exchange(self, number: int) -> None:
        run, mine = self.runs[number], self.exchanges[number]
        if mine.has_news():
            for other in self.exchanges:
                if next(self._orders) % 3:  # announcements may be lost
                    other.announced(mine.news)
        for request in mine.requests(self.now_s):
            replies = self.replies(decode(MigrantsRequest, encode(request), 10**6))
            events, faults = mine.take(request, replies, self.now_s)
            assert not faults
            for event in events:
                run.tell(event.island, event)

    def replies(self, request: MigrantsRequest) -> list[tuple[str, MigrantsReply]]:
        replies = []
        for run, other in zip(self.runs, self.exchanges, strict=True):
            reply, served = other.answer(request, self.now_s)
            run.outbox.served |= {each.group for each in served}
            if reply is not None:
                data = encode(reply)
                replies.append(("name", decode(MigrantsReply, data, MIGRANTS_BYTES)))
        return replies


@pytest.mark.parametrize("of", [2, 5])
@pytest.mark.parametrize("islands", [OFF_LINE, MIXED])
def test_groups_have_the_births_of_one_archipelago(
    of: int, islands: Sequence[Islands]
) -> None:
    whole = migrating(*islands).live()
    groups = Groups(whole, of, (n * 2654435761 % 2**32 >> 7 for n in count(of)))
    groups.live()
    joined = {k: v for run in groups.runs for k, v in run.outcome.items()}
    assert joined == whole.outcome
    assert any(row["birth_island"] is not None for row in whole.rows("population"))


@pytest.mark.parametrize("islands", [OFF_LINE, MIXED])
def test_migrants_that_follow_no_closing_are_those_of_a_longer_run(
    islands: Sequence[Islands],
) -> None:
    longer = [replace(one, births=(one.births or 0) + 30) for one in islands]
    short, long = (Groups(migrating(*each), 2, count()) for each in (islands, longer))
    short.live()
    long.live()
    untouched, changed = 0, 0
    for one, other in zip(short.runs, long.runs, strict=True):
        for (source, target), events in one.outbox.sent.items():
            for epoch, event in enumerate(events):
                is_equal = other.outbox.get(source, target, epoch) == event
                untouched += is_equal
                changed += not is_equal
                assert is_equal or not (
                    isinstance(event, Immigrated) and not event.follows_closing
                )
    assert untouched > 20
    assert changed > 5


def waiting_pair() -> tuple[Groups, MigrantsRequest, MigrantsReply]:
    """Return two groups, a request of the second one, and the honest reply."""
    groups = Groups(migrating(*OFF_LINE), 2, count())
    for run in groups.runs:
        run.start()
        while run.waiting:
            run.turn()
    (request,) = groups.exchanges[1].requests(0.0)
    ((_, reply),) = groups.replies(request)
    assert [each.epoch for each in request.needed] == [0, 0, 0, 0]
    assert len(reply.events) == 4
    return groups, request, reply


ROBOT = b"\x0a\x02"
FALSE: dict[str, Callable[[Immigrated], Immigrated]] = {
    "another epoch": lambda e: replace(e, epoch=1),
    "another island": lambda e: replace(e, source=2 - e.source),
    "too many migrants": lambda e: replace(e, migrants=e.migrants * 2),
    "no genome": lambda e: with_migrant(e, genome=ROBOT),
    "another size": lambda e: with_migrant(e, size=e.migrants[0].size + 1),
    "a birth of no island": lambda e: with_migrant(e, birth=BirthId(5, 0)),
    "a birth beyond the last": lambda e: with_migrant(e, birth=BirthId(0, 90)),
    "parents of no island": lambda e: with_migrant(e, parents=(BirthId(7, 1),)),
    "unknown measures": lambda e: with_migrant(e, measures={"speed": 1.0}),
}


def with_migrant(event: Immigrated, **changed: Any) -> Immigrated:  # noqa: ANN401 - any field
    return replace(event, migrants=(replace(event.migrants[0], **changed),))


@pytest.mark.parametrize("false", FALSE)
def test_false_migrants_are_refused_with_all_that_came_with_them(false: str) -> None:
    groups, request, reply = waiting_pair()
    first = reply.events[0]
    assert isinstance(first, Immigrated)
    forged = replace(reply, events=(FALSE[false](first), *reply.events[1:]))
    events, ((name, why),) = groups.exchanges[1].take(request, [("liar", forged)], 0.0)
    assert events == []
    assert name == "liar"
    assert "migrants" in why
    # The next time the honest reply counts.
    (again,) = groups.exchanges[1].requests(ASK_S)
    events, faults = groups.exchanges[1].take(again, [("honest", reply)], ASK_S)
    assert (events, faults) == ([*reply.events], [])


def test_of_two_coordinators_that_differ_none_is_believed() -> None:
    groups, request, reply = waiting_pair()
    first = reply.events[0]
    assert isinstance(first, Immigrated)
    other = replace(reply, events=(with_migrant(first, fitness=9.0),))
    replies = [("one", reply), ("two", other)]
    events, faults = groups.exchanges[1].take(request, replies, 0.0)
    assert events == [*reply.events[1:]]
    assert [name for name, _ in faults] == ["one", "two"]
    assert groups.exchanges[1].take(request, [replies[0]] * 2, 0.0)[1] == []


def test_another_archipelago_gets_nothing() -> None:
    groups, request, _ = waiting_pair()
    (first, _) = groups.exchanges
    assert first.answer(replace(request, archipelago="other"), 0.0) == (None, [])
    assert first.answer(replace(request, to=1), 0.0) == (None, [])
    differing, _ = first.answer(replace(request, digest=b"other"), 0.0)
    assert differing == MigrantsReply(differs=True)
    events, faults = groups.exchanges[1].take(request, [("name", differing)], 0.0)
    assert events == []
    assert "has another document, seed, repeat" in faults[0][1]


def test_a_group_ends_when_no_other_needs_its_migrants() -> None:
    groups = Groups(migrating(*OFF_LINE), 2, count())
    groups.live()
    first, second = groups.exchanges
    assert first.is_done(groups.now_s)
    # A group that lost its run begins again.
    needed = (Needed(0, 1, 0),)
    lost = MigrantsRequest("test", b"digest", 1, 0, needed)
    reply, _ = first.answer(lost, groups.now_s)
    assert reply is not None
    assert reply.events == (groups.runs[0].outbox.get(0, 1, 0),)
    assert not first.is_done(groups.now_s)
    assert first.unserved == (1,)
    # One that was resumed and hears nothing ends, as the journal has who is served.
    run = groups.runs[1]
    resumed = GroupExchange(
        "test", b"digest", run.group, islands=run.islands,
        experiments=second._experiments, outbox=run.outbox, now_s=0.0,
    )  # fmt: skip
    assert not resumed.is_done(LEAVE_S)
    assert resumed.is_done(LEAVE_S + 1.0)
