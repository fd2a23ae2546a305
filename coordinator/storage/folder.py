"""A run folder: its lock, its description, its epoch, its state.

One coordinator at a time holds the lock. Each opening increments the epoch, which is
part of every job: answers to an earlier coordinator of the run are recognised, and a
coordinator that was replaced while it was suspended notices it.
"""

import contextlib
import os
import re
import secrets
import shutil
import socket
from collections.abc import Mapping
from pathlib import Path

from msgspec import structs

from coordinator.storage.disk import (
    replace_bytes,
    replace_durably,
    replace_text,
    storage_errors,
)
from coordinator.storage.hints import FLAGS, command, resume_command
from coordinator.storage.journal import (
    MOST_RECORDED_EPOCH,
    Position,
    read_journal,
    read_records,
)
from coordinator.storage.journal import NAME as JOURNAL
from coordinator.storage.lock import LOCK, FolderLock
from coordinator.storage.rewriting import complete_rewriting
from schema.agent.version import VERSION
from schema.errors import ExperimentError, RunFolderError, unreadable
from schema.experiment.file import experiment_from_text
from schema.limits import MOST_MARK
from schema.plugins.kept import PLUGINS, KeptPlugin, keep, kept_file
from schema.tables.description import (
    DETAILS,
    STATE,
    Description,
    RunDetails,
    State,
    description_text,
    make_folder,
    read_description,
    read_small,
)
from schema.tables.segments import warn_once

EPOCH = "epoch"

# Coordinators that opened the run and ended before they wrote a record have an epoch
# that the journal does not show.
_UNRECORDED = 1000
MOST_FILED_EPOCH = MOST_RECORDED_EPOCH - _UNRECORDED
_VERSION_OF_UNNAMED = "0.2"
"""Version that resumes runs whose description names none."""
_DIGITS = re.compile(rb"[1-9][0-9]{0,9}")


class RunFolder(contextlib.AbstractContextManager["RunFolder"]):
    """A run folder that this process has locked.

    Attributes:
        epoch: how often the folder has been opened, this time included.
        name: unique name of the run for workers. A new run in the folder of a removed
            one gets another name, because its epochs start at 1 again.
    """

    def __init__(self, path: Path, details: RunDetails | None = None) -> None:
        """Create the folder of a new run with details, or open that of an existing run.

        Raises:
            RunFolderError: another coordinator has locked it (named), a new run's
                folder is used, there is no run to open, another version of Revolve
                Islands began it, or the disk fails.
            ExperimentError: a plug-in file of a new run cannot be kept.
        """
        self.path = path
        self._is_new = details is not None
        if details is None:
            refuse_other_version(path)
        else:
            make_folder(path)
            with storage_errors(path):
                _refuse_foreign(path)
        self._lock = FolderLock(path)
        try:
            if details is not None:
                _refuse_used(path, details)
                new = Description(
                    **structs.asdict(details),
                    nonce=secrets.token_hex(4),
                    checksums=True,
                    version=VERSION,
                    plugins=keep(path, details.document, replace_bytes),
                )
                replace_text(path / DETAILS, description_text(new))
            else:
                complete_rewriting(path)
            self.details = read_details(path)
            nonce = read_description(path).nonce
            self.name = f"{socket.gethostname()}:{nonce}:{path.resolve()}"
            self.epoch = _next_epoch(path)
            self._epoch_file, self._mark = str(path / EPOCH), str(self.epoch).encode()
            replace_bytes(path / EPOCH, self._mark)
        except BaseException:
            self.close()
            raise

    def set_state(self, state: State) -> None:
        """Write the run's state for other processes."""
        replace_text(self.path / STATE, state)

    def seal(self, digests: Mapping[str, str]) -> None:
        """Write the SHA-256 (hexadecimal) of finished tables to the run's description.

        Raises:
            RunFolderError: the description is damaged, or the disk is full or failed.
        """
        known = read_description(self.path)
        sealed = structs.replace(known, digests={**known.digests, **digests})
        write_description(self.path, sealed, self.path)

    def confirm(self) -> None:
        """Check that no other coordinator has taken over the run.

        Raises:
            RunFolderError: one has opened the folder, the folder is gone, or the
                file with the epoch is damaged.
        """
        # For each answer of an agent: a plain comparison suffices nearly always.
        with contextlib.suppress(OSError):
            # A named pipe must not block.
            file = os.open(self._epoch_file, os.O_RDONLY | os.O_NONBLOCK)
            try:
                if os.read(file, MOST_MARK) == self._mark:
                    return
            finally:
                os.close(file)
        try:
            epoch = _read_epoch(self.path)
        except RunFolderError as error:
            raise RunFolderError(
                f"{error}; to write it again: {command('resume', self.path)}"
            ) from None
        if not epoch:
            raise RunFolderError(
                f"{self.path}: the folder or its file {EPOCH!r} was moved or removed"
            )
        # Not a lower one: that is an older copy of the file, and no coordinator.
        if epoch > self.epoch:
            raise RunFolderError(
                f"{self.path}: this is coordinator {self.epoch} of the run, but "
                f"coordinator {epoch} has taken it over"
            )

    def forget(self) -> None:
        """Remove the description of a new run that has not started.

        The lock file stays: another process may already wait for this very file.
        """
        if self._is_new and not (self.path / JOURNAL).exists():
            forget_plugins(self.path, read_description(self.path).plugins)
            for name in (EPOCH, DETAILS):
                (self.path / name).unlink(missing_ok=True)

    def close(self) -> None:
        """Unlock the folder."""
        self._lock.close()

    def __exit__(self, *_error: object) -> None:
        self.close()


