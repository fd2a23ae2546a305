"""Checksums of tables: of segments in a file beside each, of Parquet in run.json.

A segment ``births-000.arrows`` has the file ``births-000.sums`` beside it: ``MAGIC``,
then one record per Arrow message of the segment, that of the schema included. A record
holds the end of the message in the segment, the CRC32 of the segment's bytes since the
end before, and the CRC32 of these two fields. The record is written after its message:
a message without a record does not count.
"""

import struct
from collections.abc import Iterator
from hashlib import file_digest
from pathlib import Path
from zlib import crc32

import msgspec
import pyarrow as pa

from schema.errors import RunFolderError
from schema.limits import MOST_DESCRIPTION
from schema.tables.description import DETAILS, read_small

MAGIC = b"revolve sums 1\n\0"

FIELDS = struct.Struct("<QI")
"""End of a message and CRC32 of its bytes, in a record."""
CHECK = struct.Struct("<I")
"""CRC32 of these two, behind them."""
_RECORD = FIELDS.size + CHECK.size


class Damaged(Exception):  # noqa: N818 - reads as what it says
    """A file whose bytes, from ``byte`` on, are not those that were written."""

    def __init__(self, path: Path, byte: int, what: str) -> None:
        super().__init__(f"{path}: damaged at byte {byte}: {what}")
        self.byte = byte


class _Sealed(msgspec.Struct, frozen=True):
    digests: dict[str, str] = {}


def read_digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each finished table, by name, that ``run.json`` has.

    They are read even if the rest of the file is damaged; runs of 0.1 have none.
    """
    try:
        data = read_small(folder / DETAILS, MOST_DESCRIPTION)
        return msgspec.json.decode(data, type=_Sealed).digests
    except (OSError, RunFolderError, ValueError, RecursionError):
        return {}


def sums_path(segment: Path) -> Path:
    """Return the path of the checksums of a segment."""
    return segment.with_suffix(".sums")


def sums_size(messages: int) -> int:
    """Return the length of the checksums of so many messages [bytes]."""
    return len(MAGIC) + messages * _RECORD


def sound_messages(segment: Path, sums: bytes) -> Iterator[tuple[int, pa.Buffer]]:
    """Yield end and bytes of each message of a segment, up to the first damage.

    Bytes behind the last record are a cut write: they are no damage. ``sums`` is the
    content of the file with its checksums, read before the segment is.

    Raises:
        Damaged: after the last sound message.
        OSError: the disk fails.
    """
    start = 0
    for end, check in _records(segment, sums):
        if not start:
            file = _opened(segment)
        if end <= start:
            raise Damaged(sums_path(segment), 0, "its records are not in order")
        message = file.read_buffer(end - start)
        if message.size < end - start:
            raise Damaged(segment, start + message.size, f"must have {end} bytes")
        if crc32(message) != check:
            raise Damaged(segment, start, f"wrong checksum of bytes {start} to {end}")
        yield end, message
        start = end


def _opened(segment: Path) -> pa.OSFile:
    try:
        return pa.OSFile(str(segment))
    except FileNotFoundError:
        raise Damaged(segment, 0, "the file is missing") from None


def _records(segment: Path, sums: bytes) -> Iterator[tuple[int, int]]:
    """Yield end and CRC32 of each message; an incomplete last record is a cut write."""
    path = sums_path(segment)
    if not sums.startswith(MAGIC):
        # A kill while both files were made: the segment gets its first bytes after.
        is_begun = segment.exists() and segment.stat().st_size > 0
        if MAGIC.startswith(sums) and not is_begun:
            return
        raise Damaged(path, 0, "no checksums of this version of Revolve")
    for at in range(len(MAGIC), len(sums) - _RECORD + 1, _RECORD):
        fields = sums[at : at + FIELDS.size]
        if CHECK.unpack_from(sums, at + FIELDS.size) != (crc32(fields),):
            raise Damaged(path, at, "wrong checksum of a record")
        yield FIELDS.unpack(fields)


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()
