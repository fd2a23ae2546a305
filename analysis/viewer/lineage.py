"""Ancestry graph: the newest births from left to right, at the height of their rank."""

from collections import OrderedDict

from analysis.viewer.entities import AncestryNode, TimePoint
from analysis.viewer.recording import Recording
from schema.robot.ids import BirthId
from schema.wire.updates import Birth, Death, Level

_MOST = 150
"""Births that are shown; more cannot be distinguished or drawn in time."""
_EVERY = 10
"""Births between two drawings: Rerun needs the whole graph each time."""


class Lineage:
    """Ancestry of the newest births, with those that are alive."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._entries: OrderedDict[BirthId, AncestryNode] = OrderedDict()
        self._known: set[BirthId] = set()
        self._latest = TimePoint()
        self._undrawn = 0

    def add(self, one: Birth) -> bool:
        """Add a birth; return whether it is new."""
        if one.birth in self._known:
            return False
        if self._undrawn >= _EVERY:
            self.draw()
        self._entries[one.birth] = AncestryNode(one, len(self._known))
        self._known.add(one.birth)
        if len(self._entries) > _MOST:
            self._entries.popitem(last=False)
        self._latest = TimePoint(one.sim_time_s, one.births)
        self._undrawn += 1
        return True

    def remove(self, gone: Death) -> None:
        """Mark a robot as dead."""
        if gone.birth in self._entries:
            self._entries[gone.birth].is_alive = False

    def keep(self, level: Level) -> None:
        """Mark all robots of an island as dead that are not in its population."""
        members = set(level.members)
        for birth, entry in self._entries.items():
            is_here = birth.island == level.island
            if is_here and entry.birth.births <= level.births:
                entry.is_alive = birth in members

    def draw(self) -> None:
        """Draw the graph if there are new births."""
        if self._undrawn:
            self._undrawn = 0
            self._recording.ancestry(list(self._entries.values()), self._latest)
