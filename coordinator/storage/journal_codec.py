"""Events of the journal as Protobuf bytes, and back."""

from coordinator.islands.events import (
    Advanced,
    Asked,
    Audited,
    Commanded,
    Evaluated,
    EvaluationFailed,
    ExternalEvent,
    Insert,
    JournalledEvent,
    Order,
    Outcome,
    Pause,
    Remove,
    ReplaceBrain,
    Resume,
    Vetted,
    VettingFailed,
)
from schema.errors import MalformedMessage
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import BrainChange
from schema.wire.arena_codec import (
    advance_from_message,
    advance_to_message,
    read_brain_change,
    write_brain_change,
)
from schema.wire.codec import (
    evaluation_from_message,
    evaluation_to_message,
    report_from_message,
    write_report,
)
from schema.wire.decoding import parsed
from schema.wire.messages import (
    birth_from_message,
    birth_to_message,
    finite,
)


def encode_entry(event: JournalledEvent) -> bytes:
    """Return an event as bytes; the poses of an advance are left out."""
    return _entry(event).SerializeToString(deterministic=True)


def decode_entry(data: bytes) -> JournalledEvent:
    """Return the event of an entry's bytes.

    Raises:
        MalformedMessage: the bytes are no entry, or it holds no event.
    """
    entry = parsed(data, pb.Entry(), ADVANCE_BYTES)
    match entry.WhichOneof("event"):
        case "audited":
            return _audited(entry.audited)
        case "asked":
            return _asked(entry)
    return _event(entry)


def _entry(event: JournalledEvent) -> pb.Entry:
    match event:
        case Audited(first, second):
            audit = pb.AuditEntry(first=_entry(first), second=_entry(second))
            return pb.Entry(audited=audit)
        case Commanded():
            return pb.Entry(island=event.island, commanded=_command(event))
        case Advanced():
            advance = advance_to_message(event.advance)
            advance.ClearField("poses")
            advanced = pb.AdvanceEntry(
                number=event.number, advance=advance, pose_rows=event.pose_rows
            )
            entry = pb.Entry(island=event.island, advanced=advanced)
        case Asked(birth, number, points):
            values = [value for point in points for value in point]
            asked = pb.LearnerEntry(number=number, points=len(points), values=values)
            return pb.Entry(island=birth.island, birth=birth.number, asked=asked)
        case Vetted() | VettingFailed():
            entry = pb.Entry(attempt=event.attempt)
            entry.island, entry.birth = event.birth
            if isinstance(event, Vetted):
                write_report(event.report, entry.vetted)
            else:
                entry.vetting_failed = event.reason
            return entry
        case Evaluated() | EvaluationFailed():
            entry = pb.Entry(trial=event.trial, requester=event.requester)
            entry.island, entry.birth = event.birth
            if isinstance(event, Evaluated):
                entry.evaluated.CopyFrom(evaluation_to_message(event.evaluation))
            else:
                entry.evaluation_failed = event.reason
    provenance = event.provenance
    entry.provenance.agent = provenance.agent
    entry.provenance.platform = provenance.platform
    entry.provenance.wall_s = provenance.wall_s
    # Present also if all three have their defaults.
    entry.provenance.SetInParent()
    return entry


def _command(event: Commanded) -> pb.Command:
    command, order = (
        pb.Command(command_id=event.command_id, step=event.step),
        event.order,
    )
    match order:
        case Pause():
            command.pause.SetInParent()
        case Resume():
            command.resume.SetInParent()
        case Insert():
            command.insert.genome = order.genome
            if order.place is not None:
                command.insert.has_place = True
                command.insert.x, command.insert.y = order.place
        case Remove():
            command.remove.CopyFrom(birth_to_message(order.birth))
        case ReplaceBrain():
            change = BrainChange(order.birth, order.brain)
            write_brain_change(change, command.replace_brain)
    return command


def _event(entry: pb.Entry) -> ExternalEvent:
    birth = BirthId(entry.island, entry.birth)
    signed = Provenance(
        entry.provenance.agent, entry.provenance.platform, entry.provenance.wall_s
    )
    requester = entry.requester if entry.HasField("requester") else None
    match entry.WhichOneof("event"):
        case "vetted":
            return Vetted(birth, entry.attempt, report_from_message(entry.vetted))
        case "vetting_failed":
            return VettingFailed(birth, entry.attempt, entry.vetting_failed)
        case "evaluated":
            evaluation = evaluation_from_message(entry.evaluated)
            return Evaluated(birth, evaluation, signed, entry.trial, requester)
        case "evaluation_failed":
            reason = entry.evaluation_failed
            return EvaluationFailed(birth, reason, signed, entry.trial, requester)
        case "advanced":
            message = entry.advanced
            advance, rows = advance_from_message(message.advance), message.pose_rows
            return Advanced(entry.island, message.number, advance, rows, signed)
        case "commanded":
            command = entry.commanded
            order = _order(command)
            return Commanded(entry.island, command.command_id, command.step, order)
    raise MalformedMessage("entry: holds no event")


def _asked(entry: pb.Entry) -> Asked:
    message = entry.asked
    count, left = divmod(len(message.values), max(1, message.points))
    if left or not count or not message.points:
        raise MalformedMessage(
            f"entry: {message.points} points must have equally many values, got "
            f"{len(message.values)} values"
        )
    values = [finite(value, "asked.values") for value in message.values]
    rows = zip(*[iter(values)] * count, strict=True)
    birth = BirthId(entry.island, entry.birth)
    return Asked(birth, message.number, tuple(rows))


def _audited(message: pb.AuditEntry) -> Audited:
    first, second = _event(message.first), _event(message.second)
    if not (isinstance(first, Outcome) and isinstance(second, Outcome)):
        raise MalformedMessage("entry: an audit must hold two evaluations")
    return Audited(first, second)


def _order(command: pb.Command) -> Order:
    match command.WhichOneof("order"):
        case "pause":
            return Pause()
        case "resume":
            return Resume()
        case "insert":
            insert = command.insert
            if not insert.has_place:
                return Insert(insert.genome)
            place = finite(insert.x, "insert.x"), finite(insert.y, "insert.y")
            return Insert(insert.genome, place)
        case "remove":
            return Remove(birth_from_message(command.remove))
        case "replace_brain":
            change = read_brain_change(command.replace_brain)
            return ReplaceBrain(change.birth, change.brain)
    raise MalformedMessage("command: holds no order")
