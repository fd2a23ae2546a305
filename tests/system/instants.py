"""Instants of a process at which it changes its run folder, and kills at them.

An instant is a call that writes, renames or removes a file, or one step of a longer
change. Its kind is the call and the file, such as "write .sums". Only a forked process
may install them: they replace functions of ``os``.
"""

import json
import os
import re
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet

from coordinator.storage import recorder
from coordinator.storage.folder import RunFolder
from coordinator.storage.recorder import TableFile

JOURNAL = "write journal.bin"
RECOVERY = "restore"
"""Kind of the instants at which rows of lost poses are written again."""


@dataclass(slots=True)
class Instants:
    """Counts instants, and kills this process at one of them.

    Attributes:
        kind: of the instant at which to kill; "" never kills.
        number: of the instant among those of its kind, from 1.
        share: of the change that is still made, from 0 to 1; a write is made in part,
            another change if the share is at least a half.
        seen: kinds of the instants so far.
    """

    kind: str
    number: int
    share: float
    seen: list[str]

    def install(self) -> None:
        """Replace the functions that change files."""
        os.write = self._torn(os.write, lambda descriptor: _name(_path(descriptor)))
        for function in ("write_text", "write_bytes"):
            setattr(Path, function, self._torn(getattr(Path, function), _name))
        for function in ("truncate", "unlink", "rmdir"):
            self._around(os, function, _name)
        # The name that the file gets; the folder for one that has none yet.
        self._around(os, "replace", lambda _, path: _name(path))
        self._around(os, "ftruncate", lambda descriptor, _: _name(_path(descriptor)))
        self._around(recorder, "digest_of", lambda _: ".parquet.new")
        self._around(
            pyarrow.parquet.ParquetWriter, "write_table", lambda *_: ".parquet.new"
        )
        self._around(TableFile, RECOVERY, lambda *_: "")
        self._around(RunFolder, "seal", lambda *_: "")

    def _is_due(self, kind: str) -> bool:
        self.seen.append(kind)
        return kind == self.kind and self.seen.count(kind) == self.number

    def _around(self, owner: Any, name: str, file: Callable[..., str]) -> None:  # noqa: ANN401 - a module or a class
        original = getattr(owner, name)

        def replaced(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401
            names = arguments[:2] if name in ("replace", "ftruncate") else arguments[:1]
            if not self._is_due(f"{name} {file(*names)}".strip()):
                return original(*arguments, **named)
            if self.share >= 0.5:
                original(*arguments, **named)
            return _die()

        setattr(owner, name, replaced)

    def _torn(self, original: Any, file: Callable[..., str]) -> Any:  # noqa: ANN401
        def replaced(target: Any, data: Any, **named: Any) -> Any:  # noqa: ANN401
            if not self._is_due(f"write {file(target)}"):
                return original(target, data, **named)
            original(target, data[: round(self.share * len(data))], **named)
            return _die()

        return replaced

    def save(self, path: Path) -> None:
        """Write the kinds of all instants, in their order, as JSON."""
        kinds = json.dumps(self.seen)
        path.write_bytes(kinds.encode())


def _path(descriptor: int) -> Path:
    return Path(f"/proc/self/fd/{descriptor}").readlink()


def _name(path: str | Path) -> str:
    """Return a file's name without numbers; of a table, its suffix."""
    name = Path(path).name
    for suffix in (".arrows", ".sums", ".parquet.new", ".parquet"):
        if name.endswith(suffix):
            return ("poses" if name.startswith("poses") else "") + suffix
    return re.sub(r"\d+", "N", name)


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
