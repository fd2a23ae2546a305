"""Keys of the processes of a fleet.

``revolve/{fleet}/w/{worker}/...``, ``.../an/{analyzer}/...``,
``.../co/{coordinator}/...``: all keys of a process have one prefix, so that one access
rule covers them. A process that restarts takes a new name, so that it gets no messages
for its predecessor.
"""

import re
import secrets
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Literal

from schema.errors import MalformedMessage, NetworkError
from schema.limits import printable

Role = Literal["worker", "analyzer", "coordinator"]

_CHUNKS: dict[Role, str] = {"worker": "w", "analyzer": "an", "coordinator": "co"}
_ROLES: dict[str, Role] = {chunk: role for role, chunk in _CHUNKS.items()}
KEYS = (
    *("jobs", "alive", "info", "cancelled", "command", "state", "events", "trial"),
    *("migrants", "announced"),
)
"""Attributes of a member that are keys, by their last word."""
# No key separator, no wildcard, no leading "@", which the engine reserves.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,95}")


@dataclass(frozen=True, slots=True)
class FleetMember:
    """A process of a fleet; a fleet serves many runs.

    Attributes:
        name: its own, never used again.
        session: id of the process's Zenoh session, hexadecimal. A hub accepts one
            session of an id at a time, and a reply carries the id of the session that
            gave it. Only the process itself can thus reply in its name.
        jobs: key that takes one ``Request`` and gives one ``Answer``.
        alive: key of the liveliness token of the process.
        info: key that gives the ``AgentInfo`` of the process.
        cancelled: key that takes the fingerprint of a ``Request`` that is no longer
            wanted.
        command: key that takes one ``OperatorRequest`` and gives one ``OperatorReply``.
        state: key that gives viewers an ``Update`` of everything since the beginning.
        events: key on which an ``Update`` appears when something has happened.
        trial: key on which ``revolve doctor`` tries the rights of a certificate.
        migrants: key that takes one ``MigrantsRequest`` of a coordinator that runs
            another group of islands, and gives the reply.
        announced: key on which 8 bytes appear, which name a group of islands, when it
            has sent migrants.
    """

    fleet: str
    role: Role
    name: str
    session: str = field(init=False, compare=False)
    jobs: str = field(init=False, compare=False)
    alive: str = field(init=False, compare=False)
    info: str = field(init=False, compare=False)
    cancelled: str = field(init=False, compare=False)
    command: str = field(init=False, compare=False)
    state: str = field(init=False, compare=False)
    events: str = field(init=False, compare=False)
    trial: str = field(init=False, compare=False)
    migrants: str = field(init=False, compare=False)
    announced: str = field(init=False, compare=False)

    def __post_init__(self) -> None:
        # Once per process and not for each job.
        for key in KEYS:
            object.__setattr__(self, key, f"{self._prefix}/{key}")
        # An id must not begin with 0.
        session = f"a{sha256(self._prefix.encode()).hexdigest()[:31]}"
        object.__setattr__(self, "session", session)

    def poses(self, shard: int) -> str:
        """Key on which a ``Live`` is published after each advance of a shard."""
        return f"{self._prefix}/arena/{shard}/pose"

    @property
    def _prefix(self) -> str:
        return f"revolve/{self.fleet}/{_CHUNKS[self.role]}/{self.name}"


def key_of_all(fleet: str, role: Role, key: str) -> str:
    """Return the key expression of a key of all members of a role."""
    return f"revolve/{fleet}/{_CHUNKS[role]}/*/{key}"


def member_of(key: str) -> FleetMember:
    """Return the process of a liveliness token; ``MalformedMessage`` for other keys."""
    chunks = key.split("/")
    if len(chunks) == 5 and (chunks[0], chunks[4]) == ("revolve", "alive"):  # noqa: PLR2004 - five chunks
        _, fleet, chunk, name, _ = chunks
        if chunk in _ROLES and _NAME.fullmatch(fleet) and _NAME.fullmatch(name):
            return FleetMember(fleet, _ROLES[chunk], name)
    raise MalformedMessage(
        f"must be revolve/FLEET/w|an|co/NAME/alive, got {printable(key)!r}"
    )


def check_name(name: str, what: str) -> str:
    """Return a name if it is valid in a key.

    Raises:
        NetworkError: empty, too long, or with other characters.
    """
    if not _NAME.fullmatch(name):
        raise NetworkError(
            f"{what}: must be 1 to 96 letters, digits, '.', '_' or '-', "
            f"beginning with a letter or digit, got {name!r}"
        )
    return name


def slot_of(name: str) -> str:
    """Return what the names of a process and its successors, unique, have in common."""
    return name.rpartition(".")[0]


def unique_name(name: str) -> str:
    """Return a name that is unique among all processes."""
    return f"{name}.{secrets.token_hex(4)}"
