"""Who is there: which agents live, what they say they are, who may take part.

Pure: tokens and introductions in, news for the dispatch machine out.
"""

from google.protobuf.message import DecodeError

from coordinator.dispatch.events import AgentKind, Died, Joined, Left
from schema.agent.topics import Member, member_of
from schema.errors import MalformedMessage
from schema.wire import revolve_pb2 as pb


class Membership:
    """All agents of a fleet whose token stands.

    Attributes:
        refused: those that may not take part, and why.
    """

    def __init__(self, version: str) -> None:
        """Begin with nobody; ``version`` is the one that agents must have."""
        self.members: dict[str, Member] = {}
        self.refused: dict[str, str] = {}
        self._version = version
        self._joined: set[str] = set()
        self._mourned: set[str] = set()

    def appear(self, key: str) -> Member | None:
        """Note a token; return whom to ask what it is, None if that is known.

        Raises:
            MalformedMessage: no agent's token.
        """
        member = member_of(key)
        if member.name in self.members:
            return None
        self.members[member.name] = member
        return member

    def vanish(self, key: str) -> Left | None:
        """Note that a token is gone; return what that means for jobs.

        Raises:
            MalformedMessage: no agent's token.
        """
        name = member_of(key).name
        self.members.pop(name, None)
        self.refused.pop(name, None)
        if name not in self._joined:
            return None
        self._joined.remove(name)
        return Left(name)

    def is_stranger(self, agent: str) -> bool:
        """Return whether an agent is there that has not said yet what it is."""
        known = agent in self._joined or agent in self.refused
        return agent in self.members and not known

    def refuse(self, agent: str, why: str) -> Left | None:
        """Let an agent take part no more; return what that means for jobs.

        Args:
            agent: that joined, or that is gone since.
            why: for the user.
        """
        if agent not in self._joined:
            return None
        self._joined.remove(agent)
        self.refused[agent] = why
        return Left(agent)

    def introduce(self, agent: str, data: bytes) -> list[Died | Joined]:
        """Take what an agent says of itself and of those whose place it took.

        Args:
            agent: that was asked; still a stranger.
            data: bytes of an ``AgentInfo``.

        Returns:
            Who died that was not known to be dead; last, if it may take part, that
            the agent joined.

        Raises:
            MalformedMessage: not such bytes, no slots, or it says it is another.
        """
        member = self.members[agent]
        try:
            info = pb.AgentInfo.FromString(data)
        except DecodeError as error:
            raise MalformedMessage(f"not the bytes of an AgentInfo: {error}") from None
        if (info.agent, info.kind) != (agent, member.role) or info.slots < 1:
            says = f"{info.kind} {info.agent!r} with {info.slots} slots"
            raise MalformedMessage(f"{member.role} {agent!r} says it is {says}")
        if info.version != self._version:
            self.refused[agent] = (
                f"is of version {info.version!r}, the coordinator of {self._version!r}"
            )
            return []
        self._joined.add(agent)
        kind: AgentKind = "analyzer" if member.role == "analyzer" else "worker"
        joined = Joined(agent, kind, info.slots, info.platform)
        return [*self._new_dead(info), joined]

    def _new_dead(self, info: pb.AgentInfo) -> list[Died]:
        new = [each for each in info.deaths if each.agent not in self._mourned]
        self._mourned.update(each.agent for each in new)
        return [
            Died(each.run, each.epoch, each.number, each.agent, each.cause[:100])
            for each in new
        ]
