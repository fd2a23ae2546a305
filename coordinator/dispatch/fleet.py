"""Agents that all runs of this process share, and the routing of their jobs.

The jobs of all runs are numbered from one sequence and assigned by the same state
machines. Runs are therefore independent of each other, and none can take all workers.
An answer is returned to the client that requested the job, which interprets it.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Literal, Protocol

from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.events import (
    AskProgress,
    Assign,
    AssignShard,
    Cancel,
    CancelShard,
    Client,
    ClientEnded,
    Crowded,
    Deliver,
    DispatchCommand,
    DispatchEvent,
    Expired,
    Job,
    Joined,
    Killed,
    Left,
    Overdue,
    Read,
    Released,
    Requested,
    Returned,
    ShardCommand,
    ShardDone,
    ShardEvent,
    ShardFailed,
    ShardRequested,
    ShardReturned,
    ShardSeen,
    Ticked,
)
from coordinator.dispatch.faults import PeerFaults
from coordinator.dispatch.pool import longer_s
from coordinator.dispatch.shards import ShardDispatch
from schema.errors import MalformedMessage, RunFolderError
from schema.wire.codec import fingerprint
from schema.wire.messages import Crash


class Agents(Protocol):
    """Connection to the agents: a network, or functions in this process."""

    def send(self, number: int, agent: str, payload: bytes, wait_s: float, /) -> None:
        """Send a job to an agent; ``receive`` returns its outcome.

        Args:
            number: of the job.
            agent: that gets it.
            payload: an encoded request.
            wait_s: time without a reply after which its outcome is "expired" [s].
        """

    def cancel(self, _agent: str, _payload: bytes, /) -> None:
        """Tell an agent, by the job's request, that a job is no longer wanted."""

    def ask(self, agent: str, /) -> None:
        """Ask an agent for its progress; ``receive`` returns a report, if any."""

    def receive(
        self, timeout_s: float, pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        """Return events: those of a pause, or else the first ones after it."""


Encode = Callable[[AssignShard], tuple[bytes, Read]]
"""Returns the request of an advance, and what decodes and checks its answer.

It raises ``RunFolderError`` if a state that the request needs cannot be read.
"""

End = Deliver | ShardDone | ShardFailed
"""Result of a job or an advance, as its client receives it."""


@dataclass(frozen=True, slots=True)
class Fenced:
    """An agent refused a client's job as that of a replaced coordinator."""

    client: Client
    agent: str
    reason: str


class JobRouter:
    """Workers and analyzers, the jobs of all runs, and the routing between them.

    Attributes:
        dispatch: assigns jobs about single robots.
        shards: assigns arena shards; their numbers are unique within this process.
        faults: counts of what agents sent and nothing used.
    """

    def __init__(
        self,
        agents: Agents,
        *,
        allows_drift: bool = False,
        warn: Callable[[str], None] = lambda _line: None,
        faults: PeerFaults | None = None,
    ) -> None:
        """Connect to agents.

        Args:
            agents: the connection to them.
            allows_drift: an arena may move to another platform if its own is gone.
            warn: called with each line for the user.
            faults: counts that the connection shares; None: counts of its own.
        """
        self._warn = warn
        self._numbers = count(1)
        self.faults = faults or PeerFaults()
        self.dispatch = Dispatch(self.faults)
        self.shards = ShardDispatch(
            self._numbers, self.dispatch.workers, allows_drift=allows_drift
        )
        self._fenced: list[Fenced] = []
        self._agents = agents
        self._shard_numbers = count()
        self._shard_clients: dict[int, tuple[Client, Encode]] = {}
        self._advance_reads: dict[int, Read] = {}
        # Shard and request of each job of an advance that has not ended.
        self._advances: dict[int, tuple[int, bytes]] = {}
        self._ends: dict[Client, list[End]] = {}
        self._advancing: set[int] = set()

    @property
    def open(self) -> int:
        """How many jobs and advances are requested and not done."""
        return self.dispatch.pending + len(self._advancing)

    def new_number(self) -> int:
        """Return a number for a job."""
        return next(self._numbers)

    def request(self, job: Job) -> None:
        """Request a job."""
        self._obey(self.dispatch.handle(Requested(job)))

    def new_shard(
        self, client: Client, encode: Encode, platform: str, *, may_drift: bool = True
    ) -> int:
        """Return a number for an arena's shard.

        Args:
            client: the run of the arena.
            encode: returns the request of each advance when it is assigned.
            platform: on which the shard has been advanced; empty if never.
            may_drift: it may move to another platform, if arenas may.
        """
        shard = next(self._shard_numbers)
        self._shard_clients[shard] = (client, encode)
        self._move(ShardSeen(shard, platform, may_drift, client))
        return shard

    def advance(self, shard: int, simulated_s: float | None = None) -> None:
        """Request an advance of a shard; its client gives the last step."""
        self._advancing.add(shard)
        self._move(ShardRequested(shard, simulated_s))

    def leave(self, client: Client) -> None:
        """Drop all jobs and shards of a client."""
        self._obey(self.dispatch.handle(ClientEnded(client)))
        for shard, (owner, _) in list(self._shard_clients.items()):
            if owner == client:
                self.release(shard)

    def release(self, shard: int) -> None:
        """Drop a shard, and its advance if one is requested."""
        del self._shard_clients[shard]
        self._advancing.discard(shard)
        self._forget_advances(shard)
        self._move(Released(shard))

    def listen(self, timeout_s: float, now_s: float) -> dict[Client, list[End]]:
        """Return what ended for each client, after waiting for something to end.

        Args:
            timeout_s: how long to wait for the first event [s].
            now_s: the time, of a monotonic clock [s].
        """
        wakes = [self.dispatch.wake_s]
        if self._shard_clients:
            wakes.append(self.shards.wake_s)
        for wake_s in wakes:
            if wake_s is not None:
                timeout_s = min(timeout_s, max(0.0, wake_s - now_s))
        self.tell(Ticked(now_s))
        # Waking up for each answer would cost more than the answers themselves.
        pause_s = 0.0 if self._advancing else self.dispatch.pause_s
        for event in self._agents.receive(timeout_s, min(timeout_s, pause_s)):
            self.tell(event)
        ends, self._ends = self._ends, {}
        return ends

    def tell(self, event: DispatchEvent) -> None:
        """Handle an event of agents, of jobs or of time."""
        if isinstance(event, Returned) and event.outcome == "expired":
            if self._send_again(event):
                return
            event = replace(event, outcome="lost")
        if isinstance(event, Returned) and event.outcome in ("fenced", "cancelled"):
            self._note_declined(event)
        if isinstance(event, Crash):
            shard = self.shards.shard_that_lost(event.job.number)
            if shard is not None:
                self._advance_killed(event, shard)
                return
        if isinstance(event, Returned) and event.number in self._advance_reads:
            read = self._advance_reads.pop(event.number)
            if self.shards.shard_of(event.number) is not None:
                self._move(self._read_advance(event, read))
            elif event.outcome == "ok":
                self.faults.note("late", event.agent, f"job {event.number}")
        self._obey(self.dispatch.handle(event))
        if isinstance(event, Joined | Left | Ticked):
            self._move(event)

    def _send_again(self, event: Returned) -> bool:
        """Send a job again to the agent that has it; return whether it has it.

        An agent keeps what it works at, however long that takes. It answers a request
        that comes again from memory if the job took long or is an arena's last advance.
        """
        number, agent = event.number, event.agent
        shard = self.shards.shard_of(number)
        if shard is None:
            payload = self.dispatch.payload(number, agent)
        else:
            payload = self._advances[number][1]
        if payload is None:
            return False
        self._agents.send(number, agent, payload, longer_s(event.took_s or 0.0))
        expired = Expired(number, agent)
        if shard is None:
            self._obey(self.dispatch.handle(expired))
        else:
            self._move(expired)
        return True

    def _advance_killed(self, event: Crash, shard: int) -> None:
        """Pass on that an advance crashed its worker, if it was this client's."""
        client, _ = self._shard_clients[shard]
        crashed = event.job
        if client != (crashed.run, crashed.epoch):
            return
        of, payload = self._advances.get(crashed.number, (-1, b""))
        if (of, fingerprint(payload)) == (shard, crashed.request):
            self._move(Killed(crashed.number, crashed.agent, event.cause))
        else:
            self.faults.note("death", crashed.agent, f"job {crashed.number}")

    def fenced(self) -> list[Fenced]:
        """Return the jobs refused since the last call as of replaced coordinators."""
        fenced, self._fenced = self._fenced, []
        return fenced

    def _note_declined(self, event: Returned) -> None:
        """Note a job that its agent did not try, if the job is still wanted."""
        shard = self.shards.shard_of(event.number)
        if shard is None:
            client = self.dispatch.client(event.number)
        else:
            client, _ = self._shard_clients[shard]
        if client is None:
            return
        if event.outcome == "fenced":
            self._fenced.append(Fenced(client, event.agent, event.reason))
        else:
            self.faults.note("cancelled", event.agent, f"job {event.number}")

    def _read_advance(self, event: Returned, read: Read) -> ShardReturned:
        """Return the outcome of an advance."""
        if event.outcome != "ok":
            if event.outcome not in ("error", "unfit"):
                return ShardReturned(event.number, "lost")
            self.faults.note("refused", event.agent, event.reason)
            return ShardReturned(event.number, event.outcome, event.reason)
        try:
            answer = read(event.answer)
        except MalformedMessage as error:
            self.faults.note("malformed", event.agent, str(error))
            # A machine that computes differently lies no more than one that fails.
            differs = error.kind == "differs"
            outcome: Literal["error", "malformed"] = "error" if differs else "malformed"
            return ShardReturned(event.number, outcome, str(error))
        if answer is None:
            return ShardReturned(event.number, "stateless")
        return ShardReturned(event.number, "done", answer=answer)

    def _obey(self, commands: Iterable[DispatchCommand | ShardCommand]) -> None:
        for command in commands:
            match command:
                case Assign(job, agent):
                    wait_s = self.dispatch.wait_s(job)
                    self._agents.send(job.number, agent, job.payload, wait_s)
                case Cancel(job, agent):
                    self._agents.cancel(agent, job.payload)
                case Deliver(job):
                    self._ends.setdefault(job.client, []).append(command)
                case AssignShard():
                    self._assign_advance(command)
                case CancelShard(number, _, agent):
                    self._agents.cancel(agent, self._advances[number][1])
                case ShardDone(shard) | ShardFailed(shard):
                    self._advancing.discard(shard)
                    self._forget_advances(shard)
                    client = self._shard_clients[shard][0]
                    self._ends.setdefault(client, []).append(command)
                case AskProgress(agent):
                    self._agents.ask(agent)
                case Crowded() | Overdue():
                    self._warn(_line(command))

    def _assign_advance(self, command: AssignShard) -> None:
        """Send an advance to a worker, or give it up if its request cannot be made."""
        number, shard, agent = command.number, command.shard, command.agent
        try:
            payload, read = self._shard_clients[shard][1](command)
        except RunFolderError as error:
            self._move(ShardReturned(number, "unsent", str(error)))
            # Its worker is free again.
            self._obey(self.dispatch.handle(Returned(number, agent, "lost")))
            return
        self._advance_reads[number] = read
        self._advances[number] = (shard, payload)
        self._agents.send(number, agent, payload, self.shards.wait_s(command))

    def _move(self, event: ShardEvent) -> None:
        """Pass an event to ``shards``, and carry out its commands."""
        self._obey(self.shards.handle(event))

    def _forget_advances(self, shard: int) -> None:
        for number in [n for n, (of, _) in self._advances.items() if of == shard]:
            del self._advances[number]


def _line(command: Crowded | Overdue) -> str:
    """Return what the user is told."""
    if isinstance(command, Crowded):
        return (
            f"the workers keep {command.kept} arenas and have {command.shards}: those "
            "in excess are rebuilt each time; start more workers"
        )
    then = "another one takes" if command.to else "no other agent can take"
    return (
        f"{command.agent} has not answered for {command.waited_s:.0f} s and reports no "
        f"progress: {then} its jobs"
    )
