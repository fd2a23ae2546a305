"""Messages between coordinators that run groups of islands of one archipelago."""

from typing import Annotated

from msgspec import Meta

from schema.experiment.section import Count
from schema.limits import LONGEST_NAME
from schema.robot.ids import IslandNumber
from schema.wire.codec import Message


class Needed(Message, frozen=True):
    """What an island needs next of an island of another group.

    Attributes:
        source: island that sends migrants.
        target: island that receives them.
        epoch: of the migrants, from 0; all before have arrived.
    """

    source: IslandNumber
    target: IslandNumber
    epoch: Count


class MigrantsRequest(Message, frozen=True):
    """Request of a group for what another one has sent to it.

    Attributes:
        archipelago: name that its groups have in common.
        digest: of what determines the births: document, seed, repeat, number of groups.
        by: number of the group that asks.
        to: number of the group that is asked.
        needed: everything that the islands of the one need of the other; they will
            never need anything else if it is empty.
    """

    archipelago: Annotated[str, Meta(max_length=LONGEST_NAME)]
    digest: bytes
    by: Count
    to: Count
    needed: tuple[Needed, ...]
