"""Events that islands and arenas handle, and the commands that they return.

Events are past participles, commands imperatives; all are immutable.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from coordinator.evolution.selection import Individual
from schema.robot.brain import Brain
from schema.robot.genome import Genome
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance, Report
from schema.robot.robot import Robot
from schema.wire.arena import Advance, Changes

# --- Events --------------------------------------------------------


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
    """A robot was simulated and judged.

    Attributes:
        birth: whose robot.
        evaluation: what it came to.
        provenance: who did it.
        trial: which evaluation of the robot it is; 0 is the one at its birth.
        requester: the island that wanted it; None is the one of its birth.
    """

    birth: BirthId
    evaluation: Evaluation
    provenance: Provenance
    trial: int = 0
    requester: int | None = None


@dataclass(frozen=True, slots=True)
class EvaluationFailed:
    """A robot's simulation ended without a judgement, for a reason of its own.

    Attributes:
        birth: whose robot.
        reason: why.
        provenance: who found out.
        trial, requester: as of ``Evaluated``.
    """

    birth: BirthId
    reason: str
    provenance: Provenance
    trial: int = 0
    requester: int | None = None


@dataclass(frozen=True, slots=True)
class Advanced:
    """An arena shard reached the step that it was to reach.

    Attributes:
        island: whose shard.
        number: of the advance that was asked for.
        advance: what it came to; a journal gives it back without its poses, which
            stand in their table before the journal has this.
        pose_rows: how many rows its poses are.
        provenance: who advanced it.
    """

    island: int
    number: int
    advance: Advance
    pose_rows: int
    provenance: Provenance


@dataclass(frozen=True, slots=True)
class Pause:
    """The arena stands still until it is to resume."""


@dataclass(frozen=True, slots=True)
class Resume:
    """A paused arena goes on."""


@dataclass(frozen=True, slots=True)
class Insert:
    """A robot joins: a birth without parents, who may mate like any other.

    Attributes:
        genome: what it hands down, and develops from.
        place: where in the ground plane [m]; drawn as for any birth if None.
    """

    genome: Genome
    place: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Remove:
    """A robot is taken out; nothing happens if it is not there any more."""

    birth: BirthId


@dataclass(frozen=True, slots=True)
class ReplaceBrain:
    """A robot gets another brain, which it does not hand down."""

    birth: BirthId
    brain: Brain


Order = Pause | Resume | Insert | Remove | ReplaceBrain
"""What an operator may want of an arena."""


@dataclass(frozen=True, slots=True)
class Commanded:
    """An operator gave an order.

    Attributes:
        island: to which arena.
        command_id: unique; an order that comes twice is carried out once.
        step: at which it takes effect: the next decision (``Arena.next_step``).
        order: what is to be done.
    """

    island: int
    command_id: str
    step: int
    order: Order


@dataclass(frozen=True, slots=True)
class Immigrated:
    """A neighbour's migrants of an epoch came, be they none.

    Attributes:
        island: to whom.
        source: from which island.
        epoch: that ended there, from 0.
        migrants: who came, each with its fitness there.
    """

    island: int
    source: int
    epoch: int
    migrants: tuple[Individual, ...]


@dataclass(frozen=True, slots=True)
class NeighbourClosed:
    """A neighbour has finished: nobody comes from there any more.

    Attributes:
        island: whose neighbour.
        neighbour: which.
    """

    island: int
    neighbour: int


Travelled = Immigrated | NeighbourClosed
"""Events that come of other islands' commands; no journal holds them."""


@dataclass(frozen=True, slots=True)
class Audited:
    """Two workers, if there are two, did the same evaluation."""

    first: Evaluated | EvaluationFailed
    second: Evaluated | EvaluationFailed

    @property
    def agrees(self) -> bool:
        """They came to the same, to the last bit."""
        match self.first, self.second:
            case Evaluated(evaluation=one), Evaluated(evaluation=other):
                return one == other
            case EvaluationFailed(reason=one), EvaluationFailed(reason=other):
                return one == other
        return False


Answered = Vetted | VettingFailed | Evaluated | EvaluationFailed
"""Events that answer a question of an off-line island."""

Heard = Answered | Advanced | Commanded
"""Events of a journal that an island or an arena is told."""

Journalled = Heard | Audited
"""Events that are no function of others: what the journal keeps."""

IslandEvent = Started | Answered | Travelled

ArenaEvent = Started | Vetted | VettingFailed | Advanced | Commanded | Travelled

# --- Commands ------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Vet:
    """Have a candidate's body judged."""

    birth: BirthId
    attempt: int
    robot: Robot


@dataclass(frozen=True, slots=True)
class Evaluate:
    """Have a robot simulated and judged.

    Attributes:
        birth: whose robot.
        robot: itself.
        trial: which evaluation of the robot it is, from 0.
        steps: of physics to simulate; 0: as the experiment says for all.
        requester: as of ``Evaluated``.
    """

    birth: BirthId
    robot: Robot
    trial: int = 0
    steps: int = 0
    requester: int | None = None


@dataclass(frozen=True, slots=True)
class Record:
    """Write a row of a table; rows of one table come in a repeatable order."""

    table: str
    row: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Append:
    """Add rows of a bulk table that come as columns.

    Attributes:
        table: its name.
        rows: how many they are.
        columns: Arrow IPC stream of all columns but ``record``; empty in a replay,
            where the rows stand on disk already.
    """

    table: str
    rows: int
    columns: bytes


@dataclass(frozen=True, slots=True)
class AdvanceShard:
    """Have an arena changed and then advanced.

    Attributes:
        island: whose shard.
        number: of the shard's advances, from 0.
        until: step to reach.
        changes: what is done before.
        wants_snapshot: its state is due to be kept when it is there.
    """

    island: int
    number: int
    until: int
    changes: Changes
    wants_snapshot: bool


@dataclass(frozen=True, slots=True)
class Emigrate:
    """Send a neighbour the migrants of an epoch, be they none.

    Attributes:
        island: from where.
        to: the neighbour.
        epoch: that ended, from 0.
        migrants: who goes, or whose copies do.
    """

    island: int
    to: int
    epoch: int
    migrants: tuple[Individual, ...]


@dataclass(frozen=True, slots=True)
class Finish:
    """The island is done; its neighbours shall know."""

    island: int
    neighbours: tuple[int, ...] = ()


IslandCommand = Vet | Evaluate | Record | Emigrate | Finish

ArenaCommand = Vet | AdvanceShard | Record | Append | Emigrate | Finish
