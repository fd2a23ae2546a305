"""Exclusive lock on a run or campaign folder.

On a file system without locks, a name on this machine replaces it. A coordinator on
another machine then takes the run over, and its epoch stops the first.
"""

import contextlib
import fcntl
import os
import socket
import time
from hashlib import sha256
from pathlib import Path

from coordinator.storage.disk import storage_errors
from schema.errors import RunFolderError
from schema.limits import printable
from schema.tables.description import make_folder
from schema.tables.segments import warn_once

LOCK = "lock"

# `read_holder` locks the file for an instant, which must not refuse a coordinator.
_RETRY_FOR_S = 0.2
_RETRY_EVERY_S = 0.005
_LONGEST_HOLDER = 200


class FolderLock(contextlib.AbstractContextManager["FolderLock"]):
    """Exclusive lock on a folder; the operating system releases it at a kill."""

    def __init__(self, folder: Path) -> None:
        """Create the folder if it is missing, lock it and write down the holder.

        Raises:
            RunFolderError: another process holds it (named), or the disk fails.
        """
        make_folder(folder)
        with storage_errors(folder):
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC
            self._descriptor = os.open(folder / LOCK, flags, 0o644)
            try:
                self._name = _lock(self._descriptor, folder)
            except BlockingIOError:
                holder = _holder(self._descriptor)
                os.close(self._descriptor)
                raise RunFolderError(
                    f"{folder}: in use by {holder}; stop that process first, or wait "
                    "for it"
                ) from None
        if self._name:
            warn_once(f"{folder}: no file locks; do not resume it on another machine")
        # A full disk must not refuse a coordinator: only messages show the name.
        with contextlib.suppress(OSError):
            os.ftruncate(self._descriptor, 0)
            signature = f"process {os.getpid()} on {socket.gethostname()}"
            os.pwrite(self._descriptor, signature.encode(), 0)

    def close(self) -> None:
        """Release the lock; a second call does nothing."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            # A child process that is just starting may share the descriptor: closing
            # alone would keep the lock until the child replaces its image.
            with contextlib.suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_UN)
            os.close(descriptor)
        if self._name:
            self._name.close()

    def __exit__(self, *_error: object) -> None:
        self.close()


def read_holder(folder: Path) -> str:
    """Return the holder of a folder's lock, "process PID on HOST"; "" if it is free.

    A lock that this user may not read counts as held: whether it is free is unknown.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDONLY | os.O_CLOEXEC)
    except (FileNotFoundError, NotADirectoryError):
        return ""
    except OSError as error:
        return f"another process, perhaps ({LOCK}: {error.strerror})"
    try:
        # Shared: two processes that look at the same time do not see each other.
        name = _take(descriptor, folder, fcntl.LOCK_SH)
        holder = _holder(descriptor)
    except BlockingIOError:
        return _holder(descriptor)
    finally:
        os.close(descriptor)
    if name:
        name.close()
    # Without a lock it is unknown whether a process of another machine still runs.
    return "" if not name or holder.endswith(f" on {socket.gethostname()}") else holder


def _lock(descriptor: int, folder: Path) -> socket.socket | None:
    """Lock exclusively, as ``_take``, and retry for an instant."""
    until_s = time.monotonic() + _RETRY_FOR_S
    while True:
        try:
            return _take(descriptor, folder, fcntl.LOCK_EX)
        except BlockingIOError:
            if time.monotonic() >= until_s:
                raise
            time.sleep(_RETRY_EVERY_S)


def _take(descriptor: int, folder: Path, how: int) -> socket.socket | None:
    """Lock a folder's file, or return the name that replaces the lock."""
    try:
        fcntl.flock(descriptor, how | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        name = socket.socket(socket.AF_UNIX)
        try:
            # On Linux it is no file, and ends with its process.
            name.bind(b"\0revolve" + sha256(bytes(folder.resolve())).digest())
        except OSError:
            name.close()
            raise BlockingIOError from None
        return name
    return None


def _holder(descriptor: int) -> str:
    text = os.pread(descriptor, 500, 0).decode(errors="replace")
    return printable(text, _LONGEST_HOLDER) or "another process"
