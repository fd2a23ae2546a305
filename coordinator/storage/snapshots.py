"""Snapshots of arenas in a run's folder: the newest of each shard is kept.

``snapshots/island-N-STEP.bin`` is there whole or not at all. An older one goes only
when the journal has come to the newer; one that a journal does not come to (a kill
between the two) is passed over, and written again. Where the step is reached after
all but on another platform, the state is another one, which the digest tells.
"""

import re
from hashlib import sha256
from pathlib import Path

from coordinator.storage.disk import replace_durably, storage_error
from schema.errors import RunFolderError

FOLDER = "snapshots"

_NAME = re.compile(r"island-(\d+)-(\d+)\.bin")


class Snapshots:
    """The snapshots of a run folder that this process holds."""

    def __init__(self, folder: Path) -> None:
        """Look what is there.

        Args:
            folder: of the run.

        Raises:
            RunFolderError: the disk fails.
        """
        self._folder = folder / FOLDER
        self._there: set[tuple[int, int]] = set()
        try:
            names = [path.name for path in self._folder.glob("island-*.bin")]
        except OSError as error:
            raise storage_error(self._folder, error) from None
        for name in names:
            if match := _NAME.fullmatch(name):
                self._there.add((int(match[1]), int(match[2])))

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        """Return whether a shard's state of this digest at a step is there.

        Raises:
            RunFolderError: it cannot be read.
        """
        if (shard, step) not in self._there:
            return False
        return sha256(self.read(shard, step)).digest() == digest

    def write(self, shard: int, step: int, data: bytes) -> None:
        """Keep the state of a shard at a step, durably.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        replace_durably(self._path(shard, step), lambda path: path.write_bytes(data))
        self._there.add((shard, step))

    def read(self, shard: int, step: int) -> bytes:
        """Return the state of a shard at a step.

        Raises:
            RunFolderError: it is not there, or the disk fails.
        """
        path = self._path(shard, step)
        try:
            return path.read_bytes()
        except OSError as error:
            raise RunFolderError(
                f"{path}: cannot be read: {error.strerror}: remove it and resume; "
                "what it held is computed anew"
            ) from None

    def drop_before(self, shard: int, step: int) -> None:
        """Remove what is older than a step.

        Raises:
            RunFolderError: the disk fails.
        """
        for known in sorted(self._there):
            if known[0] == shard and known[1] < step:
                path = self._path(*known)
                try:
                    path.unlink(missing_ok=True)
                except OSError as error:
                    raise storage_error(path, error) from None
                self._there.discard(known)

    def _path(self, shard: int, step: int) -> Path:
        return self._folder / f"island-{shard}-{step}.bin"
