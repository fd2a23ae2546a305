"""Snapshots of arenas in a run folder; the newest of each shard is kept.

In an archipelago that of before the first end of an island is kept, too.

``snapshots/island-N-STEP.bin`` is complete or absent. A snapshot is written before the
journal record of its step; the previous snapshot is removed after that record. A
snapshot whose step is not in the journal (the process was killed between the two
writes) is ignored and overwritten. On another platform the state at that step, and
therefore its digest, may differ.
"""

import re
from pathlib import Path

from coordinator.storage.disk import replace_bytes, storage_errors
from schema.errors import MalformedMessage, RunFolderError, unreadable
from schema.wire.arena_state import state_digest

FOLDER = "snapshots"

_NAME = re.compile(r"island-\d+-(\d+)\.bin")


class Snapshots:
    """Snapshots of a run folder that this process has locked, or only reads."""

    def __init__(self, folder: Path, *, until: int | None = None) -> None:
        """Open the snapshots of a run folder.

        ``until`` is the last step whose snapshot counts, for a process that only reads:
        it removes none; None if this process has locked the folder.
        """
        self._folder = folder / FOLDER
        self._until = until

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        """Return whether there is a snapshot of a shard's step with this digest."""
        is_later = self._until is not None and step > self._until
        if is_later or not self._path(shard, step).exists():
            return False
        try:
            return state_digest(self.read(shard, step)) == digest
        except MalformedMessage:
            return False

    def write(self, shard: int, step: int, data: bytes) -> None:
        """Write the state of a shard at a step durably."""
        replace_bytes(self._path(shard, step), data)

    def read(self, shard: int, step: int) -> bytes:
        """Return the state of a shard at a step; ``RunFolderError`` without one."""
        path = self._path(shard, step)
        try:
            return path.read_bytes()
        except FileNotFoundError:
            raise RunFolderError(
                f"{path}: is missing: resume; its state is computed again"
            ) from None
        except OSError as error:
            raise RunFolderError(
                f"{path}: {unreadable(error)}: remove it and resume; "
                "its state is computed again"
            ) from None

    def drop_before(self, shard: int, step: int, kept: int = 0) -> None:
        """Remove a shard's snapshots before a step but ``kept``; none if read only."""
        if self._until is not None:
            return
        with storage_errors(self._folder):
            for path in self._folder.glob(f"island-{shard}-*.bin"):
                match = _NAME.fullmatch(path.name)
                if match and int(match[1]) < step and int(match[1]) != kept:
                    path.unlink(missing_ok=True)

    def _path(self, shard: int, step: int) -> Path:
        return self._folder / f"island-{shard}-{step}.bin"
