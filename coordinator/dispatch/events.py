"""Events that dispatch handles, and the commands that it returns.

Jobs are single requests, to any agent of a kind; shards are arenas, each of which
lives in one worker.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from schema.wire.messages import Crash

AgentKind = Literal["worker", "analyzer"]
KINDS: tuple[AgentKind, ...] = ("worker", "analyzer")

JobKind = Literal["vet", "evaluate", "call"]

Read = Callable[[bytes], object]
"""Decodes an answer and checks it; raises ``MalformedMessage`` if it is unfit."""


class Client(NamedTuple):
    """A coordinator's incarnation of a run: requests jobs and advances."""

    run: str
    epoch: int


NO_CLIENT = Client("", 0)

# --- Jobs


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work, a pure function of its payload.

    Attributes:
        number: unique within the process, ascending.
        kind: "vet" goes to analyzers, "evaluate" and "call" to workers.
        payload: the encoded request.
        paired: number of the same request's other job, which another agent does if
            there is one; -1 if there is no other job.
        client: the run that requested it.
        subject: the client's own description of the job.
        read: decodes and checks an answer.
        simulated_s: time that it simulates [s]; 0.0 if it is no simulation, None if its
            work is unknown, as that of a call.
    """

    number: int
    kind: JobKind
    payload: bytes
    paired: int = -1
    client: Client = NO_CLIENT
    subject: object = None
    read: Read = field(default=bytes, compare=False)
    simulated_s: float | None = None


@dataclass(frozen=True, slots=True)
class Joined:
    """A worker or an analyzer is ready for jobs.

    Attributes:
        agent: its name.
        kind: of agent.
        slots: jobs that it does at a time.
        platform: on which its results depend.
        shards: arenas whose state it keeps.
        cores: that it uses for one arena.
    """

    agent: str
    kind: AgentKind
    slots: int
    platform: str
    shards: int = 1
    cores: int = 1


@dataclass(frozen=True, slots=True)
class Left:
    """A worker or an analyzer is gone; the jobs that it held are lost."""

    agent: str


@dataclass(frozen=True, slots=True)
class Requested:
    """A client wants a job done."""

    job: Job


@dataclass(frozen=True, slots=True)
class Withdrawn:
    """A job is no longer wanted; it may be done already."""

    number: int


@dataclass(frozen=True, slots=True)
class ClientEnded:
    """A client has ended: none of its jobs is wanted any more."""

    client: Client


@dataclass(frozen=True, slots=True)
class Returned:
    """A job came back from an agent.

    Attributes:
        number: of the job.
        agent: that had it.
        outcome: "ok" with an answer, "error" with a reason (the agent could not
            do it), "unfit" with a reason (it cannot do any job of this client),
            "lost" (no reply: the agent died, froze or was cut off), "expired" (no
            reply in the time that the network waits for one), "fenced" (it knows a
            later coordinator of the run) or "cancelled".
        answer: encoded answer; empty unless ok.
        reason: of the agent; empty if ok, lost or expired.
        took_s: time from sending the job to its answer or end [s]; None: not measured.
    """

    number: int
    agent: str
    outcome: Literal["ok", "error", "unfit", "lost", "expired", "fenced", "cancelled"]
    answer: bytes = b""
    reason: str = ""
    took_s: float | None = None


@dataclass(frozen=True, slots=True)
class Expired:
    """The network waited too long for the reply to a job or an advance.

    It is sent again to its agent.
    """

    number: int
    agent: str


@dataclass(frozen=True, slots=True)
class Ticked:
    """Time passed: the time now, of a monotonic clock [s]."""

    now_s: float


@dataclass(frozen=True, slots=True)
class Progressed:
    """An agent that was asked reports that its current job uses CPU time."""

    agent: str


DispatchEvent = (
    Joined
    | Left
    | Requested
    | Withdrawn
    | ClientEnded
    | Returned
    | Expired
    | Crash
    | Ticked
    | Progressed
)


@dataclass(frozen=True, slots=True)
class Assign:
    """Send a job to an agent."""

    job: Job
    agent: str


@dataclass(frozen=True, slots=True)
class Deliver:
    """A job is done, or given up for a reason.

    Attributes:
        job: that ended.
        agent: that had it last.
        platform: of the agent; empty for a job that is given up.
        answer: what ``job.read`` returned; None if there is a reason.
        reason: why no agent can do it.
        is_deadly: it crashes every process that tries it.
    """

    job: Job
    agent: str
    platform: str = ""
    answer: object = None
    reason: str = ""
    is_deadly: bool = False


@dataclass(frozen=True, slots=True)
class Cancel:
    """The agent's work on a job is no longer needed."""

    job: Job
    agent: str


