"""Presence of the hub and of the coordinator of a watched run."""

from schema.agent.topics import FleetMember

SETTLED_S = 1.0
"""Time without its coordinator after which a run has ended [s]."""
PATIENCE_S = 15.0
"""The same after the hub was gone: the coordinator connects again, too [s]."""


class Presence:
    """Decides whether the coordinator of a run has left, or only the hub is gone.

    Attributes:
        coordinators: those that are there, by the keys of their tokens.
        is_hub_there: whether there is a connection to the hub.
        has_ended: whether the coordinator of the watched run is gone.
    """

    def __init__(self) -> None:
        self.coordinators: dict[str, FleetMember] = {}
        self.is_hub_there = True
        self.has_ended = False
        self._hubs: frozenset[str] = frozenset()
        self._watched: FleetMember | None = None
        self._gone_s: float | None = None
        self._patience_s = SETTLED_S

    def watch(self, token: str) -> None:
        """Note that the coordinator of a token sends the watched run."""
        self._watched = self.coordinators.get(token, self._watched)

    def look(self, hubs: frozenset[str], now_s: float) -> None:
        """Note which hubs are there, by the ids of their sessions."""
        was_there, self.is_hub_there = self.is_hub_there, bool(hubs)
        # A hub that is started again soon has another id.
        if hubs and not (was_there and hubs & self._hubs):
            self._gone_s, self._patience_s = None, PATIENCE_S
        if self._watched is None:
            pass
        elif not hubs:
            # The hub within the coordinator itself does not come back.
            self.has_ended = self.has_ended or self._watched.session in self._hubs
        elif self._watched in self.coordinators.values():
            self._gone_s, self._patience_s = None, SETTLED_S
        elif self._gone_s is None:
            self._gone_s = now_s
        elif now_s - self._gone_s >= self._patience_s:
            self.has_ended = True
        self._hubs = hubs or self._hubs
