"""The journal: all answers and orders of a run, in the order the run acted on them.

All other data is a function of experiment, seed and journal. A record is a number, a
length, a CRC32 of number, length and payload, and the payload, an ``Entry`` message.
Only the last record can be incomplete after a kill; opening the journal drops it, which
is safe because the run never acted on it.

A number combines the coordinator's epoch and the sequence number of the record. A
coordinator that stalls between checking its epoch and writing may write after a later
one has taken over the run. Its records are void: the later coordinator continued from
the records that it found.
"""

import shlex
import struct
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from zlib import crc32

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
from coordinator.storage.disk import AppendedFile
from schema.errors import MalformedMessage, RunFolderError
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
from schema.wire.messages import birth_from_message, birth_to_message, finite

NAME = "journal.bin"
MAGIC = b"revolve journal 1\n"

_HEAD = struct.Struct("<QI")
_CHECK = struct.Struct("<I")
_FRAME = _HEAD.size + _CHECK.size
_RECORDS = 1 << 40
"""Upper bound of sequence numbers; a record's number is epoch * _RECORDS + sequence."""
MOST_RECORDED_EPOCH = (1 << 64) // _RECORDS - 1
"""Greatest epoch that the number of a record can hold."""


class Journal(AbstractContextManager["Journal"]):
    """A journal that is open for writing.

    Attributes:
        dropped: bytes of an incomplete last record that opening removed.
    """

    def __init__(self, path: Path, *, epoch: int = 0, fsync: bool = False) -> None:
        """Open a journal; create it if it is missing.

        Args:
            path: the file.
            epoch: epoch of the writing coordinator, at least that of every record.
            fsync: survive power loss, too, not only a kill of the process.

        Raises:
            RunFolderError: the file is no journal, is damaged before intact records,
                or the disk fails.
        """
        data = read_journal(path)
        end = 0
        payloads: list[bytes] = []
        if not is_empty(path, data):
            position = Position()
            for sequence, payload in read_records(data, position):
                del payloads[sequence:]  # void records
                payloads.append(payload)
            check_gap(path, data, position)
            end = position.end
        self._history = [decode_record(path, payload) for payload in payloads]
        self._epoch = epoch
        self._sequence = len(payloads)
        self._file = AppendedFile(path, fsync=fsync)
        self.dropped = len(data) - end
        if self.dropped:
            self._file.cut(end)
        if not end:
            self._file.append(MAGIC)

    @classmethod
    def open(cls, folder: Path, *, epoch: int = 0, fsync: bool = False) -> Self:
        """Open the journal of a run folder."""
        return cls(folder / NAME, epoch=epoch, fsync=fsync)

    def replay(self) -> list[JournalledEvent]:
        """Return the events found at opening, oldest first; empty when called again."""
        history, self._history = self._history, []
        return history

    def append(self, events: Iterable[JournalledEvent]) -> None:
        """Write events before the run acts on them: all, or none on failure.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        first = self._epoch * _RECORDS + self._sequence
        frames: list[bytes] = []
        for number, event in enumerate(events, start=first):
            payload = encode_entry(event)
            head = _HEAD.pack(number, len(payload))
            frames.append(head + _CHECK.pack(crc32(payload, crc32(head))) + payload)
        self._file.append(b"".join(frames))
        self._sequence += len(frames)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __exit__(self, *_error: object) -> None:
        self.close()


@dataclass(slots=True)
class Position:
    """Position of a reader in a journal.

    Attributes:
        end: end of the last intact record, counted from the start of the file [bytes].
        records: number of records that are not void.
        epoch: newest epoch so far.
    """

    end: int = len(MAGIC)
    records: int = 0
    epoch: int = 0


def read_records(
    data: bytes, position: Position, start: int = 0
) -> Iterator[tuple[int, bytes]]:
    """Yield sequence number and payload of intact records; advance the position.

    A sequence number below ``position.records`` makes the records from it on void.

    Args:
        data: bytes of the file from ``start`` on.
        position: position in the file, at least ``start``.
        start: where the bytes begin in the file.
    """
    while found := _record_at(data, position.end - start):
        (epoch, sequence), end = divmod(found[0], _RECORDS), found[1]
        begin = position.end - start + _FRAME
        if epoch > position.epoch and sequence <= position.records:
            position.epoch, position.records = epoch, sequence
        is_void = epoch < position.epoch
        if not is_void and (epoch, sequence) != (position.epoch, position.records):
            return
        position.end = start + end
        if not is_void:
            position.records += 1
            yield sequence, data[begin:end]


def is_begun(folder: Path) -> bool:
    """Return whether a run folder has a journal that is not empty."""
    path = folder / NAME
    return path.exists() and path.stat().st_size > 0


def is_empty(path: Path, data: bytes) -> bool:
    """Return whether a journal has no complete header yet.

    Args:
        path: the file, for the message.
        data: its first bytes, as many as the header has or more.

    Raises:
        RunFolderError: the file is no journal.
    """
    if data.startswith(MAGIC):
        return False
    if MAGIC.startswith(data):
        return True
    raise RunFolderError(f"{path}: not a journal of this version of Revolve")


def check_gap(path: Path, data: bytes, position: Position, start: int = 0) -> None:
    """Raise if an intact record stands anywhere behind the position.

    Args:
        path: the file, for the message.
        data: bytes of the file from ``start`` on.
        position: behind the last intact record.
        start: where the bytes begin in the file.

    Raises:
        RunFolderError: the bytes at the position are damaged.
    """
    for offset in range(position.end - start, len(data) - _FRAME + 1):
        if found := _record_at(data, offset):
            raise RunFolderError(
                f"{path}: damaged at byte {position.end} (record {position.records}), "
                f"but record {found[0] % _RECORDS} is intact at byte {start + offset}: "
                "restore a sound copy of the file, or give up everything behind the "
                f"damage ('truncate -s {position.end} {shlex.quote(str(path))}') and "
                "resume; lost results are computed again"
            )


def decode_record(path: Path, payload: bytes) -> JournalledEvent:
    """Return the event of a record.

    Args:
        path: the journal, for the message.
        payload: of an intact record.

    Raises:
        RunFolderError: this version cannot decode it.
    """
    try:
        return decode_entry(payload)
    except MalformedMessage as error:
        raise RunFolderError(
            f"{path}: this version cannot decode an intact record: {error}"
        ) from None


def read_journal(path: Path) -> bytes:
    """Return the bytes of a journal, empty if it is missing.

    Raises:
        RunFolderError: it cannot be read.
    """
    try:
        return path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error}") from None


def _record_at(data: bytes, start: int) -> tuple[int, int] | None:
    """Return number and end of the intact record at ``start``, if there is one."""
    begin = start + _FRAME
    if begin > len(data):
        return None
    number, length = _HEAD.unpack_from(data, start)
    end: int = begin + length
    if end > len(data):
        return None
    head = data[start : start + _HEAD.size]
    (check,) = _CHECK.unpack_from(data, start + _HEAD.size)
    if crc32(data[begin:end], crc32(head)) != check:
        return None
    return number, end


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
    command = pb.Command(command_id=event.command_id, step=event.step)
    match order := event.order:
        case Pause():
            command.pause.SetInParent()
        case Resume():
            command.resume.SetInParent()
        case Insert():
            command.insert.genome = order.genome
            command.insert.prevents_extinction = order.prevents_extinction
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
    return Asked(BirthId(entry.island, entry.birth), message.number, tuple(rows))


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
            place = None
            if insert.has_place:
                place = finite(insert.x, "insert.x"), finite(insert.y, "insert.y")
            return Insert(insert.genome, place, insert.prevents_extinction)
        case "remove":
            return Remove(birth_from_message(command.remove))
        case "replace_brain":
            change = read_brain_change(command.replace_brain)
            return ReplaceBrain(change.birth, change.brain)
    raise MalformedMessage("command: holds no order")
