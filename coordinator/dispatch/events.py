"""Events that dispatch handles, and the commands that it returns.

Jobs are single requests, to any agent of a kind; shards are arenas, each of which
lives in one worker.
"""

from dataclasses import dataclass
from typing import Literal

from schema.robot.ids import BirthId

# --- Jobs

AgentKind = Literal["worker", "analyzer"]


JobKind = Literal["vet", "evaluate"]


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work, a pure function of its payload.

    Attributes:
        number: unique within the coordinator's incarnation, ascending.
        kind: what it asks for; "vet" goes to analyzers, "evaluate" to workers.
        birth: whom it is about.
        attempt: mating attempt, for "vet"; trial, for "evaluate".
        payload: the encoded request (schema.wire.codec).
        twin: number of a job that somebody else is to do, if there is anybody
            else; -1 if none is.
    """

    number: int
    kind: JobKind
    birth: BirthId
    attempt: int
    payload: bytes
    twin: int = -1


@dataclass(frozen=True, slots=True)
class Joined:
    """A worker or an analyzer is there and takes jobs."""

    agent: str
    kind: AgentKind
    slots: int
    platform: str


@dataclass(frozen=True, slots=True)
class Left:
    """A worker or an analyzer is gone; whatever it held is lost."""

    agent: str


@dataclass(frozen=True, slots=True)
class Requested:
    """Somebody wants a job done."""

    job: Job


@dataclass(frozen=True, slots=True)
class Withdrawn:
    """Nobody wants a job done any more; it may be done."""

    number: int


@dataclass(frozen=True, slots=True)
class Returned:
    """A job came back from an agent.

    Attributes:
        number: the job's.
        agent: who had it.
        outcome: "ok" with an answer, "error" with a reason (the agent could not
            do it), or "lost" (no word: the agent died, froze or was cut off).
        answer: encoded answer; empty unless ok.
        reason: empty unless error.
    """

    number: int
    agent: str
    outcome: Literal["ok", "error", "lost"]
    answer: bytes = b""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Died:
    """A process ended by the doing of the job that it was at, not of its machine.

    Attributes:
        run, epoch: whose job.
        number: the job's.
        agent: the process, which never comes back.
        cause: such as "SIGSEGV".
    """

    run: str
    epoch: int
    number: int
    agent: str
    cause: str


@dataclass(frozen=True, slots=True)
class Ticked:
    """Time passed [s]; any monotonic origin."""

    now_s: float


DispatchEvent = Joined | Left | Requested | Withdrawn | Returned | Died | Ticked


@dataclass(frozen=True, slots=True)
class Assign:
    """Send a job to an agent."""

    job: Job
    agent: str


@dataclass(frozen=True, slots=True)
class Deliver:
    """A job is done for good: with an answer, or with a reason why never.

    Attributes:
        job: which.
        agent: who had it last.
        answer: empty if there is a reason.
        reason: why nobody can do it.
        is_deadly: it ends whoever tries it.
    """

    job: Job
    agent: str
    answer: bytes
    reason: str = ""
    is_deadly: bool = False


@dataclass(frozen=True, slots=True)
class Cancel:
    """Nobody waits for this job of this agent any more."""

    job: Job
    agent: str


DispatchCommand = Assign | Deliver | Cancel


# --- Shards


@dataclass(frozen=True, slots=True)
class ShardSeen:
    """A journal tells on what platform a shard has been advanced."""

    shard: int
    platform: str


@dataclass(frozen=True, slots=True)
class ShardRequested:
    """A shard is to be advanced; comes again only after ``ShardDone``."""

    shard: int


@dataclass(frozen=True, slots=True)
class ShardReturned:
    """What became of an advance that was handed out.

    Attributes:
        number: of the ``AssignShard``.
        outcome: "done"; "stateless" (the worker does not have the state); "error"
            with a reason; "lost" (no word).
        reason: empty unless error.
    """

    number: int
    outcome: Literal["done", "stateless", "error", "lost"]
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Released:
    """A shard needs nothing more; whoever holds it may take another."""

    shard: int


@dataclass(frozen=True, slots=True)
class Killed:
    """An advance that was handed out ended its worker, by its own doing.

    Attributes:
        number: of the ``AssignShard``.
        agent: who died, once.
        cause: of what.
    """

    number: int
    agent: str
    cause: str


ShardEvent = (
    Joined
    | Left
    | Ticked
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
        shard: whose advance.
        agent: the worker.
        is_whole: with what it takes to rebuild the state.
    """

    number: int
    shard: int
    agent: str
    is_whole: bool


@dataclass(frozen=True, slots=True)
class ShardDone:
    """The advance of a shard is done, by this worker."""

    shard: int
    agent: str


@dataclass(frozen=True, slots=True)
class ShardFailed:
    """Several workers cannot advance a shard, the last of them this one."""

    shard: int
    agent: str
    reason: str


ShardCommand = AssignShard | ShardDone | ShardFailed
