"""Agents that all runs of this process share, and the routing of their jobs.

The jobs of all runs are numbered from one sequence and assigned by the same state
machines. Runs are therefore independent of each other, and none can take all workers.
An answer is returned to the client that requested the job, which interprets it.
"""

from collections.abc import Callable, Sequence
from itertools import count
from typing import Protocol

from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.events import (
    Assign,
    AssignShard,
    Client,
    Deliver,
    Died,
    DispatchCommand,
    DispatchEvent,
    Job,
    Joined,
    Killed,
    Left,
    Read,
    Released,
    Requested,
    Returned,
    ShardDone,
    ShardEvent,
    ShardFailed,
    ShardRequested,
    ShardReturned,
    ShardSeen,
    Ticked,
    Withdrawn,
)
from coordinator.dispatch.shards import ShardDispatch
from schema.errors import MalformedMessage


class Agents(Protocol):
    """Connection to the agents: a network, or functions in this process."""

    def send(self, number: int, agent: str, payload: bytes) -> None:
        """Send a job to an agent; ``receive`` returns its outcome."""

    def cancel(self, _agent: str, _payload: bytes, /) -> None:
        """Tell an agent, by the job's request, that a job is no longer wanted."""

    def receive(
        self, timeout_s: float, pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        """Return events: those of a pause, or else the first ones after it."""


Encode = Callable[[AssignShard], tuple[bytes, Read]]
"""Returns the request of an advance, and what decodes and checks its answer."""

End = Deliver | ShardDone | ShardFailed
"""Result of a job or an advance, as its client receives it."""


class Fleet:
    """Workers and analyzers, the jobs of all runs, and the routing between them.

    Attributes:
        dispatch: assigns jobs about single robots.
        shards: assigns arena shards; their numbers are unique within this process.
    """

    def __init__(self, agents: Agents, *, allows_drift: bool = False) -> None:
        """Connect to agents.

        Args:
            agents: the connection to them.
            allows_drift: an arena may move to another platform if its own is gone.
        """
        self._numbers = count(1)
        self.dispatch = Dispatch()
        self.shards = ShardDispatch(self._numbers, allows_drift=allows_drift)
        self._malformed = 0
        self._agents = agents
        self._shard_numbers = count()
        self._shard_clients: dict[int, tuple[Client, Encode]] = {}
        self._advance_reads: dict[int, Read] = {}
        self._ends: dict[Client, list[End]] = {}
        self._advancing: set[int] = set()

    @property
    def malformed(self) -> int:
        """Answers that did not decode or did not fit their request."""
        return self._malformed + self.dispatch.malformed

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
        self._move(ShardSeen(shard, platform, may_drift))
        return shard

    def advance(self, shard: int) -> None:
        """Request an advance of a shard; its client gives the last step."""
        self._advancing.add(shard)
        self._move(ShardRequested(shard))

    def leave(self, client: Client) -> None:
        """Drop all jobs and shards of a client."""
        for number in self.dispatch.jobs_of(client):
            self._obey(self.dispatch.handle(Withdrawn(number)))
        for shard, (owner, _) in list(self._shard_clients.items()):
            if owner == client:
                self.release(shard)

    def release(self, shard: int) -> None:
        """Drop a shard, and its advance if one is requested."""
        del self._shard_clients[shard]
        self._advancing.discard(shard)
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
        pause_s = 0.0 if self._advancing else self.dispatch.leisure_s
        for event in self._agents.receive(timeout_s, min(timeout_s, pause_s)):
            self.tell(event)
        ends, self._ends = self._ends, {}
        return ends

    def tell(self, event: DispatchEvent) -> None:
        """Handle an event of agents, of jobs or of time."""
        if isinstance(event, Returned):
            read = self._advance_reads.pop(event.number, None)
            if read is not None:
                self._move(self._read_advance(event, read))
                return
        elif isinstance(event, Died):
            shard = self.shards.shard_that_lost(event.number)
            if shard is not None:
                if self._shard_clients[shard][0] == (event.run, event.epoch):
                    self._move(Killed(event.number, event.agent, event.cause))
                return
        # Without shards time changes nothing for them.
        elif isinstance(event, Joined | Left) or (
            self._shard_clients and isinstance(event, Ticked)
        ):
            self._move(event)
        self._obey(self.dispatch.handle(event))

    def _read_advance(self, event: Returned, read: Read) -> ShardReturned:
        """Return the outcome of an advance; an unfit answer is the worker's error."""
        if event.outcome != "ok":
            return ShardReturned(event.number, event.outcome, event.reason)
        try:
            answer = read(event.answer)
        except MalformedMessage as error:
            self._malformed += 1
            return ShardReturned(event.number, "error", str(error))
        if answer is None:
            return ShardReturned(event.number, "stateless")
        return ShardReturned(event.number, "done", answer=answer)

    def _obey(self, commands: Sequence[DispatchCommand]) -> None:
        for command in commands:
            job = command.job
            if isinstance(command, Assign):
                self._agents.send(job.number, command.agent, job.payload)
            elif isinstance(command, Deliver):
                self._ends.setdefault(job.client, []).append(command)
            else:
                self._agents.cancel(command.agent, job.payload)

    def _move(self, event: ShardEvent) -> None:
        """Pass an event to ``shards``, and carry out its commands."""
        for command in self.shards.handle(event):
            client, encode = self._shard_clients[command.shard]
            if isinstance(command, AssignShard):
                payload, read = encode(command)
                self._advance_reads[command.number] = read
                self._agents.send(command.number, command.agent, payload)
            else:
                self._advancing.discard(command.shard)
                self._ends.setdefault(client, []).append(command)
