"""Agents that all runs of this process share, and the routing of their jobs.

The jobs of all runs are numbered from one sequence and assigned by the same state
machines. Runs are therefore independent of each other, and none can take all workers.
An answer is returned to the client that requested the job, which interprets it.
"""

from collections.abc import Callable, Sequence
from itertools import count
from typing import Protocol

from msgspec import Struct
from msgspec.structs import replace

from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.events import (
    AskProgress,
    Assign,
    Cancel,
    Client,
    ClientEnded,
    Crowded,
    Deliver,
    DispatchEvent,
    Expired,
    Job,
    Outcome,
    Overdue,
    Read,
    Released,
    Requested,
    Returned,
    ShardSeen,
    Ticked,
)
from coordinator.dispatch.faults import FaultKind, PeerFaults
from coordinator.dispatch.pool import longer_s
from schema.errors import MalformedMessage, RunFolderError
from schema.wire.codec import fingerprint
from schema.wire.messages import Crash


class Agents(Protocol):
    """Connection to the agents: a network, or functions in this process."""

    def send(self, number: int, agent: str, payload: bytes, wait_s: float, /) -> None:
        """Send a job to an agent; ``receive`` returns its outcome.

        ``wait_s``: time without a reply after which its outcome is "expired" [s].
        """

    def cancel(self, _agent: str, _payload: bytes, /) -> None:
        """Tell an agent, by the job's request, that a job is no longer wanted."""

    def ask(self, agent: str, /) -> None:
        """Ask an agent for its progress; ``receive`` returns a report, if any."""

    def receive(
        self, timeout_s: float, pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        """Return events: those of a pause, or else the first ones after it."""


Encode = Callable[[Assign], tuple[bytes, Read]]
"""Returns the request of an advance, and what decodes and checks its answer: None is
that of a worker that lacks the state.

It raises ``RunFolderError`` if a state that the request needs cannot be read.
"""


class Fenced(Struct, frozen=True):
    """An agent refused a client's job as that of a replaced coordinator."""

    client: Client
    agent: str
    reason: str


class JobRouter:
    """Workers and analyzers, the jobs of all runs, and the routing between them.

    Attributes:
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

        ``allows_drift``: an arena may move to another platform if its own is gone.
        ``faults``: counts that the connection shares; None: counts of its own.
        """
        self._warn = warn
        self._numbers = count(1)
        self.faults = faults or PeerFaults()
        self.dispatch = Dispatch(self._numbers, allows_drift=allows_drift)
        self._fenced: list[Fenced] = []
        self._agents = agents
        self._shard_numbers = count()
        self._shard_clients: dict[int, tuple[Client, Encode]] = {}
        self._ends: dict[Client, list[Deliver]] = {}

    def new_number(self) -> int:
        """Return a number for a job."""
        return next(self._numbers)

    def request(self, job: Job) -> None:
        """Request a job."""
        self._handle(Requested(job))

    def new_shard(
        self, client: Client, encode: Encode, platform: str, *, may_drift: bool = True
    ) -> int:
        """Return a number for an arena's shard.

        ``encode``: returns the request of each advance when it is assigned.
        ``platform``: on which the shard has been advanced; empty if never.
        ``may_drift``: it may move to another platform, if arenas may.
        """
        shard = next(self._shard_numbers)
        self._shard_clients[shard] = (client, encode)
        self._handle(ShardSeen(shard, platform, may_drift, client))
        return shard

    def advance(self, shard: int, simulated_s: float | None = None) -> None:
        """Request an advance of a shard; its client gives the last step."""
        client, _ = self._shard_clients[shard]
        self.request(
            Job(
                self.new_number(),
                "advance",
                client=client,
                simulated_s=simulated_s,
                shard=shard,
            )
        )

    def leave(self, client: Client) -> None:
        """Drop all jobs and shards of a client."""
        self._handle(ClientEnded(client))
        for shard, (owner, _) in list(self._shard_clients.items()):
            if owner == client:
                self.release(shard)

    def release(self, shard: int) -> None:
        """Drop a shard, and its advance if one is requested."""
        del self._shard_clients[shard]
        self._handle(Released(shard))

    def listen(self, timeout_s: float, now_s: float) -> dict[Client, list[Deliver]]:
        """Return what ended for each client, after waiting for something to end."""
        if (wake_s := self.dispatch.wake_s) is not None:
            timeout_s = min(timeout_s, max(0.0, wake_s - now_s))
        self.tell(Ticked(now_s))
        # Waking up for each answer would cost more than the answers themselves.
        pause_s = 0.0 if self.dispatch.homes.are_busy else self.dispatch.pause_s
        for event in self._agents.receive(timeout_s, min(timeout_s, pause_s)):
            self.tell(event)
        ends, self._ends = self._ends, {}
        return ends

    def tell(self, event: DispatchEvent) -> None:
        """Handle an event of agents, of jobs or of time."""
        if isinstance(event, Returned):
            if not self.dispatch.has(event.agent, event.number):
                # It is not wanted any more.
                if event.outcome == "ok":
                    self._note("late", event)
            elif event.outcome == "expired":
                self._send_again(event)
                return
            else:
                event = self._read(event)
        elif isinstance(event, Crash) and not self._is_own(event):
            return
        self._handle(event)

    def _send_again(self, event: Returned) -> None:
        """Send a job again to the agent that has it.

        An agent keeps what it works at, however long that takes. It answers a request
        that comes again from memory if the job took long or is an arena's last advance.
        """
        number, agent = event.number, event.agent
        job = self.dispatch.job(number)
        assert job is not None
        payload, _ = job.sent[number, agent]
        self._agents.send(number, agent, payload, longer_s(event.took_s or 0.0))
        self._handle(Expired(number, agent))

    def _is_own(self, event: Crash) -> bool:
        """Return whether a job crashed a process that had it from this coordinator."""
        crashed = event.job
        job = self.dispatch.job(crashed.number)
        if job is None or job.client != (crashed.run, crashed.epoch):
            return False
        payload, _ = job.sent.get((crashed.number, crashed.agent), (b"", None))
        # A process may have died of another one's request with the name of this job.
        is_own = (
            self.dispatch.has_lost(crashed.agent, crashed.number)
            and fingerprint(payload) == crashed.request
        )
        if not is_own:
            self.faults.note("death", crashed.agent, f"job {crashed.number}")
        return is_own

    def _read(self, event: Returned) -> Returned:
        """Return an outcome with the decoded answer; count what cannot be used."""
        job = self.dispatch.job(event.number)
        assert job is not None
        if event.outcome == "fenced":
            self._fenced.append(Fenced(job.client, event.agent, event.reason))
        elif event.outcome == "cancelled":
            self._note("cancelled", event)
        elif event.outcome in ("error", "unfit"):
            self.faults.note("refused", event.agent, event.reason)
        if event.outcome != "ok":
            return event
        _, read = job.sent[event.number, event.agent]
        outcome: Outcome
        try:
            answer = read(event.answer)
        except MalformedMessage as error:
            self.faults.note("malformed", event.agent, str(error))
            # A machine that computes differently lies no more than one that fails.
            outcome = "error" if error.kind == "differs" else "malformed"
            return replace(event, outcome=outcome, answer=None, reason=str(error))
        outcome = "stateless" if job.shard >= 0 and answer is None else "ok"
        return replace(event, outcome=outcome, answer=answer)

    def _note(self, kind: FaultKind, event: Returned) -> None:
        self.faults.note(kind, event.agent, f"job {event.number}")

    def fenced(self) -> list[Fenced]:
        """Return the jobs refused since the last call as of replaced coordinators."""
        fenced, self._fenced = self._fenced, []
        return fenced

    def _handle(self, event: DispatchEvent) -> None:
        for command in self.dispatch.handle(event):
            match command:
                case Assign():
                    self._assign(command)
                case Cancel(job, agent):
                    payload, _ = job.sent[job.number, agent]
                    self._agents.cancel(agent, payload)
                case Deliver(job):
                    self._ends.setdefault(job.client, []).append(command)
                case AskProgress(agent):
                    self._agents.ask(agent)
                case Crowded() | Overdue():
                    self._warn(_line(command))

    def _assign(self, command: Assign) -> None:
        """Send a job to an agent, or give it up if its request cannot be made."""
        job, agent = command.job, command.agent
        payload, read = job.payload, job.read
        if job.shard >= 0:
            _, encode = self._shard_clients[job.shard]
            try:
                payload, read = encode(command)
            except RunFolderError as error:
                self._handle(Returned(job.number, agent, "unsent", reason=str(error)))
                return
        job.sent[job.number, agent] = payload, read
        self._agents.send(job.number, agent, payload, self.dispatch.wait_s(command))


def _line(command: Crowded | Overdue) -> str:
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
