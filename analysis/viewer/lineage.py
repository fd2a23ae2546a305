"""The ancestry as a picture: the newest births in a row, each at its rank."""

from collections import OrderedDict
from dataclasses import dataclass

from analysis.viewer.entities import FamilyTree, TimePoint
from analysis.viewer.recording import Recording
from schema.robot.ids import BirthId
from schema.wire.updates import Birth, Death, Level

_MOST = 150
"""Births that are shown; more are neither seen nor drawn in time."""
_EVERY = 10
"""A graph is told whole, so only every so many births."""


@dataclass(slots=True)
class _Entry:
    birth: Birth
    order: int
    is_alive: bool = True


class Lineage:
    """Who descends from whom, as far as it is shown."""

    def __init__(self, recording: Recording) -> None:
        """Know nobody yet."""
        self._recording = recording
        self._entries: OrderedDict[BirthId, _Entry] = OrderedDict()
        self._known: set[BirthId] = set()
        self._latest = TimePoint()
        self._undrawn = 0

    def add(self, one: Birth) -> bool:
        """Add a birth; return whether it is new."""
        if one.birth in self._known:
            return False
        if self._undrawn >= _EVERY:
            self.draw()
        self._entries[one.birth] = _Entry(one, len(self._known))
        self._known.add(one.birth)
        if len(self._entries) > _MOST:
            self._entries.popitem(last=False)
        self._latest = TimePoint(one.sim_time_s, one.births)
        self._undrawn += 1
        return True

    def remove(self, gone: Death) -> None:
        """Note that somebody does not live any more."""
        self._die(gone.birth)

    def keep(self, level: Level) -> None:
        """Note that of an island's births only those of a level live."""
        members = set(level.members)
        for birth, entry in self._entries.items():
            is_here = birth.island == level.island
            if is_here and entry.birth.births <= level.births:
                entry.is_alive = birth in members

    def draw(self) -> None:
        """Draw what is new."""
        if not self._undrawn:
            return
        self._undrawn = 0
        first = next(iter(self._entries.values())).order
        self._recording.ancestry(
            [
                FamilyTree(
                    birth,
                    entry.order - first,
                    entry.birth.rank,
                    entry.birth.parents,
                    entry.is_alive,
                )
                for birth, entry in self._entries.items()
            ],
            self._latest,
        )

    def _die(self, birth: BirthId) -> None:
        if birth in self._entries:
            self._entries[birth].is_alive = False
