"""Requests of operators to a coordinator, its replies, and their bytes."""

from collections.abc import Iterable
from typing import Annotated

from msgspec import Meta
from msgspec.structs import replace

from schema.limits import LONGEST_NAME, OPERATOR_REPLY_BYTES, Finite, printable_lines
from schema.robot.ids import BirthId, IslandNumber
from schema.robot.robot import Robot
from schema.wire.codec import Message, decode
from schema.wire.status import Status

MOST_PARENTS = 2


class ListRobots(Message, frozen=True, tag="list"):
    """List the living robots of the arena."""


class GetStatus(Message, frozen=True, tag="status"):
    """Report the progress of all runs."""


class PauseArena(Message, frozen=True, tag="pause"):
    """Pause the arena."""


class ResumeArena(Message, frozen=True, tag="resume"):
    """Resume the arena."""


class SaveSnapshot(Message, frozen=True, tag="snapshot"):
    """Save the state of the arena at the end of the next advance."""


class InsertRobot(Message, frozen=True, tag="insert"):
    """Insert a robot into the arena.

    Attributes:
        robot: body and brain.
        place: of the core in the ground plane, world frame [m]; drawn if None.
        parents: living robots that count as its parents.
    """

    robot: Robot
    place: tuple[Finite, Finite] | None = None
    parents: Annotated[tuple[BirthId, ...], Meta(max_length=MOST_PARENTS)] = ()


class RemoveRobot(Message, frozen=True, tag="remove"):
    """Remove a robot from the arena.

    Attributes:
        birth: id of the robot.
    """

    birth: BirthId


class SetBrain(Message, frozen=True, tag="brain"):
    """Replace the brain of a living robot.

    Attributes:
        birth: of the living robot.
        robot: robot that has the new brain.
    """

    birth: BirthId
    robot: Robot


OperatorAction = (
    ListRobots
    | GetStatus
    | PauseArena
    | ResumeArena
    | SaveSnapshot
    | InsertRobot
    | RemoveRobot
    | SetBrain
)
"""All actions that an operator can request."""


class OperatorRequest(Message, frozen=True):
    """Request of an operator.

    Attributes:
        request_id: unique; a request that arrives twice is carried out once.
        island: number of the arena's island.
        action: what to do.
        run: name of a run folder, or the end of one, which selects one of several runs.
    """

    request_id: Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
    island: IslandNumber
    action: OperatorAction
    run: Annotated[str, Meta(max_length=LONGEST_NAME)] = ""


class ListedRobot(Message, frozen=True):
    """A living robot of an arena, at its last decision.

    Attributes:
        birth: its id.
        rank: in ancestry; 1 without parents, else 1 + the greatest of theirs.
        parents: birth ids of its parents; they may be dead.
        place: of its core in the ground plane, world frame [m].
        age_s: simulated time since its birth [s]; 0 before its first advance.
        fitness: of its last window; None while it is immature.
    """

    birth: BirthId
    rank: int
    parents: tuple[BirthId, ...]
    place: tuple[Finite, Finite]
    age_s: Finite
    fitness: Finite | None


class ArenaListing(Message, frozen=True):
    """The living robots of an arena.

    Attributes:
        sim_time_s: simulated time of its last decision [s].
        is_paused: an operator has paused it.
        births: number of births so far.
        wanted: number of births of the experiment.
        robots: by birth id.
    """

    sim_time_s: Finite
    is_paused: bool
    births: int
    wanted: int
    robots: tuple[ListedRobot, ...]


class OperatorReply(Message, frozen=True):
    """What was done or why not, as text; what was requested.

    Attributes:
        text: for the operator.
        is_refused: nothing was done.
        arena: the living robots, if they were requested.
        effect_s: simulated time at which an order takes effect [s].
        status: of all runs, if it was requested.
        time_s: Unix time of the coordinator's clock, with the status [s].
    """

    text: str
    is_refused: bool = False
    arena: ArenaListing | None = None
    effect_s: Finite | None = None
    status: Status | None = None
    time_s: Finite | None = None


def birth_name(birth: BirthId, island: int) -> str:
    """Return the name of an arena's robot: that of an immigrant has its island."""
    return str(birth.number) if birth.island == island else birth.name


def selected_names(wanted: str, names: Iterable[str]) -> set[str]:
    """Return the names of run folders that a given name selects.

    Args:
        wanted: whole name of a run folder, or the end of one.
        names: names of all run folders.
    """
    known = set(names)
    if wanted in known:
        return {wanted}
    return {name for name in known if name.endswith(wanted)}


def decode_operator_reply(data: bytes) -> OperatorReply:
    """Return the reply of some bytes; its text is safe to print.

    Raises:
        MalformedMessage: not a reply's bytes, too many of them, or a number that is
            not finite.
    """
    reply = decode(OperatorReply, data, OPERATOR_REPLY_BYTES)
    return replace(reply, text=printable_lines(reply.text))
