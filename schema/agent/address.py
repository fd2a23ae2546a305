"""Addresses of hubs: their forms, their defaults, and the one that a run folder names.

Processes of one user on one machine meet at a Unix socket in a directory that only this
user can enter. Other addresses are for a user who asks for them.
"""

import contextlib
import fcntl
import os
import re
import secrets
import socket
import stat
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from schema.agent.log import warn_user
from schema.errors import NetworkError

ADDRESS = "address"
"""File of a run or campaign folder that holds its hub's addresses, one in each line."""
UNIX = "unixsock-stream"
"""Protocol of Unix sockets."""
CONNECT_VARIABLE = "REVOLVE_CONNECT"
"""Environment variable with the default of ``--connect``."""
HUB = "hub"
"""Short form of the address of this user's hub on this machine."""
FORMS = "tcp/HOST:PORT, tls/HOST:PORT, unixsock-stream/PATH or hub"

_PROTOCOLS = ("tcp", "tls")
_ADDRESS = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):(\d{1,5})")
_SOCKET = re.compile(rf"{UNIX}/(/[!-~]+)")
_LAST_PORT = 65535
# The system's limit is 104 to 108 bytes, and the lock file's name has 5 more.
_LONGEST_PATH = 98
_LONGEST_FILE = 4096
_SETTLED_S = 5.0


class Address(NamedTuple):
    """Parts of an address.

    Attributes:
        protocol: "tcp", "tls" or "unixsock-stream".
        host: name or IP address without brackets; the path of a Unix socket.
        port: 0 lets the system choose one; 0 for a Unix socket.
    """

    protocol: str
    host: str
    port: int


def parse_address(address: str) -> Address:
    """Return the parts of an address.

    Raises:
        NetworkError: of no allowed form, or a path that is too long for a socket.
    """
    if match := _SOCKET.fullmatch(address):
        if len(match[1]) > _LONGEST_PATH:
            raise NetworkError(
                f"a socket's path must have at most {_LONGEST_PATH} characters, got "
                f"{len(match[1])}: {match[1]}"
            )
        return Address(UNIX, match[1], 0)
    match = _ADDRESS.fullmatch(address)
    if match is None or int(match[3]) > _LAST_PORT:
        raise NetworkError(f"an address must be {FORMS}, got {address[:200]!r}")
    return Address(match[1], match[2].strip("[]"), int(match[3]))


def user_hub() -> str:
    """Return the address of this user's hub on this machine.

    Raises:
        NetworkError: there is no directory that only this user can enter.
    """
    return f"{UNIX}/{runtime_directory() / 'hub.sock'}"


def new_socket() -> str:
    """Return the address of a Unix socket that no other process uses.

    Where no file system has the locks that it needs, it is an address of loopback.
    Errors are those of ``user_hub``.
    """
    # A run goes on when its user logs out.
    place, has_locks = _runtime(is_of_login=False)
    if not has_locks:
        warn_user(f"{place}: no file locks; 127.0.0.1 is used, which any user reaches")
        with socket.create_server(("127.0.0.1", 0)) as free:
            return f"tcp/127.0.0.1:{free.getsockname()[1]}"
    _remove_unused(place)
    return f"{UNIX}/{place / f'{secrets.token_hex(8)}.sock'}"


def _remove_unused(place: Path) -> None:
    """Remove the sockets that killed processes have left behind.

    The engine keeps a lock beside each socket while it listens. That of the user's hub
    stays: the next hub uses it again.
    """
    for lock in place.glob(f"{'?' * 16}.sock.lock"):
        with contextlib.suppress(OSError), lock.open("rb") as file:
            # A new socket's lock may be created but not taken yet.
            if time.time() - lock.stat().st_mtime > _SETTLED_S:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                lock.with_suffix("").unlink(missing_ok=True)
                lock.unlink()


