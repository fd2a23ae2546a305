"""World without physics that fulfils the contract of a real one.

Its advances depend on all earlier ones, and its snapshot contains them.
"""

import hashlib
import json
from typing import Self

from schema.experiment.settings import ArenaSettings
from schema.parts import BUILT_IN
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Casualty, Changes, Judgement
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode
from tests.coordinator.arena_world import DT, MATURE, POSE_STEPS, WINDOW, poses
from worker.arena.world import World


class FakeWorld(World):
    """World in which the fitness of robots depends on all earlier advances."""

    made = 0
    """Number of worlds that were made or restored; reset it before use."""

    def __init__(self, settings: ArenaSettings, threads: int = 1) -> None:
        del settings
        assert threads >= 1
        type(self).made += 1
        self.step = 0
        self.born: dict[BirthId, int] = {}
        self.joints: dict[BirthId, int] = {}
        self.windows: dict[BirthId, int] = {}
        self.past = "begun"
        self.is_closed = False

    @classmethod
    def restore(cls, settings: ArenaSettings, data: bytes, threads: int = 1) -> Self:
        world = cls(settings, threads)
        (_, state), *_ = decode(ArenaState, data, len(data)).robots
        world.step, born, world.past = json.loads(state)
        for island, number, step, joints, window in born:
            world.born[BirthId(island, number)] = step
            world.joints[BirthId(island, number)] = joints
            world.windows[BirthId(island, number)] = window
        return world

    @property
    def births(self) -> tuple[BirthId, ...]:
        return tuple(sorted(self.born))

    def apply(self, changes: Changes) -> None:
        for birth in changes.removals:
            del self.born[birth]
        for each in changes.insertions:
            self.born[each.birth] = self.step
            self.windows[each.birth] = self.step + MATURE - WINDOW
            self.joints[each.birth] = sum(
                BUILT_IN[part.kind].shape(part.parameters).joint is not None
                for part in each.robot.parts
            )
        for change in changes.brains:
            if change.restarts_window:
                self.windows[change.birth] = max(self.windows[change.birth], self.step)
            self._record(repr(change))
        self._record(repr((changes.removals, [i.place for i in changes.insertions])))

    def advance(self, until: int, **ways: object) -> Advance:
        assert until > self.step
        assert not self.is_closed
        assert ways.get("work_j") is None
        samples = range(self.step // POSE_STEPS + 1, until // POSE_STEPS + 1)
        self.step = until
        self._record(str(until))
        lost = [one for one in sorted(self.born) if self._chance(one) < 0.01]
        for one in lost:
            del self.born[one]
        living = sorted(self.born)
        self.reached = self.state()
        return Advance(
            step=until,
            digest=self.reached.digest,
            judgements=tuple(map(self._judgement, living)),
            casualties=tuple(Casualty(o, until, "fell", (0.0, 0.0, 0.1)) for o in lost),
            touches=(),
            poses=poses(
                living, *(one * POSE_STEPS * DT for one in samples), joints=self.joints
            ).message(),
        )

    def state(self) -> ArenaState:
        born = [
            (*b, step, self.joints[b], self.windows[b])
            for b, step in sorted(self.born.items())
        ]
        data = json.dumps([self.step, born, self.past]).encode()
        return ArenaState(bytes(32), self.step, ((BirthId(0, 0), data),), (), ())

    def close(self) -> None:
        self.is_closed = True

    def _record(self, event: str) -> None:
        self.past = hashlib.sha256((self.past + event).encode()).hexdigest()

    def _chance(self, birth: BirthId) -> float:
        drawn = hashlib.sha256(f"{self.past}{birth}".encode()).digest()
        return int.from_bytes(drawn[:6], "big") / 2**48

    def _judgement(self, birth: BirthId) -> Judgement:
        age = self.step - self.born[birth]
        fitness = self._chance(birth)
        place = (fitness, -fitness, 0.02)
        is_mature = self.step >= self.windows[birth] + WINDOW
        return Judgement(birth, age * DT, fitness, fitness, fitness, is_mature, place)


class OddWorld(FakeWorld):
    """World on a machine whose results differ."""

    def advance(self, until: int, **ways: object) -> Advance:
        self._record("different")
        return super().advance(until, **ways)
