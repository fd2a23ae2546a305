"""Sources of plug-ins that a run folder keeps, and when they are imported.

A run that uses a plug-in file keeps a copy of it, so that the folder alone is enough to
continue the run and to look at it. A run folder may also come from somebody else, and
an import runs the code. A copy is therefore imported without ``--plugins`` only if it
has the user's seal: an HMAC with a secret key in the user's own state folder. Of
installed modules only the digest is kept.
"""

import hmac
import os
import secrets
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from msgspec import Struct

from schema.errors import ExperimentError, unreadable
from schema.limits import MOST_PLUGIN_BYTES
from schema.plugins.permission import (
    FLAG,
    allow_file,
    allowed_file,
    is_only_found,
    source_of,
)
from schema.plugins.source import digest_of, digest_of_bytes, modules_named

PLUGINS = "plugins"
"""Folder of the copies in a run or campaign folder."""
_KEY_BYTES = 32


class KeptPlugin(Struct, frozen=True, forbid_unknown_fields=True):
    """Plug-in module of a run.

    Attributes:
        digest: of its source, as workers compare it.
        file: path of the file that was copied; empty for an installed module.
        seal: of the copy; empty for an installed module, or a user without a key.
    """

    digest: str
    file: str = ""
    seal: str = ""


def plugins_to_keep(document: str) -> dict[str, tuple[KeptPlugin, bytes]]:
    """Return description and source of each plug-in module that a document names.

    The source of an installed module is empty.

    Args:
        document: an experiment as JSON.

    Raises:
        ExperimentError: a file cannot be read, or is too large to be kept.
    """
    found: dict[str, tuple[KeptPlugin, bytes]] = {}
    for name in modules_named(document.encode()):
        file = allowed_file(name)
        if file is not None:
            source = _read(name, file)
            note = KeptPlugin(digest_of_bytes(source), str(file), _seal(name, source))
            found[name] = note, source
        elif digest := digest_of(name):
            found[name] = KeptPlugin(digest), b""
    return found


def kept_file(folder: Path, name: str) -> Path:
    """Return the path of the copy of a plug-in module in a run folder."""
    return folder / PLUGINS / f"{name}.py"


def allow_kept(
    folder: Path, kept: Mapping[str, KeptPlugin], *, is_resumed: bool
) -> None:
    """Allow the plug-ins of a folder that the user named on the command line.

    Modules that the user allowed herself take precedence over copies. A file that is
    only found on the import path, as the folder of a Python script is, does not if it
    has changed since a run that is not resumed.

    Args:
        folder: of a run or campaign.
        kept: description of each module.
        is_resumed: the run continues; all sources must be those of its beginning.

    Raises:
        ExperimentError: a source differs from that of the run; a copy is missing,
            damaged or not the user's own.
    """
    for name, note in kept.items():
        copy = kept_file(folder, name)
        if not note.file:
            if is_resumed:
                _check_installed(name, note)
            continue
        found = digest_of(name)
        if found and found != note.digest and not is_resumed and _is_unused(name):
            found = ""
        if found:
            if found != note.digest:
                raise ExperimentError(
                    f"plug-in {name}: has source digest {found}, but {folder} was made "
                    f"with {note.digest}; to use that one: {_how_to_use(name, copy)}"
                )
        else:
            if is_resumed:
                _check_original(name, note, copy)
            _check_copy(name, note, copy)
            allow_file(name, copy)


def _is_unused(name: str) -> bool:
    """Return whether a module is neither imported nor allowed by the user."""
    return name not in sys.modules and allowed_file(name) is None


def _how_to_use(name: str, copy: Path) -> str:
    """Return how a copy takes precedence over the module that is found."""
    if name in sys.modules or allowed_file(name) or is_only_found(name):
        return f"{FLAG} {copy} (in Python: read the folder in a new process)"
    found = ", ".join(map(str, source_of(name)))
    return f"remove {found} from the import path, and add {FLAG} {copy}"


def _check_installed(name: str, note: KeptPlugin) -> None:
    found = digest_of(name)
    if found != note.digest:
        what = f"has source digest {found}" if found else "is not installed"
        raise ExperimentError(
            f"plug-in {name}: {what}, but the run began with source digest "
            f"{note.digest}: install that version, or start another run"
        )


def _check_original(name: str, note: KeptPlugin, copy: Path) -> None:
    """Raise if the file that was copied is still there and has changed."""
    original = Path(note.file)
    if not original.is_file():
        return
    found = digest_of_bytes(_read(name, original))
    if found != note.digest:
        raise ExperimentError(
            f"plug-in {name}: {original} has changed since the run began (source "
            f"digest {found}, expected {note.digest}): undo that, start another run, "
            f"or continue with the copy in the run folder: {FLAG} {copy}"
        )


def _check_copy(name: str, note: KeptPlugin, copy: Path) -> None:
    source = _read(name, copy)
    found = digest_of_bytes(source)
    if found != note.digest:
        raise ExperimentError(
            f"plug-in {name}: {copy} is damaged (source digest {found}, expected "
            f"{note.digest}): give the original with {FLAG} FILE"
        )
    seal = _seal(name, source)
    if not seal or not hmac.compare_digest(seal, note.seal):
        raise ExperimentError(
            f"plug-in {name}: {copy} was not written by a run of yours on this "
            f"machine, and importing it runs its code; if you trust it, add "
            f"{FLAG} {copy}"
        )


def _read(name: str, file: Path) -> bytes:
    try:
        with file.open("rb") as opened:
            data = opened.read(MOST_PLUGIN_BYTES + 1)
    except OSError as error:
        raise ExperimentError(
            f"plug-in {name}: {file}: {unreadable(error)}; give its source "
            f"with {FLAG} FILE"
        ) from None
    if len(data) > MOST_PLUGIN_BYTES:
        raise ExperimentError(
            f"plug-in {name}: {file} must have <= {MOST_PLUGIN_BYTES} bytes"
        )
    return data


def _seal(name: str, source: bytes) -> str:
    """Return the user's seal of a source; empty for a user without a key."""
    key = _user_key()
    text = name.encode() + b"\0" + source
    return hmac.new(key, text, "sha256").hexdigest() if key else ""


def _user_key() -> bytes:
    """Return the user's secret key, made at its first use; empty if that fails."""
    try:
        state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
        file = Path(state) / "revolve" / "plugin-key"
        if not file.exists():
            file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            _write_key(file)
        found = file.stat()
        is_secret = found.st_uid == os.getuid() and not found.st_mode & 0o077
        key = file.read_bytes() if is_secret else b""
    # No home folder is a RuntimeError.
    except (OSError, RuntimeError):
        return b""
    return key if len(key) == _KEY_BYTES else b""


def _write_key(file: Path) -> None:
    """Write a new key, unless another process has done so meanwhile."""
    new = file.with_name(f".{file.name}.{secrets.token_hex(4)}")
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        os.write(descriptor, secrets.token_bytes(_KEY_BYTES))
        with suppress(FileExistsError):
            os.link(new, file)
    finally:
        os.close(descriptor)
        new.unlink()
