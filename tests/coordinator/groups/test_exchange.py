"""Groups of islands that exchange migrants have the births of one archipelago."""

from collections.abc import Iterator, Sequence
from itertools import count

import pytest
from msgspec.structs import replace

from coordinator.groups.exchange import (
    GroupExchange,
    MigrantsReply,
)
from schema.experiment.document import Islands, island_experiments
from schema.experiment.identity import Group
from schema.limits import MIGRANTS_BYTES
from schema.wire.codec import decode, encode
from schema.wire.migration import MigrantsRequest
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
            taken = mine.take(request, replies, self.now_s)
            assert not taken.faults
            for event in taken.events:
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


@pytest.mark.parametrize("of", [2, 3, 5])
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
