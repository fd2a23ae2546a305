"""The agents that all runs of this process share, and who of them does what.

Jobs of all runs go through the same machines, under numbers of one kind, so that no
run knows of the others and none of them can take all workers for itself. Whose a job
is stands here; what it means is known to who asked.
"""

from collections.abc import Sequence
from itertools import count
from typing import Protocol

from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.events import (
    Assign,
    AssignShard,
    Cancel,
    Deliver,
    Died,
    DispatchCommand,
    DispatchEvent,
    Job,
    Joined,
    Killed,
    Left,
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
    Withdrawn,
)
from coordinator.dispatch.shards import ShardDispatch


class Agents(Protocol):
    """Where jobs go and answers come from: a network, or this process."""

    def send(self, number: int, agent: str, payload: bytes) -> None:
        """Hand a job to an agent; its outcome comes by ``receive``."""

    def cancel(self, _agent: str, _payload: bytes, /) -> None:
        """Tell an agent that nobody waits for a job, by the job's own request."""

    def receive(
        self, timeout_s: float, pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        """Return what happened: during a pause, and if nothing did, thereafter."""


class JobClient(Protocol):
    """One that asks questions about single robots."""

    def is_of(self, run: str, epoch: int) -> bool:
        """Return whether the questions are those of a run's incarnation."""

    def checked(self, event: Returned) -> Returned:
        """Return what came of a job; an answer of no use becomes an error."""

    def deliver(self, command: Deliver) -> None:
        """Take the end of a job."""


class ShardClient(Protocol):
    """One that has arenas advanced."""

    def is_of(self, run: str, epoch: int) -> bool:
        """Return whether the arenas are those of a run's incarnation."""

    def payload(self, command: AssignShard) -> bytes:
        """Return the request that a worker is handed."""

    def understood(self, event: Returned) -> ShardReturned:
        """Return what a worker's word means."""

    def settle(self, command: ShardDone | ShardFailed) -> None:
        """Take the end of an advance."""


class Fleet:
    """Workers and analyzers, the jobs of all runs, and the way between them.

    Attributes:
        dispatch: who does what, of single robots' questions.
        shards: who holds which arena; its numbers are this process's own.
    """

    def __init__(self, agents: Agents, *, allows_drift: bool = False) -> None:
        """Share out agents; nobody has asked for anything yet.

        Args:
            agents: what leads to them.
            allows_drift: an arena may go on by another platform where its own is gone.
        """
        self._numbers = count(1)
        self.dispatch = Dispatch()
        self.shards = ShardDispatch(self._numbers, allows_drift=allows_drift)
        self._agents = agents
        self._shard_numbers = count()
        self._job_clients: dict[int, JobClient] = {}
        self._shard_clients: dict[int, ShardClient] = {}
        self._credits: dict[str, int] = {}
        self._news: dict[JobClient | ShardClient, None] = {}
        self._advancing: set[int] = set()

    @property
    def open(self) -> int:
        """How many jobs and advances are asked for and not done."""
        return len(self._job_clients) + len(self._advancing)

    @property
    def credits(self) -> int:
        """How many jobs all workers together may have at a time."""
        return sum(self._credits.values())

    def new_number(self) -> int:
        """Return a number for a job."""
        return next(self._numbers)

    def ask(self, job: Job, requester: JobClient) -> None:
        """Have a job done."""
        self._job_clients[job.number] = requester
        self._obey(self.dispatch.handle(Requested(job)))

    def new_shard(self, owner: ShardClient) -> int:
        """Return a number for an arena's shard."""
        shard = next(self._shard_numbers)
        self._shard_clients[shard] = owner
        return shard

    def place(self, shard: int, platform: str) -> None:
        """Note on what platform a shard has been advanced."""
        self._move(ShardSeen(shard, platform))

    def advance(self, shard: int) -> None:
        """Have a shard advanced; its owner knows how far."""
        self._advancing.add(shard)
        self._move(ShardRequested(shard))

    def release(self, shard: int) -> None:
        """Forget a shard that needs nothing more."""
        self._shard_clients.pop(shard, None)
        self._advancing.discard(shard)
        self._move(Released(shard))

    def leave(self, requester: JobClient) -> None:
        """Let nobody work for one that asks no more."""
        for number in [n for n, each in self._job_clients.items() if each is requester]:
            del self._job_clients[number]
            self._obey(self.dispatch.handle(Withdrawn(number)))

    def listen(self, timeout_s: float, now_s: float) -> list[JobClient | ShardClient]:
        """Return who has news, after waiting for some.

        Args:
            timeout_s: how long to wait when nothing is there [s].
            now_s: the time, of any clock that only goes forward [s].
        """
        for wake_s in (self.dispatch.wake_s, self.shards.wake_s):
            if wake_s is not None:
                timeout_s = min(timeout_s, max(0.0, wake_s - now_s))
        self.tell(Ticked(now_s))
        # Woken for each answer, one spends more on waking up than on answers.
        pause_s = 0.0 if self._advancing else self.dispatch.leisure_s
        for event in self._agents.receive(timeout_s, min(timeout_s, pause_s)):
            self.tell(event)
        news, self._news = list(self._news), {}
        return news

    def tell(self, event: DispatchEvent) -> None:
        """Take news of agents, of jobs or of time."""
        if isinstance(event, Returned):
            self._returned(event)
            return
        if isinstance(event, Joined) and event.kind == "worker":
            self._credits[event.agent] = event.slots + 1
        elif isinstance(event, Left):
            self._credits.pop(event.agent, None)
        if isinstance(event, Joined | Left | Ticked):
            self._move(event)
        if not (isinstance(event, Died) and self._is_shards(event)):
            self._obey(self.dispatch.handle(event))

    def _is_shards(self, event: Died) -> bool:
        """Pass on whom an advance killed; True also for another coordinator's job."""
        shard = self.shards.shard_that_lost(event.number)
        requester = (
            self._job_clients.get(event.number)
            if shard is None
            else self._shard_clients[shard]
        )
        if requester is None or not requester.is_of(event.run, event.epoch):
            return True
        if shard is not None:
            self._move(Killed(event.number, event.agent, event.cause))
        return shard is not None

    def _returned(self, event: Returned) -> None:
        if self.shards.has_out(event.number):
            owner = self._shard_clients[self.shards.shard_of(event.number)]
            self._move(owner.understood(event))
            return
        requester = self._job_clients.get(event.number)
        checked = event if requester is None else requester.checked(event)
        self._obey(self.dispatch.handle(checked))

    def _obey(self, commands: Sequence[DispatchCommand]) -> None:
        for command in commands:
            if isinstance(command, Assign):
                job = command.job
                self._agents.send(job.number, command.agent, job.payload)
            elif isinstance(command, Deliver):
                requester = self._job_clients.pop(command.job.number, None)
                if requester is not None:
                    requester.deliver(command)
                    self._news[requester] = None
            elif isinstance(command, Cancel):
                self._agents.cancel(command.agent, command.job.payload)

    def _move(self, event: ShardEvent) -> None:
        """Tell the machine that has the shards, and do what it says."""
        commands: list[ShardCommand] = self.shards.handle(event)
        for command in commands:
            owner = self._shard_clients[command.shard]
            if isinstance(command, AssignShard):
                payload = owner.payload(command)
                self._agents.send(command.number, command.agent, payload)
            else:
                self._advancing.discard(command.shard)
                owner.settle(command)
                self._news[owner] = None
