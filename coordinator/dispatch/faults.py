"""Counts of what peers sent and the coordinator did not use, by kind and peer."""

from collections.abc import Mapping
from typing import Literal

from schema.limits import LONGEST_REASON, MOST_PEERS, printable
from schema.wire.status import PeerFault

FaultKind = Literal[
    "malformed", "refused", "late", "foreign", "fenced", "cancelled", "death", "crowd",
    "migrants",
]  # fmt: skip

MEANINGS: Mapping[FaultKind, str] = {
    "malformed": "malformed messages, dropped",
    "refused": "cannot do jobs, or may not take part",
    "late": "answers to jobs that were already done or withdrawn, dropped",
    "foreign": "replies by another process in the agent's name, dropped",
    "fenced": "jobs refused for a forged epoch; no other coordinator has the run",
    "cancelled": "jobs cancelled by another process",
    "death": "crashes reported that did not happen, dropped",
    "crowd": "tokens or queries beyond the limit, dropped",
    "migrants": "migrants that cannot be those of the archipelago, dropped",
}
OTHERS = "other peers"


class PeerFaults:
    """Counts by kind and peer, and a line for the user when one begins.

    Each kind names a limited number of peers and counts the others together, so that
    peers with many names need no more memory and no more lines.
    """

    def __init__(self) -> None:
        self._counts: dict[tuple[FaultKind, str], int] = {}
        self._lines: list[str] = []

    def note(self, kind: FaultKind, peer: str, detail: str = "") -> None:
        """Count a fault.

        ``peer``: name of the peer; any text. ``detail``: what came, for the line that
        is written the first time; any text.
        """
        key = (kind, printable(peer))
        if key not in self._counts:
            if sum(known == kind for known, _ in self._counts) >= MOST_PEERS:
                key = (kind, OTHERS)
            if key not in self._counts:
                self._counts[key] = 0
                # A late answer is no fault: an overdue job was given out twice.
                if kind != "late":
                    self._lines.append(_first_line(key, detail))
        self._counts[key] += 1

    def lines(self) -> list[str]:
        """Return the lines about faults that have begun since the last call.

        Late answers have none; ``counts`` has them.
        """
        lines, self._lines = self._lines, []
        return lines

    def total(self, kind: FaultKind) -> int:
        """Return how many faults of a kind there were."""
        return sum(count for (known, _), count in self._counts.items() if known == kind)

    @property
    def counts(self) -> tuple[PeerFault, ...]:
        """All counts, by kind and peer."""
        found = sorted(self._counts.items())
        return tuple(PeerFault(kind, peer, count) for (kind, peer), count in found)


def _first_line(key: tuple[FaultKind, str], detail: str) -> str:
    kind, peer = key
    cause = f" ({printable(detail, LONGEST_REASON)})" if detail else ""
    return f"{kind}: {peer}: {MEANINGS[kind]}{cause}; more of them are only counted"
