"""Events that dispatch handles, and the commands that it returns.

A job goes to any agent of a kind, unless it advances a shard: an arena, which lives in
one worker.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from msgspec import Struct

from schema.wire.messages import Crash

AgentKind = Literal["worker", "analyzer"]
KINDS: tuple[AgentKind, ...] = ("worker", "analyzer")

JobKind = Literal["breed", "evaluate", "call", "advance"]

Read = Callable[[bytes], object]
"""Decodes an answer and checks it; raises ``MalformedMessage`` if it is unfit."""


class Client(NamedTuple):
    """A coordinator's incarnation of a run: requests jobs and advances."""

    run: str
    epoch: int


NO_CLIENT = Client("", 0)


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work, a pure function of its request.

    Attributes:
        number: unique within the process, ascending; an advance gets another one each
            time that it is assigned.
        kind: "breed" goes to analyzers, the others to workers.
        payload: the encoded request; empty for an advance, whose request depends on
            its worker.
        paired: number of the same request's other job, which another agent does if
            there is one; -1 if there is no other job.
        subject: the client's own description of the job.
        read: decodes and checks an answer.
        simulated_s: time that it simulates [s]; 0.0 if it is no simulation, None if its
            work is unknown, as that of a call.
        shard: that it advances; -1 if it advances none.
        sent: request that each agent was sent, by its number then, and what reads the
            answer; noted by who sends it.
    """

    number: int
    kind: JobKind
    payload: bytes = b""
    paired: int = -1
    client: Client = NO_CLIENT
    subject: object = None
    read: Read = field(default=bytes, compare=False)
    simulated_s: float | None = None
    shard: int = -1
    sent: dict[tuple[int, str], tuple[bytes, Read]] = field(
        default_factory=dict, compare=False, repr=False
    )


class Joined(Struct, frozen=True):
    """A worker or an analyzer is ready for jobs.

    Attributes:
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


class Left(Struct, frozen=True):
    """A worker or an analyzer is gone; the jobs that it held are lost."""

    agent: str


class Requested(Struct, frozen=True):
    """A client wants a job done."""

    job: Job


class Withdrawn(Struct, frozen=True):
    """A job is no longer wanted; it may be done already."""

    number: int


class ClientEnded(Struct, frozen=True):
    """A client has ended: none of its jobs is wanted any more."""

    client: Client


Outcome = Literal[
    "ok",
    "stateless",
    "error",
    "malformed",
    "unfit",
    "lost",
    "expired",
    "fenced",
    "cancelled",
    "unsent",
]
"""How a job came back: with an answer; its worker lacks the state of the shard; the
agent could not do it; its answer is not believed; the agent cannot do any job of this
client; no reply (it died, froze or was cut off); no reply in the time that the network
waits for one; the agent knows a later coordinator of the run; it was cancelled; its
request could not be made."""


class Returned(Struct, frozen=True):
    """A job came back from an agent.

    Attributes:
        outcome: how it came back.
        answer: of an "ok": encoded, decoded once the router has read it.
        reason: of an error, a malformed answer, an unfit agent or an unsent request.
        took_s: time from sending the job to its answer or end [s]; None: not measured.
    """

    number: int
    agent: str
    outcome: Outcome
    answer: Any = b""
    reason: str = ""
    took_s: float | None = None


class Expired(Struct, frozen=True):
    """The network waited too long for the reply to a job or an advance.

    It is sent again to its agent.
    """

    number: int
    agent: str


class Ticked(Struct, frozen=True):
    """Time passed: the time now, of a monotonic clock [s]."""

    now_s: float


class Progressed(Struct, frozen=True):
    """An agent that was asked reports that its current job uses CPU time."""

    agent: str


class ShardSeen(Struct, frozen=True):
    """A shard was advanced on a platform, according to the journal.

    Attributes:
        platform: empty if it was never advanced.
        may_drift: it may move to another platform, provided that drift is allowed at
            all.
    """

    shard: int
    platform: str
    may_drift: bool = True
    client: Client = NO_CLIENT


class Released(Struct, frozen=True):
    """A shard needs no more advances; its holder is free for another one."""

    shard: int


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
    | ShardSeen
    | Released
)


class Assign(Struct, frozen=True):
    """Send a job to an agent.

    Attributes:
        platform: of the worker that gets an advance; empty for another job.
        is_whole: the request of the advance includes what is needed to rebuild the
            state.
    """

    job: Job
    agent: str
    platform: str = ""
    is_whole: bool = False


class Deliver(Struct, frozen=True):
    """A job is done, or given up for a reason.

    Attributes:
        agent: that had it last; empty if its request could not be made.
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


class Cancel(Struct, frozen=True):
    """The agent's work on a job is no longer needed."""

    job: Job
    agent: str


class AskProgress(Struct, frozen=True):
    """Ask an agent whether it works: one of its jobs is past its deadline."""

    agent: str


class Overdue(Struct, frozen=True):
    """Tell the user that an agent neither answers nor reports progress.

    Attributes:
        waited_s: time since it was given its oldest job [s].
        to: an agent that can take its jobs; empty if there is none.
    """

    agent: str
    waited_s: float
    to: str = ""


class Crowded(Struct, frozen=True):
    """Tell the user that there are more shards than states that all workers keep."""

    shards: int
    kept: int


DispatchCommand = Assign | Deliver | Cancel | AskProgress | Overdue | Crowded
