"""An arena in parts, which several workers hold: what each is asked, and what results.

An advance is made of exchanges. At the start of each one, the states of all robots are
here, and robots may change their part. Nothing that happens in the arena depends on it.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain

from msgspec import structs

from coordinator.parts.exchange import Exchange, PartResult, continued, joined
from coordinator.parts.partition import GROWTH_M, divide, groups_of
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, AdvanceShard, ArenaPart, Box, Changes, Rebuild
from schema.wire.arena_state import ArenaState, states_of
from schema.wire.codec import encode

AGAIN = 1 << 16
"""Number of the part that is advanced again."""
EXCHANGE_S = 1.0
"""Longest duration of an exchange at first, and after a repeat [s]."""
MOST_TIMES = 8
"""After exchanges without a repeat they may become longer, up to so many times."""
REACH_M = 0.2
"""Half the side of the box of a robot that has swept none yet [m]."""
NO_ROBOTS = frozenset[BirthId]()


@dataclass(frozen=True, slots=True)
class Held:
    """What the worker of a part holds.

    Attributes:
        births: of the robots in its arena.
        digest: of the state of that.
        stale: those of its robots that were advanced again elsewhere.
    """

    births: frozenset[BirthId] = NO_ROBOTS
    digest: bytes = b""
    stale: frozenset[BirthId] = NO_ROBOTS

    def kept(self, births: frozenset[BirthId]) -> frozenset[BirthId]:
        """Return which of some robots it need not be given."""
        return (births & self.births) - self.stale


class ArenaParts:
    """An arena in parts, from advance to advance.

    Attributes:
        state: of all robots at the last exchange.
        until: step of the next exchange.
        repeats: number of exchanges with a repeat.
        came: number of robots that each part took from others.
    """

    def __init__(self, state: ArenaState, interval_s: float, steps: int) -> None:
        """Begin with the state of all robots, which one worker holds as part 0.

        Contacts are checked at the interval [s]; an exchange has at most ``steps`` at
        first.
        """
        self.state = state
        self.repeats, self.came = 0, Counter[int]()
        self._held = {0: Held(frozenset(state.births), state.digest)}
        self._boxes: dict[BirthId, Box] = {}
        self._costs: dict[BirthId, float] = {}
        self._works: dict[BirthId, float] = {}
        self._interval_s, self._least, self._steps = interval_s, steps, steps
        self._requested: AdvanceShard | None = None
        self._changes = Changes()
        self._so_far: Advance | None = None
        self.until = 0
        self._before = state
        self._exchange = Exchange((), {})

    @property
    def missing(self) -> list[int]:
        """Parts of the present exchange without a result."""
        return self._exchange.missing

    @property
    def used(self) -> set[int]:
        """Parts of the present exchange, or of the last one."""
        return set(self._exchange.parts)

    def begin(
        self, requested: AdvanceShard, places: Mapping[BirthId, Vector], parts: int
    ) -> None:
        """Begin an advance and its first exchange; changes come after ``places``."""
        self._requested, self._changes = requested, requested.changes
        self._so_far, self._works = None, {}
        self._boxes = {
            birth: self._boxes.get(birth, _around(x, y))
            for birth, (x, y, _) in places.items()
        }
        self._divide(parts)

    def _divide(self, parts: int) -> None:
        """Divide the robots, and begin an exchange."""
        changes, gone = self._changes, set(self._changes.removals)
        assert self._requested is not None
        self.until = min(self._requested.until, self.state.step + self._steps)
        boxes = {birth: box for birth, box in self._boxes.items() if birth not in gone}
        self._before = states_of(self.state, boxes.keys())
        clusters = self._before.clusters
        boxes |= {each.birth: _around(*each.place) for each in changes.insertions}
        mean = sum(self._costs.values()) / max(1, len(self._costs)) or 1.0
        costs = {birth: self._costs.get(birth, mean) for birth in boxes}
        held = {
            birth: part
            for part, each in self._held.items()
            for birth in each.births - each.stale
        }
        divided = divide(groups_of(boxes, clusters, GROWTH_M), costs, held, parts)
        robots = {
            part: frozenset(chain(*groups)) for part, groups in enumerate(divided)
        }
        self.came.update(
            part
            for part, births in robots.items()
            for birth in births
            if held.get(birth, part) != part
        )
        used = {part: births for part, births in robots.items() if births}
        self._exchange = Exchange(clusters, used or {0: NO_ROBOTS})

    def shares(self) -> dict[int, float]:
        """Return the share of each part in the cost of the last exchange."""
        costs = {
            part: sum(self._costs.get(birth, 0.0) for birth in births)
            for part, births in self._exchange.parts.items()
        }
        total = sum(costs.values())
        return {part: cost / total if total else 0.0 for part, cost in costs.items()}

    def robots(self, part: int) -> frozenset[BirthId]:
        """Return the robots of a part of the present exchange, newborns included."""
        again = part == AGAIN
        return self._exchange.repeated if again else self._exchange.parts[part]

    def request(self, part: int, *, is_whole: bool) -> AdvanceShard:
        """Return the request for a part; a whole one has the states of its robots."""
        requested, changes, births = self._requested, self._changes, self.robots(part)
        assert requested is not None
        held = Held() if is_whole else self._held.get(part, Held())
        kept = held.kept(births)
        arrivals = states_of(self._before, births - kept)
        judges = self.until == requested.until
        works = self._works
        own = ArenaPart(
            number=part,
            departures=() if is_whole else tuple(sorted(held.births - kept)),
            arrivals=b"" if is_whole or not arrivals.robots else encode(arrivals),
            checks_merges=bool(changes.insertions),
            judges=judges,
            work_j=tuple(works.get(birth, 0.0) for birth in sorted(births))
            if works
            else (),
        )
        return structs.replace(
            requested,
            until=self.until,
            changes=Changes(
                insertions=tuple(c for c in changes.insertions if c.birth in births),
                brains=tuple(c for c in changes.brains if c.birth in births),
            ),
            wants_snapshot=True,
            from_step=self.state.step,
            from_digest=arrivals.digest if is_whole else held.digest,
            rebuild=Rebuild(encode(arrivals), ()) if is_whole else None,
            part=own,
        )

    def take(self, part: int, result: PartResult) -> None:
        """Take the result of a part."""
        if part == AGAIN:
            self._exchange.take_repeated(result)
            return
        self._exchange.take(part, result)
        self._held[part] = Held(frozenset(result.state.births), result.state.digest)

    def overlap(self) -> bool:
        """Return whether robots must be advanced again before the exchange ends."""
        is_first = not self._exchange.repeated
        overlaps = self._exchange.overlap()
        self.repeats += overlaps and is_first
        return overlaps

    def end(self, parts: int) -> Advance | None:
        """End an exchange without overlaps; begin the next one of the advance.

        Return the whole advance; None if another exchange has begun.
        """
        requested, again = self._requested, self._exchange.repeated
        assert requested is not None
        self._steps = (
            self._least if again else min(2 * self._steps, MOST_TIMES * self._least)
        )
        self._held = {
            part: replace(self._held[part], stale=again & self._held[part].births)
            for part in self._exchange.parts
        }
        result = joined(self._exchange.chosen())
        self.state, self._works = result.state, result.works
        self._boxes = {birth: result.boxes[birth] for birth in result.state.births}
        self._costs = result.costs
        self._changes = Changes()
        before = self._so_far
        self._so_far = (
            result.advance
            if before is None
            else continued(before, result.advance, self._interval_s)
        )
        if self.until == requested.until:
            return self._so_far
        self._divide(parts)
        return None


def _around(x: float, y: float) -> Box:
    return x - REACH_M, y - REACH_M, x + REACH_M, y + REACH_M
