"""State of an arena between two advances, and its digest.

A digest is the same however the robots were distributed when they were simulated.
"""

from collections.abc import Collection, Sequence
from hashlib import sha256
from itertools import chain

from msgspec import structs

from schema.experiment.section import Count
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.wire.arena import Casualty
from schema.wire.codec import Message, decode, encode


class ArenaState(Message, frozen=True, array_like=True):
    """State of an arena between two advances.

    Attributes:
        settings: SHA-256 of the arena's settings.
        step: steps since its start.
        robots: birth of each robot, ascending, and its state.
        clusters: robots that are simulated in one model.
        casualties: robots that diverged and are not yet reported by an advance.
    """

    settings: bytes
    step: Count
    robots: tuple[tuple[BirthId, bytes], ...]
    clusters: tuple[tuple[BirthId, ...], ...]
    casualties: tuple[Casualty, ...]

    @property
    def births(self) -> list[BirthId]:
        """The robots, ascending."""
        return [birth for birth, _ in self.robots]

    @property
    def digest(self) -> bytes:
        """SHA-256 of the content, in an order that depends on births and steps only."""
        return sha256(
            encode(
                (
                    self.settings,
                    self.step,
                    [(birth, sha256(data).digest()) for birth, data in self.robots],
                    sorted(self.clusters),
                    sorted(self.casualties, key=lambda lost: (lost.step, lost.birth)),
                )
            )
        ).digest()


def state_digest(snapshot: bytes) -> bytes:
    """Return the digest of the state that a snapshot holds.

    Raises:
        MalformedMessage: no snapshot.
    """
    return decode(ArenaState, snapshot, ADVANCE_BYTES).digest


def states_of(whole: ArenaState, births: Collection[BirthId]) -> ArenaState:
    """Return the state of some robots; those of a cluster stay together."""
    clusters = (tuple(b for b in each if b in births) for each in whole.clusters)
    return structs.replace(
        whole,
        robots=tuple(each for each in whole.robots if each[0] in births),
        clusters=tuple(filter(None, clusters)),
        casualties=(),
    )


def joined_states(parts: Sequence[ArenaState]) -> ArenaState:
    """Return the state of the robots of several parts of an arena."""
    return structs.replace(
        parts[0],
        robots=tuple(sorted(chain.from_iterable(part.robots for part in parts))),
        clusters=tuple(sorted(chain.from_iterable(part.clusters for part in parts))),
    )