def runtime_directory() -> Path:
    """Return the directory of this user's sockets; create it if it is missing.

    It is ``revolve`` in ``$XDG_RUNTIME_DIR``, else ``revolve-UID`` among the temporary
    files or in ``/tmp``: the first that can be used and has file locks. Nobody but its
    owner can enter it.

    Raises:
        NetworkError: it cannot be created, or others could enter it.
    """
    return _runtime(is_of_login=True)[0]


def _runtime(*, is_of_login: bool) -> tuple[Path, bool]:
    """Return ``runtime_directory``, and whether its file system has locks.

    That of the login may be removed when the user logs out.
    """
    login, own = os.environ.get("XDG_RUNTIME_DIR"), f"revolve-{os.getuid()}"
    places = [Path("/tmp") / own]  # noqa: S108 - refused if it is not private
    with contextlib.suppress(OSError):
        places.insert(0, Path(tempfile.gettempdir()) / own)
    if login:
        places.insert(0 if is_of_login else 1, Path(login) / "revolve")
    places = list(filter(_is_usable, places)) or places[:1]
    for place in places:
        _make_private(place)
        if can_lock(place):
            return place, True
    return places[0], False


def _is_usable(place: Path) -> bool:
    """Return whether this user may have a directory there, and paths fit sockets."""
    longest = f"{place}/{secrets.token_hex(8)}.sock"
    is_path = _SOCKET.fullmatch(f"{UNIX}/{longest}") and len(longest) <= _LONGEST_PATH
    existing = place if os.path.lexists(place) else place.parent
    return bool(is_path) and os.access(existing, os.W_OK)


def can_lock(folder: Path) -> bool:
    """Return whether a folder's file system has locks; True if that is unknown."""
    with contextlib.suppress(OSError), tempfile.TemporaryFile(dir=folder) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:
            return False
    return True


def _make_private(place: Path) -> None:
    try:
        place.mkdir(mode=0o700, exist_ok=True)
        facts = place.lstat()
    except OSError as error:
        why = f"{error.strerror}; set XDG_RUNTIME_DIR to another directory"
        raise NetworkError(f"{place}: cannot be used: {why}") from None
    is_private = stat.S_IMODE(facts.st_mode) == stat.S_IRWXU
    if not (stat.S_ISDIR(facts.st_mode) and is_private and facts.st_uid == os.getuid()):
        raise NetworkError(
            f"{place}: must be a directory of this user with mode 0700, or others "
            "could join the fleet: remove it, or set XDG_RUNTIME_DIR"
        )


def hub_of(place: str) -> str:
    """Return the address that a user means: an address, or a run folder's.

    Raises:
        NetworkError: neither; or the folder's file is missing or damaged.
    """
    if place == HUB:
        return user_hub()
    folder = Path(place)
    is_address = place.startswith(tuple(f"{name}/" for name in (*_PROTOCOLS, UNIX)))
    if folder.is_dir() or not is_address:
        return read_address(folder)
    parse_address(place)
    return place


def read_address(folder: Path) -> str:
    """Return the address of the hub of an active run or campaign.

    A Unix socket comes first, if it is on this machine: it needs no certificates.

    Raises:
        NetworkError: no such folder, no active run, or a damaged file.
    """
    file = folder / ADDRESS
    if not folder.is_dir():
        raise NetworkError(
            f"must be {FORMS}, or the folder of an active run; no such folder: "
            f"{str(folder)!r}"
        )
    try:
        with file.open("rb") as source:
            lines = source.read(_LONGEST_FILE).decode("ascii").split()
        addresses = [(line, parse_address(line)) for line in lines]
    except FileNotFoundError:
        raise NetworkError(
            f"{folder}: no coordinator is running ({ADDRESS} is missing)"
        ) from None
    except (OSError, ValueError, NetworkError) as error:
        raise NetworkError(
            f"{file}: damaged ({error}): give the address itself to --connect"
        ) from None
    here = [
        address
        for address, parts in addresses
        if parts.protocol != UNIX or os.access(parts.host, os.W_OK)
    ]
    if not here:
        raise NetworkError(f"{file}: no address that this machine can reach")
    return min(here, key=lambda address: not address.startswith(UNIX))
