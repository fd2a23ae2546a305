"""Requests to agents and their answers, and what agents say about themselves.

The classes that the state machines handle are those that travel.
"""

from typing import Annotated, Literal

from msgspec import Meta

from schema.experiment.identity import NO_ORIGIN, Origin
from schema.experiment.section import Count
from schema.limits import (
    MOST_BUNDLED,
    MOST_CORES,
    MOST_DEATHS,
    MOST_EPOCH,
    MOST_PLATFORM,
    MOST_RUN_NAME,
    MOST_SHARDS,
    MOST_SLOTS,
    ROBOT_BYTES,
    VALUE_BYTES,
    Finite,
)
from schema.parts import Vector
from schema.robot.ids import BirthId, IslandNumber
from schema.robot.results import Evaluation, WallTime
from schema.robot.robot import Robot
from schema.wire.arena import Advance, AdvanceShard
from schema.wire.codec import Message

Epoch = Annotated[int, Meta(ge=0, le=MOST_EPOCH)]
GenomeBytes = Annotated[bytes, Meta(max_length=ROBOT_BYTES)]
Packed = Annotated[bytes, Meta(max_length=VALUE_BYTES)]
"""Plain value, by ``schema.wire.calls.pack_value``."""
RunName = Annotated[str, Meta(min_length=1, max_length=MOST_RUN_NAME)]
Jobs = Annotated[list[bytes], Meta(min_length=1, max_length=MOST_BUNDLED)]
"""What travels to an agent: the bytes of requests, which it does in this order."""


class Breed(Message, frozen=True, tag="breed"):
    """Make a child of a couple, or a random robot, on an analyzer, and vet its body.

    A new attempt follows each one that fails. The random draws of an attempt depend on
    the origin of the request, the birth and the attempt alone.

    Attributes:
        birth: id of the child.
        attempt: number of the first attempt at this birth, from 0.
        end: number of the attempt at which to stop.
        parents: genomes of its parents, two or one, the one that gives the root first;
            none for a random robot.
        founder: genome of a given founder, which is only developed and vetted.
    """

    birth: BirthId
    attempt: Count
    end: Count
    parents: Annotated[tuple[GenomeBytes, ...], Meta(max_length=2)] = ()
    founder: GenomeBytes | None = None


class Evaluate(Message, frozen=True, tag="evaluate"):
    """Evaluate a robot on a worker.

    Attributes:
        birth: id of the robot.
        robot: the robot.
        trial: number of the evaluation of this robot, from 0.
        steps: physics steps to simulate; 0 for the duration of the experiment.
        requester: island that requests it; None for the island of its birth.
        is_traced: the answer has the trace, too.
        point: births at which changing settings have their values; None without any.
    """

    birth: BirthId
    robot: Robot
    trial: Count = 0
    steps: Count = 0
    requester: IslandNumber | None = None
    is_traced: bool = False
    point: Count | None = None


class Call(Message, frozen=True, tag="call"):
    """Call a user's own function, which the settings name, on a worker.

    Attributes:
        argument: of the function, in MessagePack of its own.
    """

    argument: Packed


Work = Breed | Evaluate | AdvanceShard | Call


class Request(Message, frozen=True):
    """Request to an agent; its answer depends on nothing else.

    Attributes:
        run: name of the run: host, nonce and path of its folder.
        epoch: incarnation of the coordinator of the run.
        number: number of the job, unique within the epoch.
        work: what to do.
        settings: JSON of the settings that the answer depends on.
        plugins: plug-ins of the settings, as ``source.plugins_of`` gives them.
        origin: run and island that request an evaluation; they seed its noise.
    """

    run: RunName
    epoch: Epoch
    number: Count
    work: Work
    settings: bytes
    plugins: str = ""
    origin: Origin = NO_ORIGIN


class Newborn(Message, frozen=True):
    """Child with a viable body.

    Attributes:
        genome: bytes of its genome, in the encoding of the experiment.
        robot: that develops from it.
        connections: of its brain in the genome, unresolved ones included.
    """

    genome: GenomeBytes
    robot: Robot
    connections: Count


class Bred(Message, frozen=True, tag="bred"):
    """Outcome of breeding; a coordinator journals it.

    Attributes:
        birth, attempt: those of the request.
        reasons: why each attempt before the child's failed, or all attempts.
        child: of the attempt after these; None if all failed.
    """

    birth: BirthId
    attempt: Count
    reasons: tuple[str, ...] = ()
    child: Newborn | None = None

    @property
    def why(self) -> str:
        """Why the last attempt failed."""
        return self.reasons[-1] if self.reasons else ""