@dataclass(frozen=True, slots=True)
class AskProgress:
    """Ask an agent whether it works: one of its jobs is past its deadline."""

    agent: str


@dataclass(frozen=True, slots=True)
class Overdue:
    """Tell the user that an agent neither answers nor reports progress.

    Attributes:
        agent: its name.
        waited_s: time since it was given its oldest job [s].
        to: an agent that can take its jobs; empty if there is none.
    """

    agent: str
    waited_s: float
    to: str = ""


DispatchCommand = Assign | Deliver | Cancel | AskProgress | Overdue


# --- Shards


@dataclass(frozen=True, slots=True)
class ShardSeen:
    """A shard was advanced on a platform, according to the journal.

    Attributes:
        shard: its number.
        platform: empty if it was never advanced.
        may_drift: it may move to another platform, provided that drift is allowed at
            all.
        client: the run of the arena.
    """

    shard: int
    platform: str
    may_drift: bool = True
    client: Client = NO_CLIENT


@dataclass(frozen=True, slots=True)
class ShardRequested:
    """A shard is to be advanced; may be repeated only after ``ShardDone``.

    ``simulated_s`` is the time that the advance simulates [s]; None: unknown.
    """

    shard: int
    simulated_s: float | None = None


@dataclass(frozen=True, slots=True)
class ShardReturned:
    """An assigned advance came back from its worker.

    Attributes:
        number: of the ``AssignShard``.
        outcome: "done"; "stateless" (the worker does not have the state); "error"
            with a reason; "unfit" (it cannot do any job of the shard's client);
            "malformed" (an answer that is not believed) with a reason; "lost" (no
            reply); "unsent" with a reason (its request could not be made).
        reason: empty unless error, malformed or unsent.
        answer: decoded; None unless done.
    """

    number: int
    outcome: Literal[
        "done", "stateless", "error", "unfit", "malformed", "lost", "unsent"
    ]
    reason: str = ""
    answer: object = None


@dataclass(frozen=True, slots=True)
class Released:
    """A shard needs no more advances; its holder is free for another one."""

    shard: int


@dataclass(frozen=True, slots=True)
class Killed:
    """An assigned advance crashed its worker, by a cause such as "SIGSEGV"."""

    number: int
    agent: str
    cause: str


ShardEvent = (
    Joined
    | Left
    | Ticked
    | Expired
    | ShardSeen
    | ShardRequested
    | ShardReturned
    | Killed
    | Released
)


@dataclass(frozen=True, slots=True)
class AssignShard:
    """Send a shard's advance to a worker.

    Attributes:
        number: of the job, used once.
        shard: to advance.
        agent: the worker.
        platform: of the worker.
        is_whole: the request includes what is needed to rebuild the state.
    """

    number: int
    shard: int
    agent: str
    platform: str
    is_whole: bool


@dataclass(frozen=True, slots=True)
class ShardDone:
    """A worker has done the advance of a shard; its answer is decoded."""

    shard: int
    agent: str
    answer: object = None


@dataclass(frozen=True, slots=True)
class ShardFailed:
    """The advance of a shard is given up, for the reason of its last failure.

    ``agent`` is the last that tried; empty if the request could not be made.
    """

    shard: int
    agent: str
    reason: str


@dataclass(frozen=True, slots=True)
class CancelShard:
    """The advance of an ``AssignShard`` goes to another worker than its agent."""

    number: int
    shard: int
    agent: str


@dataclass(frozen=True, slots=True)
class Crowded:
    """Tell the user that there are more shards than states that all workers keep."""

    shards: int
    kept: int


ShardCommand = (
    AssignShard
    | ShardDone
    | ShardFailed
    | CancelShard
    | AskProgress
    | Overdue
    | Crowded
)
