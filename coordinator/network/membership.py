"""Agents of a fleet: which are alive, when to ask for their properties, which may join.

State only: liveliness tokens and agent infos in, dispatch events out. Any process that
reaches the hub can declare tokens, so their number is limited, and a token says only
that the agent of its own key, role included, is to be asked.
"""

from collections import deque
from heapq import heappop, heappush
from itertools import count
from math import inf

from coordinator.dispatch.events import AgentKind, Joined, Left, Progressed
from coordinator.dispatch.faults import PeerFaults
from schema.agent.topics import FleetMember, member_of, slot_of
from schema.errors import MalformedMessage
from schema.limits import INFO_BYTES, LONGEST_QUIET_S, MOST_MEMBERS, printable
from schema.wire.codec import decode
from schema.wire.messages import AgentInfo, Crash

SHARE = 0.1
"""Greatest share of the coordinator's time that asking takes."""
ASK_AGAIN_S = 1.0
LONGEST_PAUSE_S = 32.0
_CAUSE_LENGTH = 100


class Membership:
    """All agents of a fleet whose token exists.

    Attributes:
        joined: agents that have joined, by name.
        refused: agents that may not join, with the reasons.
    """

    def __init__(self, version: str, faults: PeerFaults | None = None) -> None:
        """Initialise without agents; ``faults`` counts what is dropped."""
        self.joined: dict[str, FleetMember] = {}
        self.refused: dict[str, str] = {}
        self._faults = faults or PeerFaults()
        self._version = version
        self._alive: set[FleetMember] = set()
        # How often they were asked without an answer.
        self._silent: dict[FleetMember, int] = {}
        self._refused_members: dict[str, FleetMember] = {}
        # Agents that left and may have died of their job, oldest first.
        self._gone: dict[str, None] = {}

    def __len__(self) -> int:
        return len(self._alive)

    def __contains__(self, member: FleetMember) -> bool:
        return member in self._alive

    def appear(self, key: str) -> FleetMember | None:
        """Note a token; return its agent if that is to be asked for its properties.

        Beyond the limit it takes the place of an agent that does not answer; without
        such an agent it is dropped and counted.

        Raises:
            MalformedMessage: not the token of an agent.
        """
        member = member_of(key)
        if member in self._alive:
            return None
        if len(self._alive) >= MOST_MEMBERS:
            silent = next(iter(self._silent), None)
            self._faults.note(
                "crowd", (silent or member).name, f"{MOST_MEMBERS} agents"
            )
            if silent is None:
                return None
            self._forget(silent)
        self._alive.add(member)
        return member

    def vanish(self, key: str) -> Left | None:
        """Note that a token is gone; return the event if the agent had joined."""
        member = member_of(key)
        self._forget(member)
        name = member.name
        if self._refused_members.get(name) == member:
            del self._refused_members[name], self.refused[name]
        return self._leave(member)

    def is_stranger(self, member: FleetMember) -> bool:
        """Return whether an agent is alive but its properties are not known yet."""
        known = (self.joined.get(member.name), self._refused_members.get(member.name))
        return member in self._alive and member not in known

    def note_silence(self, member: FleetMember) -> Left | None:
        """Note that an agent does not answer; return the event if it had joined."""
        if member not in self._alive:
            return None
        self._silent[member] = self._silent.get(member, 0) + 1
        return self._leave(member)

    def silences(self, member: FleetMember) -> int:
        """Return how often an agent was asked without an answer."""
        return self._silent.get(member, 0)

    def introduce(self, member: FleetMember, data: bytes) -> list[Crash | Joined]:
        """Take an agent's description of itself and of the processes it replaces.

        Returns:
            Deaths that were not known; last, if the agent may join, that it joined.

        Raises:
            MalformedMessage: not such bytes, a number or text beyond its limit, another
                name or kind, or a name that an agent of the other kind has.
        """
        info = _parsed(member, data)
        agent = member.name
        if agent in self.joined or agent in self._refused_members:
            raise MalformedMessage(f"{member.role} {agent!r} has another agent's name")
        self._silent.pop(member, None)
        if info.version != self._version:
            version = printable(info.version)
            self._refused_members[agent] = member
            self.refused[agent] = (
                f"is of version {version!r}, the coordinator of {self._version!r}"
            )
            return []
        kind: AgentKind = "analyzer" if member.role == "analyzer" else "worker"
        self.joined[agent] = member
        joined = Joined(agent, kind, info.slots, info.platform, info.shards, info.cores)
        return [*self._new_deaths(member, info), joined]

    def progress(self, member: FleetMember, data: bytes) -> Progressed | None:
        """Return the event if an agent that has joined reports progress."""
        if self.joined.get(member.name) != member:
            return None
        info = _parsed(member, data)
        works = info.quiet_s is not None and 0.0 <= info.quiet_s <= LONGEST_QUIET_S
        return Progressed(member.name) if works else None

    def _forget(self, member: FleetMember) -> None:
        self._alive.discard(member)
        self._silent.pop(member, None)

    def _leave(self, member: FleetMember) -> Left | None:
        if self.joined.get(member.name) != member:
            return None
        del self.joined[member.name]
        self._gone[member.name] = None
        if len(self._gone) > MOST_MEMBERS:
            del self._gone[next(iter(self._gone))]
        return Left(member.name)

    def _new_deaths(self, member: FleetMember, info: AgentInfo) -> list[Crash]:
        """Return the deaths of an agent's predecessors, each once.

        Deaths of agents that never joined happened before this coordinator began.
        """
        crashes: list[Crash] = []
        for death in info.deaths:
            agent = death.job.agent
            is_same_slot = slot_of(agent) == slot_of(member.name) != ""
            if agent in self.joined or (agent in self._gone and not is_same_slot):
                self._faults.note("death", member.name, f"of {agent}")
            elif agent in self._gone:
                del self._gone[agent]
                cause = printable(death.cause, _CAUSE_LENGTH)
                crashes.append(Crash(death.job, cause))
        return crashes


