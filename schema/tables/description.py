"""Small files of a run folder: its description ``run.json`` and its ``state``.

Each is written whole, has a limited size and is checked when it is read. The
description has a digest of its content, so that a changed byte never gives another run.
"""

import os
import stat
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import structs

from schema.errors import RunFolderError, expectation, near_files, unreadable
from schema.experiment.identity import WHOLE, Group, Origin
from schema.limits import MOST_DESCRIPTION, MOST_MARK, MOST_NAME, printable
from schema.plugins.kept import KeptPlugin, allow_kept

DETAILS = "run.json"
STATE = "state"

State = Literal["running", "stopped", "finished"]
STATES: tuple[State, ...] = ("running", "stopped", "finished")

_RUN_ID_DIGITS = 12
"""Of ten thousand runs, two have the same one with a probability of 2e-7."""


class KeptFounder(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Given founder as a run folder keeps it, under the digest of its genome.

    Attributes:
        run: ``run_id`` of the run that it comes from; empty: of a file.
        file: path of that file.
    """

    genome: bytes
    run: str = ""
    file: str = ""


class RunDetails(msgspec.Struct, frozen=True):
    """Description of a run: everything that determines its births.

    Attributes:
        run: number of the repeat, from 0.
        seed: random seed of the run or campaign.
        document: the experiment as JSON, with all defaults.
        founders: given founders, by the digests that the document holds.
        group: islands of the document that the run has.
        archipelago: name that the groups of an archipelago have in common; empty for a
            run of all islands.
    """

    name: str
    run: int
    seed: int
    document: str
    founders: dict[str, KeptFounder] = {}
    group: Group = WHOLE
    archipelago: str = ""

    @property
    def origin(self) -> Origin:
        """Origin of the random streams of sensor and motor noise, for island 0."""
        return Origin(seed=self.seed, run=self.run)


class Description(RunDetails, frozen=True, forbid_unknown_fields=True):
    """Content of ``run.json``; runs of 0.1 have only the first four fields.

    Attributes:
        nonce: distinguishes runs that were made in the same folder.
        checksums: all segments have checksums.
        digests: SHA-256 of each finished table in hexadecimal, by name of the table.
        plugins: modules of the experiment's plug-ins, by name.
        digest: SHA-256 of the other fields in hexadecimal; empty in runs of 0.1.
        version: of Revolve Islands that began the run; empty in runs of 0.1 and 0.2.
    """

    nonce: str = ""
    checksums: bool = False
    digests: dict[str, str] = {}
    plugins: dict[str, KeptPlugin] = {}
    digest: str = ""
    version: str = ""


def description_text(description: Description) -> str:
    """Return the text of ``run.json``, with its digest."""
    entries = msgspec.to_builtins(description)
    entries["digest"] = _digest(entries)
    return msgspec.json.format(msgspec.json.encode(entries), indent=1).decode()


def read_description(folder: Path) -> Description:
    """Return the description of a folder's run, or of the one of its groups.

    Raises:
        RunFolderError: there is no run, or its description is damaged.
    """
    file = folder / DETAILS
    try:
        data = read_small(file, MOST_DESCRIPTION)
    except FileNotFoundError:
        check_folder(folder)
        if groups := groups_of(folder):
            first = read_description(groups[0])
            return structs.replace(first, group=WHOLE, digests={})
        why = f"no run is there ({DETAILS} is missing)"
        if runs := sorted(each.parent for each in folder.glob(f"*/{DETAILS}")):
            why = f"holds several runs; give one of them, such as {runs[0]}"
        raise RunFolderError(f"{folder}: {why}") from None
    try:
        found = msgspec.json.decode(data, type=Description)
        why = _fault(found, data)
    # A UnicodeError is a ValueError; an escape in JSON may be half a character.
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        why = expectation(str(error))
    if why:
        raise RunFolderError(
            f"{file}: damaged: {printable(why, 200)}; restore a copy of the file"
        )
    return found


def groups_of(folder: Path) -> list[Path]:
    """Return the folders of the groups of islands that a folder holds, in order.

    There are none in a folder with a run of its own, or without groups.

    Raises:
        RunFolderError: as of ``check_groups``, or a group is damaged.
    """
    found = [each.parent for each in sorted(folder.glob(f"*/{DETAILS}"))]
    if (folder / DETAILS).exists() or not found:
        return []
    known: dict[Path, Description] = {}
    damaged: list[RunFolderError] = []
    for each in found:
        try:
            known[each] = read_description(each)
        except RunFolderError as error:
            damaged.append(error)
    if all(each.group == WHOLE for each in known.values()):
        return []
    if damaged:
        raise damaged[0]
    return check_groups(known)


def check_groups(known: Mapping[Path, RunDetails]) -> list[Path]:
    """Return the folders of all groups of an archipelago, in order.

    Raises:
        RunFolderError: a group is missing or doubled, or of another archipelago.
    """
    first = next(iter(known))
    numbered: dict[int, Path] = {}
    for folder, own in known.items():
        if own.group == WHOLE:
            raise RunFolderError(f"{folder}: is no group of islands")
        if _common(own) != _common(known[first]):
            raise RunFolderError(
                f"{folder}: must be a group of the archipelago of {first}"
            )
        if other := numbered.get(own.group.number):
            raise RunFolderError(f"{folder}: is group {own.group}, as {other}")
        numbered[own.group.number] = folder
    of = known[first].group.of
    for number in range(of):
        if number not in numbered:
            group = Group(number=number, of=of)
            raise RunFolderError(f"{first.parent}: group {group} is missing")
    return [numbered[number] for number in range(of)]


def _common(own: RunDetails) -> tuple[object, ...]:
    """Return what all groups of an archipelago have in common."""
    return own.name, own.run, own.seed, own.group.of, own.archipelago


def check_folder(folder: Path) -> None:
    """Raise ``RunFolderError`` unless a folder is there, and no file."""
    if not folder.exists():
        raise RunFolderError(f"{folder}: no such folder{near_files(folder, '*/')}")
    if not folder.is_dir():
        raise RunFolderError(f"{folder}: must be a folder, got a file")


def make_folder(path: Path) -> None:
    """Make a folder and those above it, unless it is there.

    Raises:
        RunFolderError: a file is in its place, or the disk refuses it.
    """
    if path.exists():
        check_folder(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"cannot be written: {error.strerror or error}"
        raise RunFolderError(f"{path}: {why}") from None


def run_columns(folder: Path) -> dict[str, int | str | None]:
    """Return the columns of tables that are the same in all rows of a run.

    They are ``seed``, and ``run_id``: 12 hexadecimal digits, another for each run, also
    of the same experiment and seed; a copy of the folder keeps it. Both are null if the
    description is lost or damaged.
    """
    try:
        known = read_description(folder)
    except RunFolderError:
        return {"seed": None, "run_id": None}
    nonce = known.archipelago or known.nonce
    origin = (known.name, known.run, known.seed, known.document, nonce)
    digest = sha256(msgspec.json.encode(origin)).hexdigest()
    return {"seed": known.seed, "run_id": digest[:_RUN_ID_DIGITS]}


def allow_plugins_of(folder: Path, *, is_resumed: bool = False) -> None:
    """Allow the plug-ins of a run, perhaps resumed, that the user named.

    Without a description in its folder, nothing more is allowed.

    Raises:
        RunFolderError: the description is damaged.
        ExperimentError: as of ``allow_kept``.
    """
    if (folder / DETAILS).exists():
        allow_kept(folder, read_description(folder).plugins, is_resumed=is_resumed)


def _fault(found: Description, data: bytes) -> str:
    """Return what is wrong with a decoded description; empty if nothing is."""
    if found.digest and found.digest != _digest(msgspec.json.decode(data)):
        return "its digest is not that of its content"
    if not (0 < len(found.name) <= MOST_NAME and found.name.isprintable()):
        return f"name must be printable and not empty, got {found.name[:MOST_NAME]!r}"
    for key, value, bits in (("run", found.run, 31), ("seed", found.seed, 64)):
        if not 0 <= value < 1 << bits:
            return f"{key} must be from 0 to 2^{bits} - 1, got {value}"
    if found.group.number >= found.group.of:
        return f"group must be one of {found.group.of}, got number {found.group.number}"
    return ""


def _digest(entries: dict[str, Any]) -> str:
    """Return the SHA-256 of all entries but the digest, in order of their names."""
    rest = {key: value for key, value in entries.items() if key != "digest"}
    return sha256(msgspec.json.encode(rest, order="sorted")).hexdigest()


def read_state(folder: Path) -> State:
    """Return a run's state; after a kill it is still "running".

    Groups are finished if all are, and stopped if none is running.

    Raises:
        RunFolderError: the file is damaged.
    """
    if groups := groups_of(folder):
        first, *others = set(map(read_state, groups))
        if others:
            return "running" if "running" in (first, *others) else "stopped"
        return first
    file = folder / STATE
    try:
        text = read_small(file, MOST_MARK)
    except FileNotFoundError:
        return "running"
    for state in STATES:
        if text.strip() == state.encode():
            return state
    raise RunFolderError(
        f"{file}: damaged: must be one of {', '.join(STATES)}, got {text[:40]!r}"
    )


def read_small(file: Path, most: int) -> bytes:
    """Return the content of a file of at most ``most`` bytes.

    Raises:
        FileNotFoundError: there is none.
        RunFolderError: too large, no regular file, or unreadable.
    """
    try:
        # A named pipe must not block.
        descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            found = os.fstat(descriptor)
            if not stat.S_ISREG(found.st_mode):
                raise RunFolderError(f"{file}: damaged: must be a regular file")
            if found.st_size > most:
                raise RunFolderError(
                    f"{file}: damaged: must have at most {most} bytes, got "
                    f"{found.st_size}"
                )
            return os.read(descriptor, most)
        finally:
            os.close(descriptor)
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(file) from None
    except OSError as error:
        raise RunFolderError(f"{file}: {unreadable(error)}") from None
