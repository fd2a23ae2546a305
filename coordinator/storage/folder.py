"""A run's folder: whose it is, what is run there, and for the how-manieth time.

One coordinator at a time holds its lock. Every opening raises the epoch, which
stands in every job, so that answers to an earlier incarnation are told apart and
a coordinator that slept through its replacement finds out.
"""

import json
import secrets
import socket
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from coordinator.storage.disk import replace_durably, storage_error
from coordinator.storage.hints import command
from coordinator.storage.journal import NAME as JOURNAL
from coordinator.storage.journal import newest_epoch
from coordinator.storage.lock import LOCK, FolderLock
from schema.errors import RunFolderError
from schema.experiment.identity import Origin

State = Literal["running", "stopped", "finished"]
STATES: tuple[State, ...] = ("running", "stopped", "finished")

DETAILS = "run.json"
EPOCH = "epoch"
STATE = "state"
_NONCE = "nonce"


@dataclass(frozen=True, slots=True)
class RunDetails:
    """What a run is: everything that its births are a function of.

    Attributes:
        name: of the experiment.
        run: number of the repeat, from 0.
        seed: of the whole execution.
        document: the experiment, every default written out.
    """

    name: str
    run: int
    seed: int
    document: str

    @property
    def origin(self) -> Origin:
        """The run, as what noise is drawn by; of its island 0."""
        return Origin(seed=self.seed, run=self.run)


class RunFolder:
    """A run folder that this process holds.

    Attributes:
        path: where it is.
        details: what is run here.
        epoch: how many coordinators have opened it, this one included.
        name: of this run among all that workers may ever hear of: a folder that is
            begun anew is another run, whose epochs count from 1 again.
    """

    def __init__(self, path: Path, details: RunDetails | None = None) -> None:
        """Take a new folder for a run, or take an old one again.

        Args:
            path: the folder.
            details: what to run in a new folder; None opens one that has a run.

        Raises:
            RunFolderError: another coordinator holds it (named), a new run in a
                used folder, no run in an old one, or a disk that fails.
        """
        self.path = path
        self._is_new = details is not None
        if details is None:
            read_details(path)
        try:
            if details is not None:
                path.mkdir(parents=True, exist_ok=True)
                _refuse_foreign(path)
        except OSError as error:
            raise storage_error(path, error) from None
        self._lock = FolderLock(path)
        try:
            if details is not None:
                _refuse_used(path)
                entries = {**asdict(details), _NONCE: secrets.token_hex(4)}
                _replace_text(path / DETAILS, json.dumps(entries, indent=1))
            self.details = read_details(path)
            nonce = _read_entries(path).get(_NONCE, "")
            self.name = f"{socket.gethostname()}:{nonce}:{path.resolve()}"
            # The journal's, too: a lost or older file would have it void what comes.
            self.epoch = max(_read_epoch(path), newest_epoch(path)) + 1
            _replace_text(path / EPOCH, str(self.epoch))
        except BaseException:
            self.close()
            raise

    def set_state(self, state: State) -> None:
        """Say how far the run is, for those who look from outside.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        _replace_text(self.path / STATE, state)

    def confirm(self) -> None:
        """Raise if the run went on without us.

        Raises:
            RunFolderError: a later coordinator has opened the folder.
        """
        epoch = _read_epoch(self.path)
        if not epoch:
            raise RunFolderError(
                f"{self.path}: moved or removed, or its file {EPOCH!r} is: stop"
            )
        if epoch != self.epoch:
            raise RunFolderError(
                f"{self.path}: this is coordinator {self.epoch} of the run, and "
                f"coordinator {epoch} has taken it over: stop"
            )

    def forget(self) -> None:
        """Leave no trace of a run that this process described and did not begin.

        The lock stays: whoever waits for it would have one that nobody else sees.
        """
        if self._is_new and not (self.path / JOURNAL).exists():
            for name in (EPOCH, DETAILS):
                (self.path / name).unlink(missing_ok=True)

    def close(self) -> None:
        """Let go of the folder."""
        self._lock.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def holds_run(path: Path) -> bool:
    """Return whether a folder is one of a run, be it damaged.

    Raises:
        RunFolderError: it cannot be looked into.
    """
    try:
        return (path / DETAILS).exists()
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror}") from None


def read_details(path: Path) -> RunDetails:
    """Return what is run in a folder; nobody need hold it.

    Raises:
        RunFolderError: no run is there, or its description is damaged.
    """
    file = path / DETAILS
    entries = _read_entries(path)
    entries.pop(_NONCE, None)  # runs of before have none
    types = {"name": str, "run": int, "seed": int, "document": str}
    if entries.keys() != types.keys():
        raise RunFolderError(
            f"{file}: must have {', '.join(types)}, has {', '.join(entries) or 'none'}"
        )
    for key, kind in types.items():
        if not isinstance(entries[key], kind):
            raise RunFolderError(
                f"{file}: {key}: must be {kind.__name__}, got {entries[key]!r}"
            )
    return RunDetails(**entries)


def _read_entries(path: Path) -> dict[str, Any]:
    """Return what stands in a run's description."""
    file = path / DETAILS
    try:
        entries = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise RunFolderError(
            f"{path}: no run is there ({DETAILS} is missing)"
        ) from None
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{file}: cannot be read: {error}") from None
    if not isinstance(entries, dict):
        raise RunFolderError(f"{file}: must be an object, got {entries!r}")
    return entries


def read_state(path: Path) -> State:
    """Return how far a run is; "running" may also have died since.

    Raises:
        RunFolderError: the file is damaged.
    """
    file = path / STATE
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        return "running"
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{file}: cannot be read: {error}") from None
    for state in STATES:
        if text == state:
            return state
    raise RunFolderError(f"{file}: must be one of {', '.join(STATES)}, got {text!r}")


def _refuse_used(path: Path) -> None:
    """Raise if a folder holds a run, or anything that is not ours."""
    if holds_run(path):
        raise RunFolderError(
            f"{path}: already holds a run; to go on with it: "
            f"{command('resume', path)}; or choose another folder"
        )
    _refuse_foreign(path)


def _refuse_foreign(path: Path) -> None:
    """Raise if a folder that holds no run holds anything that is not ours."""
    names = sorted(entry.name for entry in path.iterdir())
    # What a kill between taking the folder and describing the run may leave.
    foreign = [name for name in names if name not in (LOCK, f".{DETAILS}.new")]
    if foreign and DETAILS not in names:
        raise RunFolderError(
            f"{path}: not empty ({foreign[0]!r} is there): choose another folder"
        )


def _read_epoch(path: Path) -> int:
    file = path / EPOCH
    try:
        return int(file.read_text(encoding="ascii"))
    except FileNotFoundError:
        return 0
    except (OSError, ValueError) as error:
        raise RunFolderError(
            f"{file}: cannot be read ({error}): write a number into it that is greater "
            "than any before"
        ) from None


def _replace_text(path: Path, text: str) -> None:
    replace_durably(path, lambda file: file.write_text(text, encoding="utf-8"))
