"""Packed robots: a zip with a robot, its settings, plug-ins, picture and origin.

The same content has the same bytes: its members have a fixed order, no times, and are
not compressed. ``contents.json`` has their digests. No code is imported here.
"""

from hashlib import sha256
from io import BytesIO
from itertools import filterfalse
from pathlib import Path
from typing import Literal
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import msgspec
from msgspec import Struct

from schema.errors import InvalidRobot, check_most, expectation, shown, unreadable
from schema.limits import MOST_PACKED_BYTES, MOST_PACKED_MEMBERS, Finite, printable
from schema.robot.ids import BirthId

PACKED = ".robot"
"""Ending of the files."""
CONTENTS, YAML, PROTOBUF = "contents.json", "robot.yaml", "robot.pb"
SETTINGS, PICTURE = "experiment.json", "picture.png"
SOURCES = "plugins/"
"""Beginning of the members that are files of plug-ins."""
_FIRST = (CONTENTS, YAML, PROTOBUF, SETTINGS, PICTURE)


class RobotOrigin(Struct, frozen=True, forbid_unknown_fields=True):
    """Birth of a robot in a run, its parents' births, and its fitness there, if any."""

    run_id: str
    birth: BirthId
    parents: tuple[BirthId, ...] = ()
    fitness: Finite | None = None


class Contents(Struct, frozen=True, forbid_unknown_fields=True):
    """What ``contents.json`` says about the other members.

    Attributes:
        revolve_robot: version of the format.
        digests: SHA-256 of each, in hexadecimal, by its name.
        plugins: digest of the source of each module, as workers compare it.
        origin: None, of a robot that was born in no run.
    """

    revolve_robot: Literal[1]
    digests: dict[str, str]
    plugins: dict[str, str] = {}
    origin: RobotOrigin | None = None


def archive_bytes(
    members: dict[str, bytes], plugins: dict[str, str], origin: RobotOrigin | None
) -> bytes:
    """Return the file of members, in their order; see ``Contents``.

    Raises:
        InvalidRobot: it would be too large, or have too many files.
    """
    contents = msgspec.json.encode(Contents(1, _digests(members), plugins, origin))
    file = BytesIO()
    with ZipFile(file, "w", ZIP_STORED) as packed:
        first = {CONTENTS: msgspec.json.format(contents, indent=1)}
        for name, data in (first | members).items():
            # Dated 1980, of one system: the same on every machine.
            about = ZipInfo(name)
            about.create_system, about.external_attr = 3, 0o644 << 16
            packed.writestr(about, data)
    _archive(file.getvalue())
    return file.getvalue()


def read_archive(path: Path) -> tuple[Contents, dict[str, bytes]]:
    """Return the contents of a packed robot, and its other members by name.

    Raises:
        InvalidRobot: the file cannot be read, is no packed robot or was changed.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MOST_PACKED_BYTES + 1)
        return _archive(data)
    except OSError as error:
        raise InvalidRobot(f"{path}: {unreadable(error)}") from None
    except InvalidRobot as error:
        raise InvalidRobot(f"{path}: {error}") from None
    except (BadZipFile, RuntimeError, ValueError) as error:  # of zipfile, msgspec
        why = printable(expectation(str(error)), 200)
        raise InvalidRobot(f"{path}: not a packed robot: {why}") from None


def _archive(data: bytes) -> tuple[Contents, dict[str, bytes]]:
    """Return the contents of bytes, and their other members; see ``read_archive``."""
    check_most(len(data), MOST_PACKED_BYTES, "bytes", "as a whole", InvalidRobot)
    entries = data.count(b"PK\x01\x02")  # before they become objects
    check_most(entries, MOST_PACKED_MEMBERS, "members", "as a whole", InvalidRobot)
    with ZipFile(BytesIO(data)) as packed:
        every = packed.infolist()
        sizes = (max(each.file_size, each.compress_size) for each in every)
        if sum(sizes) > len(data):
            raise InvalidRobot("its members must not be compressed or share bytes")
        members = {each.filename: packed.read(each) for each in every}
    for name in filterfalse(_is_member, members):
        what = f"must be {', '.join(_FIRST)} or a file below {SOURCES}"
        raise InvalidRobot(f"member {shown(name)}: {what}")
    contents = msgspec.json.decode(members.pop(CONTENTS, b""), type=Contents)
    digests = _digests(members)
    is_whole = len(every) == len(digests) + 1 and digests.keys() >= set(_FIRST[1:])
    if not is_whole or digests != contents.digests:
        raise InvalidRobot("was changed after it was packed: pack the robot again")
    return contents, members


def _is_member(name: str) -> bool:
    """Return whether a member may have a name; that of a file is a path below."""
    words = name.removeprefix(SOURCES).split("/")
    is_below = name.startswith(SOURCES) and not {"", ".", ".."}.intersection(words)
    return name in _FIRST or (is_below and "\\" not in name and name.isprintable())


def _digests(members: dict[str, bytes]) -> dict[str, str]:
    return {name: sha256(data).hexdigest() for name, data in members.items()}
