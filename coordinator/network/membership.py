"""Agents of a fleet: which ones are alive, their properties, and which may join.

State only: liveliness tokens and agent infos in, dispatch events out.
"""

from google.protobuf.message import DecodeError

from coordinator.dispatch.events import AgentKind, Died, Joined, Left, Progressed
from schema.agent.topics import Member, member_of
from schema.errors import MalformedMessage
from schema.wire import revolve_pb2 as pb

MOST_SLOTS = 1024
MOST_SHARDS = 10_000
MOST_CORES = 4096
"""Limits of what an agent says that it can do."""
LONGEST_QUIET_S = 5.0
"""A job that used CPU time within this time makes progress [s]."""


class Membership:
    """All agents of a fleet whose token exists.

    Attributes:
        members: the agents by name, refused ones included.
        refused: agents that may not join, with the reasons.
    """

    def __init__(self, version: str) -> None:
        """Initialise without agents; ``version`` is the one that they must have."""
        self.members: dict[str, Member] = {}
        self.refused: dict[str, str] = {}
        self._version = version
        self._joined: set[str] = set()
        self._known_deaths: set[str] = set()

    def appear(self, key: str) -> Member | None:
        """Note a token; return its agent if that is new, else None.

        Raises:
            MalformedMessage: not the token of an agent.
        """
        member = member_of(key)
        if member.name in self.members:
            return None
        self.members[member.name] = member
        return member

    def vanish(self, key: str) -> Left | None:
        """Note that a token is gone; return the event if the agent had joined.

        Raises:
            MalformedMessage: not the token of an agent.
        """
        name = member_of(key).name
        self.members.pop(name, None)
        self.refused.pop(name, None)
        if name not in self._joined:
            return None
        self._joined.remove(name)
        return Left(name)

    def is_stranger(self, agent: str) -> bool:
        """Return whether an agent is alive but its properties are not known yet."""
        known = agent in self._joined or agent in self.refused
        return agent in self.members and not known

    def refuse(self, agent: str, why: str) -> Left | None:
        """Exclude an agent; return the event if it had joined.

        Args:
            agent: its name.
            why: for the user.
        """
        if agent not in self._joined:
            return None
        self._joined.remove(agent)
        self.refused[agent] = why
        return Left(agent)

    def introduce(self, agent: str, data: bytes) -> list[Died | Joined]:
        """Take an agent's description of itself and of the processes it replaces.

        Args:
            agent: a member without properties so far.
            data: bytes of an ``AgentInfo``.

        Returns:
            Deaths that were not known; last, if the agent may join, that it joined.

        Raises:
            MalformedMessage: not such bytes, another name or kind, or a capacity
                beyond the limits.
        """
        member = self.members[agent]
        info = self._info(agent, data)
        _check("slots", info.slots, MOST_SLOTS)
        if info.version != self._version:
            self.refused[agent] = (
                f"is of version {info.version!r}, the coordinator of {self._version!r}"
            )
            return []
        kind: AgentKind = "analyzer" if member.role == "analyzer" else "worker"
        if kind == "worker":
            _check("shards", info.shards, MOST_SHARDS)
            _check("cores", info.cores, MOST_CORES)
        self._joined.add(agent)
        joined = Joined(agent, kind, info.slots, info.platform, info.shards, info.cores)
        return [*self._new_dead(info), joined]

    def progress(self, agent: str, data: bytes) -> Progressed | None:
        """Return the event if an agent that has joined reports progress.

        Args:
            agent: its name; it may have left.
            data: bytes of an ``AgentInfo``.

        Raises:
            MalformedMessage: not such bytes, or another name or kind.
        """
        if agent not in self._joined:
            return None
        info = self._info(agent, data)
        works = info.HasField("quiet_s") and 0.0 <= info.quiet_s <= LONGEST_QUIET_S
        return Progressed(agent) if works else None

    def _info(self, agent: str, data: bytes) -> pb.AgentInfo:
        """Return a member's decoded description of itself.

        Raises:
            MalformedMessage: not the bytes of one, or another name or kind.
        """
        member = self.members[agent]
        try:
            info = pb.AgentInfo.FromString(data)
        except DecodeError as error:
            raise MalformedMessage(f"not the bytes of an AgentInfo: {error}") from None
        if (info.agent, info.kind) != (agent, member.role):
            says = f"{info.kind} {info.agent!r}"
            raise MalformedMessage(f"{member.role} {agent!r} says it is {says}")
        return info

    def _new_dead(self, info: pb.AgentInfo) -> list[Died]:
        new = [each for each in info.deaths if each.agent not in self._known_deaths]
        self._known_deaths.update(each.agent for each in new)
        return [
            Died(each.run, each.epoch, each.number, each.agent, each.cause[:100])
            for each in new
        ]


def _check(what: str, value: int, most: int) -> None:
    """Check a number that an agent says about itself.

    Raises:
        MalformedMessage: it is not from 1 to ``most``.
    """
    if not 1 <= value <= most:
        raise MalformedMessage(f"{what} of an agent must be 1 to {most}, got {value}")
