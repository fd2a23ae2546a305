"""The journal: every answer that a run was given, in the order it acted on them.

All else is a function of experiment, seed and journal. A record is its number, its
length, a CRC32 of all three, and an ``Entry`` message. A record that a kill cut short
can only be the last; it is dropped, for nobody has acted on it.

A number is that of the coordinator's epoch and that of the record. One that slept
between finding the run its own and writing may write after another has taken the run
over. What it writes is void: the other went on from where it found the journal.
"""

import struct
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self
from zlib import crc32

from coordinator.islands.events import JournalledEvent
from coordinator.storage.disk import AppendedFile
from coordinator.storage.journal_codec import decode_entry, encode_entry
from schema.errors import MalformedMessage, RunFolderError

NAME = "journal.bin"
MAGIC = b"revolve journal 1\n"

_HEAD = struct.Struct("<QI")
_CHECK = struct.Struct("<I")
_FRAME = _HEAD.size + _CHECK.size
_RECORDS = 1 << 40
"""Records of one epoch have numbers below this; epochs count in multiples of it."""


class Journal:
    """An open journal: what it held, and a place for what comes.

    Attributes:
        dropped: bytes of a cut tail that opening took away.
    """

    def __init__(self, path: Path, *, epoch: int = 0, fsync: bool = False) -> None:
        """Open a journal, or begin one.

        Args:
            path: the file.
            epoch: of the coordinator that is to write, not less than any before it.
            fsync: survive power loss, too, and not only the death of the process.

        Raises:
            RunFolderError: not a journal, damage before intact records, or a disk
                that fails.
        """
        data = _read(path)
        payloads, end = _intact(path, data)
        self._history = [_event(path, payload) for payload in payloads]
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
        """Return what it held when it was opened, oldest first; only once."""
        history, self._history = self._history, []
        return history

    def append(self, events: Iterable[JournalledEvent]) -> None:
        """Keep events before anybody acts on them: all, or on failure none.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        sequence = self._sequence
        frames = []
        for event in events:
            number = self._epoch * _RECORDS + sequence
            frames.append(_frame(number, encode_entry(event)))
            sequence += 1
        self._file.append(b"".join(frames))
        self._sequence = sequence

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def is_begun(folder: Path) -> bool:
    """Return whether the journal of a run folder is there and not empty."""
    path = folder / NAME
    return path.exists() and path.stat().st_size > 0


def newest_epoch(folder: Path) -> int:
    """Return the newest epoch in which a run's journal was written, from 0.

    Only of what stands before any damage; to refuse that is for who opens it.

    Raises:
        RunFolderError: it cannot be read.
    """
    data = _read(folder / NAME)
    position, newest = len(MAGIC), 0
    while found := _record_at(data, position):
        newest, position = max(newest, found[0] // _RECORDS), found[1]
    return newest


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error}") from None


def _frame(number: int, payload: bytes) -> bytes:
    head = _HEAD.pack(number, len(payload))
    return head + _CHECK.pack(crc32(payload, crc32(head))) + payload


def _record_at(data: bytes, start: int) -> tuple[int, int] | None:
    """Return number and end of the intact record at ``start``, if any."""
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


def _intact(path: Path, data: bytes) -> tuple[list[bytes], int]:
    """Return the payloads of all that counts, and where the last record ends.

    Raises:
        RunFolderError: not a journal, or damage with intact records behind it.
    """
    if not data.startswith(MAGIC):
        if MAGIC.startswith(data):
            return [], 0
        raise RunFolderError(f"{path}: not a journal of this version of Revolve")
    payloads: list[bytes] = []
    position, newest = len(MAGIC), 0
    while found := _record_at(data, position):
        (epoch, sequence), end = divmod(found[0], _RECORDS), found[1]
        if epoch > newest and sequence <= len(payloads):
            # What was written after this one had read the journal is void.
            newest = epoch
            del payloads[sequence:]
        if epoch == newest:
            if sequence != len(payloads):
                break
            payloads.append(data[position + _FRAME : end])
        elif epoch > newest:
            break
        position = end
    if position < len(data):
        _refuse_gap(path, data, position, len(payloads))
    return payloads, position


def _refuse_gap(path: Path, data: bytes, position: int, sequence: int) -> None:
    """Raise if an intact record stands anywhere behind a damaged place."""
    for start in range(position, len(data) - _FRAME + 1):
        found = _record_at(data, start)
        if found is not None:
            raise RunFolderError(
                f"{path}: damaged at byte {position} (record {sequence}), and record "
                f"{found[0] % _RECORDS} stands intact at byte {start}: put a sound "
                "copy of the file in its place, or give up what follows the damage "
                f"('truncate -s {position} {path}') and resume; what is lost is "
                "computed anew"
            )


def _event(path: Path, payload: bytes) -> JournalledEvent:
    try:
        return decode_entry(payload)
    except MalformedMessage as error:
        raise RunFolderError(
            f"{path}: an intact record that this version cannot read: {error}"
        ) from None
