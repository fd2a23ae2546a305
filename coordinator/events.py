"""What the coordinator's machines are told (events) and ask for (commands).

Events are past participles, commands imperatives; all are immutable.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from schema.birth import BirthId
from schema.evaluation import Evaluation, Provenance, Report
from schema.robot import Robot

# --- Island: events ---------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Started:
    """The run begins; comes once, first."""


@dataclass(frozen=True, slots=True)
class Vetted:
    """The analyzer judged a candidate body."""

    birth: BirthId
    attempt: int
    report: Report


@dataclass(frozen=True, slots=True)
class VettingFailed:
    """The analyzer cannot judge a candidate, and would fail on it again."""

    birth: BirthId
    attempt: int
    reason: str


@dataclass(frozen=True, slots=True)
class Evaluated:
    """A robot was simulated and judged."""

    birth: BirthId
    evaluation: Evaluation
    provenance: Provenance


@dataclass(frozen=True, slots=True)
class EvaluationFailed:
    """A robot's simulation ended without a judgement, for a reason of its own."""

    birth: BirthId
    reason: str
    provenance: Provenance


Answered = Vetted | VettingFailed | Evaluated | EvaluationFailed
"""Events that answer a question: what the journal keeps."""

IslandEvent = Started | Answered

# --- Island: commands -------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Vet:
    """Have a candidate's body judged."""

    birth: BirthId
    attempt: int
    robot: Robot


@dataclass(frozen=True, slots=True)
class Evaluate:
    """Have a robot simulated and judged."""

    birth: BirthId
    robot: Robot


@dataclass(frozen=True, slots=True)
class Record:
    """Write a row of a table; rows of one table come in a repeatable order."""

    table: str
    row: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Finish:
    """The island is done."""

    island: int


IslandCommand = Vet | Evaluate | Record | Finish

# --- Dispatch ---------------------------------------------------------------

AgentKind = Literal["worker", "analyzer"]
JobKind = Literal["vet", "evaluate"]


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work, a pure function of its payload.

    Attributes:
        number: unique within the coordinator's incarnation, ascending.
        kind: what it asks for; "vet" goes to analyzers, "evaluate" to workers.
        birth: whom it is about.
        attempt: mating attempt, for "vet"; 0 for "evaluate".
        payload: the encoded request (schema.codec).
    """

    number: int
    kind: JobKind
    birth: BirthId
    attempt: int
    payload: bytes


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
class Ticked:
    """Time passed [s]; any monotonic origin."""

    now_s: float


DispatchEvent = Joined | Left | Requested | Returned | Ticked


@dataclass(frozen=True, slots=True)
class Assign:
    """Send a job to an agent."""

    job: Job
    agent: str


@dataclass(frozen=True, slots=True)
class Deliver:
    """A job is done for good: with an answer, or with a reason why never."""

    job: Job
    agent: str
    answer: bytes
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Cancel:
    """Nobody waits for this job of this agent any more."""

    job: Job
    agent: str


DispatchCommand = Assign | Deliver | Cancel