class InfoQueue:
    """Order in which agents are asked: newest and oldest in turn, then silent ones.

    A query takes the hub longer the more tokens there are, milliseconds with thousands.
    Thousands of tokens without an agent must not delay the runs, nor an agent that came
    just before or comes just after them.

    Attributes:
        due_s: when the next agent is to be asked, by a monotonic clock [s]; infinite
            if none waits.
    """

    def __init__(self) -> None:
        self.due_s = inf
        self._new: deque[FleetMember] = deque(maxlen=MOST_MEMBERS)
        self._again: list[tuple[float, int, FleetMember]] = []
        self._order = count()
        self._pause_until_s = 0.0
        self._is_oldest_next = False

    def add(self, member: FleetMember) -> None:
        """Add an agent that is to be asked as soon as possible."""
        self._new.append(member)
        self._schedule()

    def add_again(self, member: FleetMember, silences: int, now_s: float) -> None:
        """Add an agent that is to be asked after a pause.

        ``silences``: how often it was asked without an answer.
        """
        pause_s = min(ASK_AGAIN_S * 2.0 ** min(silences - 1, 9), LONGEST_PAUSE_S)
        heappush(self._again, (now_s + pause_s, next(self._order), member))
        self._schedule()

    def take(self) -> FleetMember:
        """Remove and return the next agent to ask; call it when it is due."""
        if self._new:
            is_oldest = self._is_oldest_next
            self._is_oldest_next = not is_oldest
            member = self._new.popleft() if is_oldest else self._new.pop()
        else:
            member = heappop(self._again)[2]
        self._schedule()
        return member

    def spent(self, began_s: float, now_s: float) -> None:
        """Note how long asking one agent took; the next one has to wait accordingly."""
        self._pause_until_s = now_s + (now_s - began_s) * (1.0 / SHARE - 1.0)
        self._schedule()

    def _schedule(self) -> None:
        waits_s = 0.0 if self._new else self._again[0][0] if self._again else inf
        self.due_s = max(self._pause_until_s, waits_s)


def _parsed(member: FleetMember, data: bytes) -> AgentInfo:
    """Return the message of an agent's own properties; see ``introduce``."""
    role, agent = member.role, member.name
    try:
        info = decode(AgentInfo, data, INFO_BYTES)
    except MalformedMessage as error:
        raise MalformedMessage(f"{role} {agent!r}: {error}") from None
    if (info.agent, info.kind) != (agent, role):
        says = f"{printable(info.kind)} {printable(info.agent)!r}"
        raise MalformedMessage(f"{role} {agent!r} says: {says}")
    if not info.platform.isprintable():
        raise MalformedMessage(
            f"{role} {agent!r}: platform must be printable, got "
            f"{printable(info.platform)!r}"
        )
    return info