class Failure(Message, frozen=True, tag="failure"):
    """A simulation or a call without a result.

    Attributes:
        reason: why there is none.
    """

    reason: str


class StateMissing(Message, frozen=True, tag="state missing"):
    """The worker has neither the state that an advance starts from nor its history."""


class CallValue(Message, frozen=True, tag="value"):
    """Value of a call.

    Attributes:
        value: of the function, in MessagePack of its own.
    """

    value: Packed


class Array(Message, frozen=True):
    """Array of numbers.

    Attributes:
        shape: length of each axis.
        kind: type of the numbers, as NumPy names it.
        data: the numbers, in row-major order.
    """

    shape: tuple[Count, ...]
    kind: Literal["<f8", "<i8", "|b1"]
    data: bytes


class PackedTrace(Message, frozen=True):
    """Trace without its robot.

    Attributes:
        interval_s: time between two samples [s].
        core_position: (T, 3) of the core's centre, world frame [m].
        arrays: other channels, by name.
        constants: channels that are a number or a place, by name.
    """

    interval_s: Finite
    core_position: Array
    arrays: dict[str, Array]
    # Not Finite: with a constraint beside a tuple, msgspec 0.22 crashes.
    constants: dict[str, float | Vector | None]


class Traced(Message, frozen=True, tag="traced"):
    """Outcome of an evaluation, with its trace.

    Attributes:
        outcome: evaluation, or why there is none.
        trace: recording; None if the simulation failed.
    """

    outcome: Evaluation | Failure
    trace: PackedTrace | None


Result = Bred | Evaluation | Traced | Advance | CallValue | Failure | StateMissing


class Answer(Message, frozen=True):
    """Answer to a request.

    Attributes:
        epoch, number: those of the request.
        wall_s: duration by the clock [s]; information only.
        result: outcome of the work.
    """

    epoch: Epoch
    number: Count
    wall_s: WallTime
    result: Result


class Reply(Message, frozen=True, array_like=True):
    """What an agent replies to one of the jobs that it got together.

    Attributes:
        place: of its request among them, from 0.
        answer: bytes of the ``Answer``; empty without one.
        reason: why there is none; empty with one.
    """

    place: Annotated[int, Meta(ge=0, lt=MOST_BUNDLED)]
    answer: bytes = b""
    reason: str = ""


Replies = Annotated[list[Reply], Meta(max_length=MOST_BUNDLED)]
"""What travels back, at once or in parts."""


class RunningJob(Message, frozen=True):
    """A process and its current job.

    Attributes:
        agent: name of the process.
        run, epoch, number: names of the job.
        request: fingerprint of the job's request. Any process can send a request with
            the name of another one's job.
    """

    agent: str
    run: str
    epoch: Count
    number: Count
    request: bytes = b""


class Crash(Message, frozen=True):
    """A process that its job crashed; its name is never used again.

    Attributes:
        job: the process and its job.
        cause: reason, such as "SIGSEGV".
    """

    job: RunningJob
    cause: str


class AgentInfo(Message, frozen=True):
    """Description of an agent.

    Attributes:
        agent: name of the process.
        kind: "worker" or "analyzer".
        slots: jobs that it may have at a time.
        platform: tag of CPU, system and libraries, which decide rounding.
        version: version of Revolve Islands and of its messages.
        deaths: crashed predecessors, oldest first.
        shards: arenas whose state a worker keeps.
        cores: cores that it uses for one arena.
        quiet_s: time since the current job last used CPU [s]; None between jobs.
    """

    agent: str
    kind: str
    slots: Annotated[int, Meta(ge=1, le=MOST_SLOTS)]
    platform: Annotated[str, Meta(max_length=MOST_PLATFORM)]
    version: str
    deaths: Annotated[tuple[Crash, ...], Meta(max_length=MOST_DEATHS)] = ()
    shards: Annotated[int, Meta(ge=1, le=MOST_SHARDS)] = 1
    cores: Annotated[int, Meta(ge=1, le=MOST_CORES)] = 1
    quiet_s: float | None = None


OF_AGENTS = (Request, Answer, AgentInfo)
"""Messages that decide whether agent and coordinator understand each other."""
