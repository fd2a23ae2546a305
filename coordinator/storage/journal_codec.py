"""Events of the journal as Protobuf bytes, and back."""

from coordinator.islands.events import (
    Advanced,
    Audited,
    Commanded,
    Evaluated,
    EvaluationFailed,
    ExternalEvent,
    Insert,
    JournalledEvent,
    Order,
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
from schema.wire.arena_messages import (
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
from schema.wire.messages import (
    birth_from_message,
    birth_to_message,
    finite,
    genome_from_message,
    genome_to_message,
)
from schema.wire.parsing import parsed


def encode_entry(event: JournalledEvent) -> bytes:
    """Return an event as bytes; the poses of an advance are left out."""
    entry = pb.Entry()
    match event:
        case Advanced():
            entry.island = event.island
            _write_advance(event, entry.advanced)
            _sign(entry, event.provenance)
        case Commanded():
            entry.island = event.island
            entry.commanded.command_id = event.command_id
            entry.commanded.step = event.step
            _write_order(event.order, entry.commanded)
        case Audited():
            entry.audited.first.ParseFromString(encode_entry(event.first))
            entry.audited.second.ParseFromString(encode_entry(event.second))
        case _:
            entry.island, entry.birth = event.birth
            _write_answer(event, entry)
    return entry.SerializeToString(deterministic=True)


def decode_entry(data: bytes) -> JournalledEvent:
    """Return the event of an entry's bytes.

    Raises:
        MalformedMessage: the bytes are no entry, or it holds no event.
    """
    return _journalled(parsed(data, pb.Entry(), ADVANCE_BYTES))


def _journalled(entry: pb.Entry) -> JournalledEvent:
    is_audit = entry.WhichOneof("event") == "audited"
    return _audited(entry.audited) if is_audit else _event(entry)


def _write_answer(
    event: Vetted | VettingFailed | Evaluated | EvaluationFailed, entry: pb.Entry
) -> None:
    if isinstance(event, Vetted | VettingFailed):
        entry.attempt = event.attempt
    else:
        entry.trial = event.trial
        if event.requester is not None:
            entry.requester = event.requester
        _sign(entry, event.provenance)
    match event:
        case Vetted():
            write_report(event.report, entry.vetted)
        case VettingFailed():
            entry.vetting_failed = event.reason
        case Evaluated():
            entry.evaluated.CopyFrom(evaluation_to_message(event.evaluation))
        case EvaluationFailed():
            entry.evaluation_failed = event.reason


def _write_advance(event: Advanced, entry: pb.AdvanceEntry) -> None:
    entry.number = event.number
    entry.pose_rows = event.pose_rows
    entry.advance.CopyFrom(advance_to_message(event.advance))
    entry.advance.ClearField("poses")


def _write_order(order: Order, command: pb.Command) -> None:
    match order:
        case Pause():
            command.pause.SetInParent()
        case Resume():
            command.resume.SetInParent()
        case Insert():
            command.insert.genome.CopyFrom(genome_to_message(order.genome))
            if order.place is not None:
                command.insert.has_place = True
                command.insert.x, command.insert.y = order.place
        case Remove():
            command.remove.CopyFrom(birth_to_message(order.birth))
        case ReplaceBrain():
            change = BrainChange(order.birth, order.brain)
            write_brain_change(change, command.replace_brain)


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
            advance = advance_from_message(message.advance)
            return Advanced(
                entry.island, message.number, advance, message.pose_rows, signed
            )
        case "commanded":
            command = entry.commanded
            order = _order(command)
            return Commanded(entry.island, command.command_id, command.step, order)
    raise MalformedMessage("entry: holds no event")


def _audited(message: pb.AuditEntry) -> Audited:
    first, second = _event(message.first), _event(message.second)
    kinds = Evaluated | EvaluationFailed
    if not (isinstance(first, kinds) and isinstance(second, kinds)):
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
            genome = genome_from_message(insert.genome)
            if not insert.has_place:
                return Insert(genome)
            place = finite(insert.x, "insert.x"), finite(insert.y, "insert.y")
            return Insert(genome, place)
        case "remove":
            return Remove(birth_from_message(command.remove))
        case "replace_brain":
            change = read_brain_change(command.replace_brain)
            return ReplaceBrain(change.birth, change.brain)
    raise MalformedMessage("command: holds no order")


def _sign(entry: pb.Entry, provenance: Provenance) -> None:
    signed = entry.provenance
    signed.agent = provenance.agent
    signed.platform = provenance.platform
    signed.wall_s = provenance.wall_s
