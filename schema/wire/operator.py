"""What an operator asks of a coordinator's arenas, as bytes."""

from dataclasses import dataclass

from schema.errors import MalformedMessage
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire import revolve_pb2 as pb
from schema.wire.arena_messages import birth_from_message, birth_to_message
from schema.wire.messages import finite, parsed, robot_from_message, robot_to_message
from schema.wire.status import Status, status_from_message, status_to_message


@dataclass(frozen=True, slots=True)
class ListWish:
    """Tell who lives in the arena."""


@dataclass(frozen=True, slots=True)
class StatusWish:
    """Tell how far all runs are."""


@dataclass(frozen=True, slots=True)
class PauseWish:
    """Let it stand still."""


@dataclass(frozen=True, slots=True)
class ResumeWish:
    """Let it go on."""


@dataclass(frozen=True, slots=True)
class SnapshotWish:
    """Keep its state at the end of the next advance."""


@dataclass(frozen=True, slots=True)
class InsertWish:
    """Put a robot in; ``place`` [m] is drawn if None."""

    robot: Robot
    place: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class RemoveWish:
    """Take a robot out."""

    birth: BirthId


@dataclass(frozen=True, slots=True)
class BrainWish:
    """Give a robot the brain of another one."""

    birth: BirthId
    robot: Robot


Wish = (
    ListWish
    | StatusWish
    | PauseWish
    | ResumeWish
    | SnapshotWish
    | InsertWish
    | RemoveWish
    | BrainWish
)
"""What an operator may ask for."""

_PLAIN: dict[str | None, Wish] = {
    "list": ListWish(),
    "status": StatusWish(),
    "pause": PauseWish(),
    "resume": ResumeWish(),
    "snapshot": SnapshotWish(),
}


@dataclass(frozen=True, slots=True)
class OperatorRequest:
    """A wish of an operator.

    Attributes:
        request_id: unique; a request that comes twice is carried out once.
        island: whose arena.
        wish: what is to be done.
        run: whose; the end of its folder's path, if the coordinator has several.
    """

    request_id: str
    island: int
    wish: Wish
    run: str = ""


@dataclass(frozen=True, slots=True)
class OperatorReply:
    """What was done, or why not, in words; and the status that was wished for."""

    text: str
    is_refused: bool = False
    status: Status | None = None


def encode_operator_request(request: OperatorRequest) -> bytes:
    """Return the bytes of an operator's request."""
    message = pb.OperatorRequest(
        request_id=request.request_id, island=request.island, run=request.run
    )
    match request.wish:
        case ListWish():
            message.list.SetInParent()
        case StatusWish():
            message.status.SetInParent()
        case PauseWish():
            message.pause.SetInParent()
        case ResumeWish():
            message.resume.SetInParent()
        case SnapshotWish():
            message.snapshot.SetInParent()
        case InsertWish(robot=robot, place=place):
            message.insert.robot.CopyFrom(robot_to_message(robot))
            if place is not None:
                message.insert.has_place = True
                message.insert.x, message.insert.y = place
        case RemoveWish(birth=birth):
            message.remove.CopyFrom(birth_to_message(birth))
        case BrainWish(birth=birth, robot=robot):
            message.replace_brain.birth.CopyFrom(birth_to_message(birth))
            message.replace_brain.robot.CopyFrom(robot_to_message(robot))
    return message.SerializeToString(deterministic=True)


def decode_operator_request(data: bytes) -> OperatorRequest:
    """Return the request of some bytes.

    Raises:
        MalformedMessage: not a request's bytes, no name or no wish in it, a robot
            that breaks its rules, a place that is none.
    """
    return _request(parsed(data, pb.OperatorRequest()))


def encode_operator_reply(reply: OperatorReply) -> bytes:
    """Return the bytes of a reply."""
    message = pb.OperatorReply(text=reply.text, is_refused=reply.is_refused)
    if reply.status is not None:
        message.status.CopyFrom(status_to_message(reply.status))
    return message.SerializeToString(deterministic=True)


def decode_operator_reply(data: bytes) -> OperatorReply:
    """Return the reply of some bytes.

    Raises:
        MalformedMessage: not a reply's bytes, or a number that is not finite.
    """
    return _reply(parsed(data, pb.OperatorReply()))


def _reply(message: pb.OperatorReply) -> OperatorReply:
    status = None
    if message.HasField("status"):
        status = status_from_message(message.status)
    return OperatorReply(message.text, message.is_refused, status)


def _request(message: pb.OperatorRequest) -> OperatorRequest:
    if not message.request_id:
        raise MalformedMessage("OperatorRequest: has no request_id")
    return OperatorRequest(
        message.request_id, message.island, _wish(message), message.run
    )


def _wish(message: pb.OperatorRequest) -> Wish:
    kind = message.WhichOneof("wish")
    if kind in _PLAIN:
        return _PLAIN[kind]
    if kind == "insert":
        return _insertion(message.insert)
    if kind == "remove":
        return RemoveWish(birth_from_message(message.remove))
    if kind == "replace_brain":
        told = message.replace_brain
        return BrainWish(birth_from_message(told.birth), robot_from_message(told.robot))
    raise MalformedMessage("OperatorRequest: holds no wish")


def _insertion(message: pb.PlacedRobot) -> InsertWish:
    robot = robot_from_message(message.robot)
    if not message.has_place:
        return InsertWish(robot)
    place = finite(message.x, "insert.x"), finite(message.y, "insert.y")
    return InsertWish(robot, place)
