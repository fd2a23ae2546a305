"""Durable files on a full disk."""

import errno
import os
import shutil
import stat
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from coordinator.storage.disk import AppendedFile, replace_durably, replace_text
from schema.errors import RunFolderError
from schema.tables.segments import warn_once

ROOM = 64 * 1024
PAGE = 4096


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a disk of 64 KiB; skip without the permission."""
    mount = shutil.which("mount")
    command = ["mount", "-t", "tmpfs", "-o", f"size={ROOM}", "tmpfs", str(tmp_path)]
    if (
        mount is None
        or subprocess.run(command, capture_output=True, check=False).returncode
    ):
        pytest.skip("no right to mount a small disk")
    yield tmp_path
    subprocess.run(["umount", str(tmp_path)], check=True)


def test_an_append_to_a_full_disk_leaves_nothing(small_disk: Path) -> None:
    file = AppendedFile(small_disk / "f", fsync=True)
    piece = b"x" * 10_000
    taken = 0
    while (taken + 1) * len(piece) < ROOM - 4 * PAGE:
        file.append(piece)
        taken += 1
    with pytest.raises(RunFolderError, match=r"f: disk full .*free some space"):
        file.append(b"x" * ROOM)
    assert (small_disk / "f").read_bytes() == piece * taken
    assert file.size == len(piece) * taken
    # What does fit is taken still.
    file.append(b"y")
    assert (small_disk / "f").read_bytes() == piece * taken + b"y"
    file.close()


def test_a_replacement_on_a_full_disk_leaves_the_old_file(small_disk: Path) -> None:
    path = small_disk / "f"
    replace_durably(path, lambda file: file.write_bytes(b"old"))
    with pytest.raises(RunFolderError, match="f: disk full"):
        replace_durably(path, lambda file: file.write_bytes(b"n" * 2 * ROOM))
    assert [(each.name, each.read_bytes()) for each in small_disk.iterdir()] == [
        ("f", b"old")
    ]


def test_appending_to_a_closed_file_fails(tmp_path: Path) -> None:
    file = AppendedFile(tmp_path / "f")
    file.append(b"one")
    file.close()
    with pytest.raises(RunFolderError, match="cannot be written"):
        file.append(b"two")
    assert (tmp_path / "f").read_bytes() == b"one"


@pytest.mark.parametrize("room", [0, 3])
def test_a_failed_append_keeps_what_another_process_wrote_before(
    tmp_path: Path,
    full_beyond: Callable[[int], AbstractContextManager[None]],
    room: int,
) -> None:
    """A replaced coordinator appends to a full disk."""
    old = AppendedFile(tmp_path / "f")
    old.append(b"old")
    new = AppendedFile(tmp_path / "f")
    new.append(b" and new")
    with full_beyond(11 + room), pytest.raises(RunFolderError, match="disk full"):
        old.append(b" again")
    new.append(b" still")
    assert (tmp_path / "f").read_bytes() == b"old and new still"
    for file in (old, new):
        file.close()


def test_a_failed_append_keeps_what_another_process_wrote_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = AppendedFile(tmp_path / "f", fsync=True)
    new = AppendedFile(tmp_path / "f")

    def fail(_descriptor: int) -> None:
        new.append(b"new")
        raise OSError(errno.EIO, "gone")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(RunFolderError, match="cannot be written: gone"):
        old.append(b"old ")
    assert (tmp_path / "f").read_bytes() == b"old new"
    for file in (old, new):
        file.close()


def test_a_missing_folder_is_a_run_folder_error(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="No such file"):
        AppendedFile(tmp_path / "none" / "f")


@pytest.fixture
def fails(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Let ``fsync`` of folders fail with the last of these numbers, if there is one."""
    numbers: list[int] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        if numbers and stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(numbers[-1], os.strerror(numbers[-1]))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    warn_once.cache_clear()
    yield numbers
    warn_once.cache_clear()


@pytest.mark.parametrize(
    "number", [errno.EINVAL, errno.EACCES, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM]
)
def test_a_file_system_that_does_not_sync_folders_costs_one_warning(
    tmp_path: Path, fails: list[int], caplog: pytest.LogCaptureFixture, number: int
) -> None:
    fails.append(number)
    for text in ("a", "b"):
        replace_text(tmp_path / "f", text)
        AppendedFile(tmp_path / "g", fsync=True).close()
    assert (tmp_path / "f").read_text() == "b"
    assert [record.getMessage() for record in caplog.records] == [
        f"a power loss may damage files: fsync: {os.strerror(number)}"
    ]


def test_a_disk_that_fails_to_sync_a_folder_is_an_error(
    tmp_path: Path, fails: list[int]
) -> None:
    fails.append(errno.EIO)
    with pytest.raises(RunFolderError, match="f: cannot be written"):
        replace_text(tmp_path / "f", "a")
