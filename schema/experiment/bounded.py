"""Texts of other people: read from files and parsed within limits."""

import errno
from math import isfinite
from pathlib import Path
from xml.etree import ElementTree as ET

from schema.limits import (
    MOST_DEPTH,
    MOST_NODES,
    MOST_TEXT_BYTES,
    MOST_XML_ATTRIBUTES,
)


def read_bytes(path: Path, most: int = MOST_TEXT_BYTES) -> bytes:
    """Return the bytes of a file.

    Args:
        path: of the file.
        most: greatest allowed size.

    Raises:
        OSError: the file cannot be read, or is larger (errno ``EFBIG``).
    """
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"must have <= {most} bytes, got more")
    return data


def parse_xml(
    text: str, most: int = MOST_TEXT_BYTES, most_depth: int = MOST_DEPTH
) -> ET.Element:
    """Return the root of an XML text that has no document type and so no entities.

    Args:
        text: the document.
        most: greatest allowed length.
        most_depth: greatest allowed number of levels.

    Raises:
        ValueError: not XML; a document type; too long, too deep, too many elements or
            attributes.
    """
    # Counted before parsing; text that holds these signs counts, too.
    for name, count, limit in (
        ("characters", len(text), most),
        ("elements", text.count("<"), 2 * MOST_NODES),
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
