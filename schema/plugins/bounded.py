"""Texts of other people: read from files and parsed within limits."""

import errno
import re
import tomllib
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from schema.errors import ExperimentError, RevolveError, check_most, unreadable
from schema.limits import (
    MOST_BRACKETS,
    MOST_DEPTH,
    MOST_DIGITS,
    MOST_KEY_PARTS,
    MOST_TEXT_BYTES,
    MOST_XML_ATTRIBUTES,
    MOST_XML_TAGS,
)

# ``tomllib`` stores all beginnings of a dotted key. Possessive: without backtracking.
_KEY_PART = r"""(?:[\w-]++|"(?:[^"\\\n]++|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_NUMBER = re.compile(rf"(?<!\w)[0-9][0-9A-Fa-f_xob]{{{MOST_DIGITS}}}")
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_KEY_PART}){{{MOST_KEY_PARTS}}}")


def read_bytes(path: Path, most: int = MOST_TEXT_BYTES) -> bytes:
    """Return the bytes of a file, at most so many.

    Raises:
        OSError: the file cannot be read, or is larger (errno ``EFBIG``).
    """
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"must have <= {most} bytes, got more")
    return data


def text_of(
    path: Path,
    where: str,
    near: str = "",
    *,
    most: int = MOST_TEXT_BYTES,
    kind: type[RevolveError] = ExperimentError,
) -> str:
    """Return the text of a user's file.

    ``where`` begins the message of an error, ``near`` ends it if the file is missing.

    Raises:
        RevolveError: of that kind: the file cannot be read, is too large, or no text.
    """
    try:
        # With the byte order mark of editors of Windows.
        return read_bytes(path, most).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise kind(f"{where}: {unreadable(error, near)}") from None


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the document of a TOML text.

    Raises:
        ExperimentError: not TOML, or beyond a limit.
    """
    check_most(len(text), MOST_TEXT_BYTES, "characters", where, ExperimentError)
    tables = "lists and tables"
    check_most(text.count("["), MOST_BRACKETS, tables, where, ExperimentError)
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


def parse_xml(
    text: str, most: int = MOST_TEXT_BYTES, most_depth: int = MOST_DEPTH
) -> ET.Element:
    """Return the root of an XML text that has no document type and so no entities.

    Raises:
        ValueError: not XML, a document type, or beyond a limit.
    """
    # Counted before parsing; text that holds these signs counts, too.
    for name, count, limit in (
        ("characters", len(text), most),
        ("tags", text.count("<"), MOST_XML_TAGS),
        ("attributes", text.count("="), MOST_XML_ATTRIBUTES),
    ):
        if count > limit:
            raise ValueError(f"must have <= {limit} {name}, got {count}")
    if "<!DOCTYPE" in text:
        raise ValueError("a document type (<!DOCTYPE ...>) is not allowed")
    try:
        root = ET.fromstring(text)  # noqa: S314 - without entities, and measured
    except ET.ParseError as error:
        raise ValueError(f"not valid XML: {error}") from None
    level, depth = list(root), 1
    while level:
        depth += 1
        if depth > most_depth:
            raise ValueError(f"must have <= {most_depth} levels of nesting, got more")
        level = [child for element in level for child in element]
    return root


def is_finite(value: str) -> bool:
    """Return whether no word of a text is inf or nan, which MuJoCo accepts."""
    return all(map(_is_finite_word, value.split()))


def _is_finite_word(word: str) -> bool:
    try:
        return isfinite(float(word))
    except ValueError:
        return True
