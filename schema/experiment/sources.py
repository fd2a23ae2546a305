"""Texts of experiments: shipped ones, TOML files, and files that these name."""

import re
import tomllib
from collections.abc import Collection
from importlib import resources
from pathlib import Path
from typing import Any

from schema.errors import ExperimentError, nearest, unreadable
from schema.experiment.bounded import read_bytes
from schema.limits import MOST_BRACKETS, MOST_DIGITS, MOST_KEY_PARTS, MOST_TEXT_BYTES

# ``tomllib`` stores all beginnings of a dotted key. Possessive: without backtracking.
_KEY_PART = r"""(?:[\w-]++|"(?:[^"\\\n]++|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_NUMBER = re.compile(rf"(?<!\w)[0-9][0-9A-Fa-f_xob]{{{MOST_DIGITS}}}")
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_KEY_PART}){{{MOST_KEY_PARTS}}}")


def source_text(source: str) -> tuple[str, str]:
    """Return the TOML text of an experiment, and its path for ``parse_toml``.

    Args:
        source: as for ``read_experiment``.

    Raises:
        ExperimentError: no such experiment or file.
    """
    if source.endswith(".toml"):
        path = Path(source)
        near = near_files(path)
        if not path.exists() and path.stem in shipped_experiments():
            near = f"; did you mean {path.stem!r}, which is shipped?"
        return text_of(path, source, near), source
    check_source(source, shipped_experiments())
    folder = resources.files("schema.experiment") / "shipped"
    return (folder / f"{source}.toml").read_text(encoding="utf-8"), f"{source}.toml"


def text_of(path: Path, where: str, near: str = "") -> str:
    """Return the text of a user's file.

    Args:
        path: of the file.
        where: begins the message of an error.
        near: ends it if the file is missing.

    Raises:
        ExperimentError: the file cannot be read, is too large, or is no text.
    """
    try:
        # With the byte order mark of editors of Windows.
        return read_bytes(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        ending = near if isinstance(error, FileNotFoundError) else ""
        raise ExperimentError(f"{where}: {unreadable(error)}{ending}") from None


def check_source(source: str, shipped: Collection[str]) -> None:
    """Raise unless a source is the path of a TOML file or a shipped name.

    Raises:
        ExperimentError: neither; the message names the nearest, or says what a path
            of another kind leads to.
    """
    if source.endswith(".toml") or source in shipped:
        return
    path = Path(source)
    if path.is_dir():
        raise ExperimentError(
            f"{source}: is a folder; an experiment is a .toml file or a shipped name"
        )
    beside = f"{source}.toml"
    if path.is_file() or (path.suffix and not Path(beside).is_file()):
        and_missing = "" if path.is_file() else ", and there is no such file"
        raise ExperimentError(
            f"{source}: the file of an experiment must end in .toml, got "
            f"{path.suffix!r}{and_missing}{'' if path.is_file() else near_files(path)}"
        )
    near = nearest(source, [*shipped, *([beside] if Path(beside).is_file() else ())])
    raise ExperimentError(
        f"{source}: no such experiment{near}; shipped are {', '.join(shipped)}, or "
        "give a path to a .toml file"
    )


def near_files(missing: Path) -> str:
    """Return ``; did you mean 'x'?`` for a TOML file with a similar name beside it."""
    return nearest(str(missing), [str(each) for each in missing.parent.glob("*.toml")])


def shipped_experiments() -> list[str]:
    """Return the names of the experiments that come with the package."""
    folder = resources.files("schema.experiment") / "shipped"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the document of a TOML text.

    Raises:
        ExperimentError: not TOML, too long, nested too deeply, or a key of too many
            parts.
    """
    if len(text) > MOST_TEXT_BYTES:
        raise ExperimentError(
            f"{where}: must have <= {MOST_TEXT_BYTES} characters, got {len(text)}"
        )
    if (brackets := text.count("[")) > MOST_BRACKETS:
        raise ExperimentError(
            f"{where}: must have <= {MOST_BRACKETS} lists and tables, got {brackets}"
        )
    if _LONG_KEY.search(text):
        raise ExperimentError(f"{where}: a key must have <= {MOST_KEY_PARTS} parts")
    if _LONG_NUMBER.search(text):
        raise ExperimentError(f"{where}: a number must have <= {MOST_DIGITS} digits")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ExperimentError(f"{where}: not valid TOML: nested too deeply") from None
    except ValueError as error:
        # Too long an integer is no TOMLDecodeError.
        reason = str(error).partition(";")[0]
        raise ExperimentError(f"{where}: not valid TOML: {reason}") from None
