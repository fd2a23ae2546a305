"""Sources of plug-ins that a run folder keeps, and when they are imported.

A run keeps a copy of the sources of its plug-ins: the processes that it starts import
the copy, so that a plug-in may be edited meanwhile, and the folder alone is enough to
continue the run and to look at it. Of a module of one file, the copy is the file and
those files beside it that its text names; of a package, all files. Of compiled or large
ones only the digest is kept.

A run folder may also come from another person, and an import runs the code. A copy is
therefore imported without ``--plugins`` only if a run of this user wrote the same
files: the user's state folder has an empty file for each copy, named by its content.
"""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import msgspec
from msgspec import Struct

from schema.errors import ExperimentError, unreadable
from schema.limits import MOST_PLUGIN_BYTES
from schema.plugins.permission import FLAG, is_chosen, source_of, use_copy
from schema.plugins.source import (
    digest_in_use,
    digest_of,
    digest_of_sources,
    modules_named,
)

PLUGINS = "plugins"
"""Folder of the copies in a run or campaign folder."""
_COMPILED = (".so", ".pyd")


class KeptPlugin(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Plug-in module of a run.

    Attributes:
        digest: of its source, as workers compare it.
        file: path of the file or folder that was copied; empty without a copy.
        seal: of versions before 0.3; not used.
    """

    digest: str
    file: str = ""
    seal: str = ""


def keep(
    folder: Path, document: str, write: Callable[[Path, bytes], None]
) -> dict[str, KeptPlugin]:
    """Copy the plug-ins of JSON, use the copies, and describe each module.

    Raises:
        ExperimentError: an unreadable or changed source, or two data files of one name.
    """
    kept: dict[str, KeptPlugin] = {}
    for name, files in named_files(document).items():
        for path, data in files.items():
            write(folder / PLUGINS / path, data)
        source = str(source_of(name)[0]) if files else ""
        kept[name] = KeptPlugin(digest_of(name), source)
        if files:
            use_copy(name, kept_file(folder, name))
            # Without a state folder, ``--plugins`` is needed to use the copy again.
            with suppress(OSError, RuntimeError):
                mark = _mark_of(name, files)
                mark.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                mark.touch()
    refuse_other(folder, kept)
    return kept


def named_files(document: str) -> dict[str, dict[str, bytes]]:
    """Return files of plug-ins of JSON by module and path; errors are ``keep``'s."""
    found: dict[str, dict[str, bytes]] = {}
    every: dict[str, bytes] = {}
    for name in modules_named(document.encode()):
        if sources := source_of(name):
            found[name] = _files(name, sources[0]) if len(sources) == 1 else {}
            for path, data in found[name].items():
                if every.setdefault(path, data) != data:
                    what = f"its data file {path} differs from that of another plug-in"
                    raise ExperimentError(f"plug-in {name}: {what}: rename it")
    return found


def kept_file(folder: Path, name: str) -> Path:
    """Return the path of the copy of a plug-in in a run folder: file or package."""
    package = folder / PLUGINS / name
    return package if package.is_dir() else package.with_name(f"{name}.py")


def allow_kept(
    folder: Path, kept: Mapping[str, KeptPlugin], *, is_resumed: bool
) -> None:
    """Allow the plug-ins of a folder that the user named on the command line.

    The copies are used, unless the user has named or imported the same source herself.

    If the run continues, all sources must be those of its beginning.

    Raises:
        ExperimentError: another source than that of the run, or a copy that is missing,
            damaged or not written by a run of this user.
    """
    for name, note in kept.items():
        if is_chosen(name) if note.file else is_resumed:
            refuse_other(folder, {name: note})
        # A source that is found, as that of a Python script, stays in use.
        if not note.file or (not is_resumed and digest_of(name) == note.digest):
            continue
        copy = kept_file(folder, name)
        if not (problem := _problem(name, note, copy)):
            use_copy(name, copy)
        elif digest_of(name) != note.digest:
            raise ExperimentError(f"plug-in {name}: {copy} {problem}")


def refuse_other(folder: Path, kept: Mapping[str, KeptPlugin]) -> None:
    """Raise unless this process uses the sources that a folder was made with."""
    for name, note in kept.items():
        digest = digest_in_use(name)
        if digest == note.digest:
            continue
        what = f"has source digest {digest}" if digest else "is not installed"
        how = "install that version, or start another run"
        if note.file:
            entry = f"{FLAG} {name}={kept_file(folder, name)}"
            how = f"to use that one: {entry} (in Python: in a new process)"
        raise ExperimentError(
            f"plug-in {name}: {what}, but {folder} was made with {note.digest}: {how}"
        )


def _problem(name: str, note: KeptPlugin, copy: Path) -> str:
    """Return why a copy is not imported, and what to do; empty if it may be."""
    files = _files(name, copy)
    digest = digest_of_sources([copy] if files else [])
    if digest != note.digest:
        why = f"source digest {digest}, expected {note.digest}"
        return f"is damaged ({why}): give the original with {FLAG} FILE"
    with suppress(OSError, RuntimeError):
        if _mark_of(name, files).exists():
            return ""
    why = "was not written by a run of yours on this machine; an import runs its code"
    return f"{why}: if you trust it, add {FLAG} {name}={copy}"


def _files(name: str, source: Path) -> dict[str, bytes]:
    """Return the files of a plug-in by their path beside it; none if not copied."""
    root = source.parent
    try:
        if source.is_dir():
            paths = [path for path in source.rglob("*") if path.suffix != ".pyc"]
        else:
            text = source.read_text("utf-8", "replace")
            data = (path for path in root.iterdir() if path.suffix not in ("", ".py"))
            paths = [source, *(path for path in data if path.name in text)]
        paths = sorted(filter(Path.is_file, paths))
        size = sum(path.stat().st_size for path in paths)
        if size > MOST_PLUGIN_BYTES or any(path.suffix in _COMPILED for path in paths):
            return {}
        return {path.relative_to(root).as_posix(): path.read_bytes() for path in paths}
    except OSError as error:
        why = f"{error.filename}: {unreadable(error)}"
        give = f"give its source with {FLAG} FILE"
        raise ExperimentError(f"plug-in {name}: {why}; {give}") from None


def _mark_of(name: str, files: Mapping[str, bytes]) -> Path:
    """Return the file that says that a run of this user wrote a copy."""
    digests = {path: sha256(data).hexdigest() for path, data in files.items()}
    content = sha256(msgspec.json.encode((name, digests))).hexdigest()
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "revolve" / "plugins" / content
