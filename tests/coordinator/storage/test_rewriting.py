"""Rewriting of a run folder that ends at any of its steps."""

import os
import shutil
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from coordinator.storage import rewriting as module
from coordinator.storage.rewriting import (
    complete_rewriting,
    is_rewritten,
    rewriting,
)

OLD = {
    "run.json": "old",
    "journal.bin": "old",
    "state": "finished",
    "best.yaml": "old",
    "tables/births.parquet": "old",
    "epoch": "3",
}
NEW = {
    "run.json": "new",
    "journal.bin": "new",
    "segments/poses-000.arrows": "new",
    "epoch": "3",
}


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def read(folder: Path) -> dict[str, str]:
    files = filter(Path.is_file, folder.rglob("*"))
    return {str(file.relative_to(folder)): file.read_text() for file in files}


def rewrite(folder: Path) -> None:
    with rewriting(folder) as place:
        write(place, {name: text for name, text in NEW.items() if name != "epoch"})


class Killed(BaseException):
    """The process ends here."""


def kill_at(monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    """Let the process end at a step of the file system, from 0."""
    left = step

    def counted(call: Callable[..., Any]) -> Callable[..., Any]:
        def counting(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - any call
            nonlocal left
            if not left:
                raise Killed
            left -= 1
            return call(*arguments, **options)

        return counting

    for place, name in (
        (Path, "mkdir"), (Path, "rename"), (Path, "rmdir"), (Path, "unlink"),
        (os, "replace"), (shutil, "rmtree"), (module, "sync_file"),
    ):  # fmt: skip
        monkeypatch.setattr(place, name, counted(getattr(place, name)))


def test_process_may_end_at_any_step(tmp_path: Path) -> None:
    outcomes: list[bool] = []
    for step in count():
        folder = tmp_path / str(step)
        write(folder, OLD)
        try:
            with pytest.MonkeyPatch.context() as patched:
                kill_at(patched, step)
                rewrite(folder)
            break
        except Killed:
            outcomes.append(is_rewritten(folder))
        complete_rewriting(folder)
        assert read(folder) == (NEW if outcomes[-1] else OLD), step
    assert read(folder) == NEW
    assert outcomes == sorted(outcomes)
    assert outcomes.count(False) > 4
    assert outcomes.count(True) > 6


def test_error_in_the_block_changes_nothing(tmp_path: Path) -> None:
    write(tmp_path, OLD)
    with pytest.raises(TypeError), rewriting(tmp_path) as place:
        write(place, {**NEW, "state": None})  # type: ignore[dict-item]
    assert read(tmp_path) == OLD