def write_description(folder: Path, changed: Description, place: Path) -> None:
    """Write a run's changed description to a place.

    Its time of change is that in the run folder: it is when the run began.
    """
    text, file = description_text(changed), folder / DETAILS
    with storage_errors(file):
        began = file.stat().st_mtime_ns

    def write(path: Path) -> None:
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(began, began))

    replace_durably(place / DETAILS, write)


def holds_run(path: Path) -> bool:
    """Return whether a folder holds a run, damaged or not.

    Raises:
        RunFolderError: the folder cannot be read.
    """
    try:
        return (path / DETAILS).exists()
    except OSError as error:
        raise RunFolderError(f"{path}: {unreadable(error)}") from None


def read_details(path: Path) -> RunDetails:
    """Return the description of a folder's run, as ``read_description``."""
    found = read_description(path)
    return RunDetails(*(getattr(found, name) for name in RunDetails.__struct_fields__))


def refuse_other_version(path: Path) -> None:
    """Raise unless the minor version that began a run is this one.

    Journal and snapshots are those of one minor version; finished runs are read by all
    later ones.

    Raises:
        RunFolderError: another version began it; there is no run, or its description
            is damaged.
    """
    begun_by = read_description(path).version or _VERSION_OF_UNNAMED
    minor, ours = (".".join(each.split(".")[:2]) for each in (begun_by, VERSION))
    if minor != ours:
        raise RunFolderError(
            f"{path}: Revolve Islands {minor} began this run, and this is {ours}: "
            f"resume it with revolve-islands=={minor}.*"
        )


def forget_plugins(path: Path, plugins: Mapping[str, KeptPlugin]) -> None:
    """Remove the copies of plug-ins from a folder."""
    for name, note in plugins.items():
        copy = kept_file(path, name)
        if Path(note.file).resolve() == copy.resolve():
            continue  # the user's own folder of plug-ins
        if copy.is_dir():
            shutil.rmtree(copy)
        else:
            copy.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        # Not there, or with other files.
        (path / PLUGINS).rmdir()


def _refuse_used(path: Path, wanted: RunDetails) -> None:
    """Raise if a folder holds a run or a foreign file.

    The message says whether it is another run than the wanted one: to resume it would
    silently ignore what was changed since.
    """
    if holds_run(path):
        which, births = _difference(path, wanted)
        raise RunFolderError(
            f"{path}: already holds {which}; to resume it: "
            f"{resume_command(path, *births)}; or choose another folder"
        )
    _refuse_foreign(path)


def _difference(path: Path, wanted: RunDetails) -> tuple[str, tuple[str, ...]]:
    """Return which run a folder holds, and flags to make it the wanted one.

    A run that cannot be read counts as the wanted one.
    """
    with contextlib.suppress(RunFolderError, ExperimentError):
        known = read_details(path)
        # The text of an older version lacks keys with their defaults.
        theirs, ours = map(experiment_from_text, (known.document, wanted.document))
        births = ours.births
        if known != structs.replace(wanted, document=known.document) or (
            structs.replace(theirs, births=births) != ours
        ):
            return "a run with other settings", ()
        if theirs != ours:
            return f"this run with {theirs.births} births", ("--births", str(births))
    return "a run", ()


def _refuse_foreign(path: Path) -> None:
    """Raise if a folder without a run holds a foreign file."""
    names = sorted(entry.name for entry in path.iterdir())
    # A kill between locking the folder and describing the run may leave these.
    expected = (LOCK, f".{DETAILS}.new", PLUGINS, FLAGS)
    foreign = [name for name in names if name not in expected]
    if foreign and DETAILS not in names:
        raise RunFolderError(
            f"{path}: not empty (contains {foreign[0]!r}): choose another folder"
        )


def _next_epoch(path: Path) -> int:
    """Return the epoch of a coordinator that opens a folder now.

    The journal's epoch counts, too: with a lower one, as a lost or older file gives,
    all new records would be void. Records behind damage do not count: ``Journal``
    refuses such a file.
    """
    position = Position()
    for _ in read_records(read_journal(path / JOURNAL), position):
        pass
    recorded = position.epoch
    try:
        epoch = max(_read_epoch(path), recorded) + 1
    except RunFolderError as error:
        epoch = recorded + _UNRECORDED
        warn_once(f"{error}; continuing with epoch {epoch}, after that of the journal")
    if epoch > MOST_RECORDED_EPOCH:
        raise RunFolderError(
            f"{path}: the run was opened {epoch - 1} times, more than its journal can "
            "number: copy its experiment and start another run"
        )
    return epoch


def _read_epoch(path: Path) -> int:
    """Return the epoch in a folder; 0 if there is no file."""
    file = path / EPOCH
    try:
        text = read_small(file, MOST_MARK).strip()
    except FileNotFoundError:
        return 0
    if _DIGITS.fullmatch(text) and int(text) <= MOST_FILED_EPOCH:
        return int(text)
    raise RunFolderError(
        f"{file}: damaged: must be a number from 1 to {MOST_FILED_EPOCH}, got "
        f"{text[:40]!r}"
    )
