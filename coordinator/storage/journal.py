"""The journal: all answers and orders of a run, in the order the run acted on them.

All other data is a function of experiment, seed and journal. A record is a number, a
length, a CRC32 of number, length and payload, and the payload, an encoded event.
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

from msgspec.structs import replace

from coordinator.islands.events import Advanced, JournalledEvent
from coordinator.storage.disk import AppendedFile
from schema.errors import MalformedMessage, RunFolderError
from schema.limits import ADVANCE_BYTES
from schema.wire.arena import NO_POSES
from schema.wire.codec import decode, encode

NAME = "journal.bin"
MAGIC = b"revolve journal 2\n"
_EARLIER = b"revolve journal 1\n"

_HEAD = struct.Struct("<QI")
_CHECK = struct.Struct("<I")
_FRAME = _HEAD.size + _CHECK.size
_RECORDS = 1 << 40
"""Upper bound of sequence numbers; a record's number is epoch * _RECORDS + sequence."""
MOST_RECORDED_EPOCH = (1 << 64) // _RECORDS - 1
"""Greatest epoch that the number of a record can hold."""


class Journal(AbstractContextManager["Journal"]):
    """A journal to write; opening it ``dropped`` bytes of an incomplete last record."""

    def __init__(self, path: Path, *, epoch: int = 0, fsync: bool = False) -> None:
        """Open a journal; create it if it is missing.

        The epoch of the writing coordinator is at least that of every record; with
        ``fsync`` records survive power loss, too, not only a kill of the process.

        Raises:
            RunFolderError: the file is no journal, is damaged before intact records,
                or the disk fails.
        """
        self._history, end = read_events(path)
        self._epoch = epoch
        self._sequence = len(self._history)
        self._file = AppendedFile(path, fsync=fsync)
        self.dropped = self._file.size - end
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
        """Write events before the run acts on them: all, or none on failure."""
        first = self._epoch * _RECORDS + self._sequence
        frames: list[bytes] = []
        for number, event in enumerate(events, start=first):
            payload = encode_event(event)
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
    ``data`` are the bytes of the file from ``start`` on.
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
    """Return whether a journal, which must be one, has no complete header yet."""
    if data.startswith(MAGIC):
        return False
    if MAGIC.startswith(data):
        return True
    if data.startswith(_EARLIER):
        raise RunFolderError(
            f"{path}: the journal of a run of Revolve Islands 0.2: use that version"
        )
    raise RunFolderError(f"{path}: not a journal of Revolve Islands")


def check_gap(path: Path, data: bytes, position: Position, start: int = 0) -> None:
    """Raise ``RunFolderError`` if an intact record is anywhere behind the position.

    ``data`` are the bytes of the file from ``start`` on.
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
    """Return the event of a record; ``RunFolderError`` if this version cannot."""
    try:
        event: JournalledEvent = decode(JournalledEvent, payload, ADVANCE_BYTES)
    except MalformedMessage as error:
        raise RunFolderError(
            f"{path}: this version cannot decode an intact record: {error}"
        ) from None
    return event


def read_events(path: Path) -> tuple[list[JournalledEvent], int]:
    """Return the events of a journal that are not void, and their end [bytes].

    Raises:
        RunFolderError: the file is no journal, cannot be read, or is damaged before
            intact records.
    """
    data = read_journal(path)
    if is_empty(path, data):
        return [], 0
    position = Position()
    payloads: list[bytes] = []
    for sequence, payload in read_records(data, position):
        del payloads[sequence:]  # void records
        payloads.append(payload)
    check_gap(path, data, position)
    return [decode_record(path, payload) for payload in payloads], position.end


def read_journal(path: Path) -> bytes:
    """Return the bytes of a journal, empty if it is missing."""
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


def encode_event(event: JournalledEvent) -> bytes:
    """Return an event as bytes; what of an advance is stored elsewhere is left out."""
    if isinstance(event, Advanced):
        advance = replace(event.advance, poses=NO_POSES, snapshot=b"")
        event = replace(event, advance=advance)
    return encode(event)
