"""Durable files: appended or replaced as a whole, with clear errors on a full disk."""

import contextlib
import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from schema.errors import RunFolderError
from schema.tables.replacement import replace_file, sync_folder

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class AppendedFile:
    """File that grows by whole pieces to a ``size`` [bytes].

    Writes are unbuffered: an appended piece survives a kill of this process, and with
    ``fsync`` also a power loss.
    """

    def __init__(self, path: Path, *, fsync: bool = False) -> None:
        """Open a file for appending; create it if it is missing."""
        self.path = path
        self._fsync = fsync
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
        with storage_errors(path):
            self._descriptor = os.open(path, flags, 0o644)
            self.size = os.fstat(self._descriptor).st_size
            if fsync:
                sync_folder(path.parent)

    def append(self, piece: bytes | memoryview) -> None:
        """Append a piece; remove it again if a part of it cannot be written.

        It stays if another process has appended to the file meanwhile.
        """
        rest = memoryview(piece)
        with storage_errors(self.path):
            # Read again: a process that replaced this one may have appended.
            self.size = os.fstat(self._descriptor).st_size
            try:
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
                if self._fsync:
                    os.fsync(self._descriptor)
            except OSError:
                with contextlib.suppress(OSError):
                    end = self.size + len(piece) - len(rest)
                    if os.fstat(self._descriptor).st_size == end:
                        self.cut(self.size)
                raise
        self.size += len(piece)

    def cut(self, size: int) -> None:
        """Cut the file to ``size`` bytes; close it if that fails."""
        try:
            os.ftruncate(self._descriptor, size)
        except OSError:
            self.close()
        self.size = size

    def close(self) -> None:
        """Close the file; later calls of ``append`` fail."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(descriptor)


def replace_durably(path: Path, write: Callable[[Path], object]) -> None:
    """Create or replace a file as ``replace_file`` does; create its folder."""
    with storage_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, write)


def replace_bytes(path: Path, data: bytes) -> None:
    """Create or replace a file as ``replace_durably`` does."""
    replace_durably(path, lambda file: file.write_bytes(data))


def replace_text(path: Path, text: str) -> None:
    """Create or replace a UTF-8 file as ``replace_durably`` does."""
    replace_bytes(path, text.encode())


@contextlib.contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """Raise the errors of a failed write as errors for the user."""
    try:
        yield
    except OSError as error:
        why = error.strerror or str(error)
        message = f"{path}: cannot be written: {why}"
        if error.errno in _FULL:
            message = (
                f"{path}: disk full ({why}); all recorded data is intact: free some "
                "space and resume the run"
            )
        raise RunFolderError(message) from None
