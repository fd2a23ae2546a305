"""Contents of robot files, up to a greatest size."""

from pathlib import Path

from schema.errors import InvalidRobot, unreadable
from schema.experiment.bounded import read_bytes
from schema.limits import MOST_TEXT_BYTES


def read_data(path: Path, most: int = MOST_TEXT_BYTES) -> bytes:
    """Return the bytes of a file.

    Args:
        path: of the file.
        most: greatest allowed size [bytes].

    Raises:
        InvalidRobot: a file that cannot be read, or is larger.
    """
    try:
        return read_bytes(path, most)
    except OSError as error:
        raise InvalidRobot(f"{path}: {unreadable(error)}") from None


def read_text(path: Path, most: int = MOST_TEXT_BYTES) -> str:
    """Return the text of a file.

    Args:
        path: of the file.
        most: greatest allowed size [bytes].

    Raises:
        InvalidRobot: a file that cannot be read, is larger, or is not UTF-8.
    """
    try:
        return read_data(path, most).decode()
    except UnicodeDecodeError as error:
        raise InvalidRobot(f"{path}: not UTF-8 text (byte {error.start})") from None
