"""Files that survive a kill, and say so plainly when the disk is full."""

import contextlib
import errno
import os
from collections.abc import Callable
from pathlib import Path

from schema.errors import RunFolderError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class AppendedFile:
    """A file that only grows, by whole pieces or not at all.

    Unbuffered: what ``append`` took survives the death of this process; with
    ``fsync`` also that of the machine.

    Attributes:
        path: where it is.
        size: its length [bytes].
    """

    def __init__(self, path: Path, *, fsync: bool = False) -> None:
        """Open a file at its end; a file that is not there is made.

        Raises:
            RunFolderError: it cannot be opened.
        """
        self.path = path
        self._fsync = fsync
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
        try:
            self._descriptor = os.open(path, flags, 0o644)
            self.size = os.fstat(self._descriptor).st_size
            if fsync:
                sync_folder(path.parent)
        except OSError as error:
            raise storage_error(path, error) from None

    def append(self, piece: bytes) -> None:
        """Add a piece at the end; on any failure nothing of it stays.

        Unless somebody else has written behind it: what they wrote stays.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        rest = memoryview(piece)
        try:
            # Not as it is remembered: whoever replaced this process may have written.
            self.size = os.fstat(self._descriptor).st_size
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
            if self._fsync:
                os.fsync(self._descriptor)
        except OSError as error:
            self._take_back(len(piece) - len(rest))
            raise storage_error(self.path, error) from None
        self.size += len(piece)

    def _take_back(self, written: int) -> None:
        """Drop what was written of a piece, if it is the last in the file."""
        with contextlib.suppress(OSError):
            if os.fstat(self._descriptor).st_size == self.size + written:
                self.cut(self.size)

    def cut(self, size: int) -> None:
        """Drop everything from ``size`` on; a file that will not be cut is closed."""
        try:
            os.ftruncate(self._descriptor, size)
        except OSError:
            self.close()
        self.size = size

    def close(self) -> None:
        """Close the file; whatever is appended later fails."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(descriptor)


def replace_durably(path: Path, write: Callable[[Path], object]) -> None:
    """Make a file appear at once and whole, even if power fails.

    Args:
        path: its name; a file that is there is replaced.
        write: writes the content to the path that it is given.

    Raises:
        RunFolderError: the disk is full or failed; the old file still stands.
    """
    temporary = path.with_name(f".{path.name}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(temporary)
        descriptor = os.open(temporary, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        temporary.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise storage_error(path, error) from None


def sync_folder(folder: Path) -> None:
    """Make names in a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def storage_error(path: Path, error: OSError) -> RunFolderError:
    """Return what a failed write means to the user."""
    why = error.strerror or str(error)
    if error.errno in _FULL:
        return RunFolderError(
            f"{path}: disk full ({why}); nothing recorded before is lost: "
            "resume the run when there is space"
        )
    return RunFolderError(f"{path}: cannot be written: {why}")
