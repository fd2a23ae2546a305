"""Events that islands and arenas handle, and the commands that they return.

Events are past participles, commands imperatives; all are immutable.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

from coordinator.evolution.breeding import Individual
from coordinator.evolution.learners.learner import Batch, Points
from schema.experiment.section import Count
from schema.limits import Finite, printable
from schema.robot.brain import Brain
from schema.robot.ids import BirthId, IslandNumber
from schema.robot.results import Evaluation, Provenance
from schema.wire.arena import Advance, AdvanceShard
from schema.wire.codec import Message
from schema.wire.messages import Bred, Breed, Evaluate

QUARANTINED = "quarantined: "
"""Begin of the reason of a failed evaluation that crashed its workers' processes."""
_SHOWN = 80
"""Characters of a text that an error shows."""


def brief(event: Message | str) -> str:
    """Return the type of an event and its names and numbers; a text stays as it is."""
    if isinstance(event, str):
        return event
    values = {name: getattr(event, name) for name in event.__struct_fields__}
    small = (
        f"{name}={printable(str(value), _SHOWN)}"
        for name, value in values.items()
        if isinstance(value, int | str | BirthId)
    )
    return f"{type(event).__name__}({', '.join(small)})"


# --- Events --------------------------------------------------------


class Started(Message, frozen=True):
    """The run starts; the first event, once."""


class Evaluated(Message, frozen=True, tag=True):
    """A robot was evaluated.

    Attributes:
        provenance: which worker did it.
        trial: number of the evaluation of this robot; 0 is the one at its birth.
        requester: island that requested it; None for the island of its birth.
        point: of the request.
    """

    birth: BirthId
    evaluation: Evaluation
    provenance: Provenance
    trial: int = 0
    requester: int | None = None
    point: int | None = None
    reason: ClassVar[str] = ""
    is_quarantined: ClassVar[bool] = False


class EvaluationFailed(Message, frozen=True, tag=True):
    """A robot's evaluation failed for a reason that lies in the robot.

    Attributes:
        provenance: which worker reported it.
        trial, requester, point: as in ``Evaluated``.
    """

    birth: BirthId
    reason: str
    provenance: Provenance
    trial: int = 0
    requester: int | None = None
    point: int | None = None
    evaluation: ClassVar[None] = None

    @property
    def is_quarantined(self) -> bool:
        """The robot has no evaluation because it crashes its processes."""
        return self.reason.startswith(QUARANTINED)


Outcome = Evaluated | EvaluationFailed
"""Answers to a request to evaluate a robot: either a reason or an evaluation."""


class Asked(Message, frozen=True, tag=True):
    """A learner answered which parameters to try.

    Attributes:
        number: number of the request, from 0.
        points: parameters of each trial, as shares of their ranges.
    """

    birth: BirthId
    number: int
    points: Points


class Advanced(Message, frozen=True, tag=True):
    """An arena shard reached the requested step.

    Attributes:
        number: number of the requested advance.
        advance: its result; a journal returns it without poses, which are stored in
            their table before the journal has this event.
        pose_rows: number of pose rows.
        provenance: which worker advanced it.
    """

    island: int
    number: int
    advance: Advance
    pose_rows: int
    provenance: Provenance


class Pause(Message, frozen=True, tag=True):
    """Pause the arena until it is resumed."""


class Resume(Message, frozen=True, tag=True):
    """Resume a paused arena."""


class Insert(Message, frozen=True, tag=True):
    """Insert a robot: a birth that no couple led to; it may mate like any other robot.

    Attributes:
        genome: bytes of its genome, in the encoding of the experiment.
        place: point of the ground plane [m]; drawn as for any birth if None.
        parents: robots that count as its parents.
        rank: in ancestry, of the robot.
    """

    genome: bytes
    place: tuple[Finite, Finite] | None = None
    parents: tuple[BirthId, ...] = ()
    rank: int = 1


class Remove(Message, frozen=True, tag=True):
    """Remove a robot; no effect if it is dead."""

    birth: BirthId


class ReplaceBrain(Message, frozen=True, tag=True):
    """Replace a robot's brain; its genome stays the same."""

    birth: BirthId
    brain: Brain


Order = Pause | Resume | Insert | Remove | ReplaceBrain
"""Orders that an operator may give to an arena."""


class Commanded(Message, frozen=True, tag=True):
    """An operator gave an order.

    Attributes:
        command_id: unique id; a repeated order is carried out once.
        step: step at which it takes effect: the next decision (``Arena.next_step``).
    """

    island: int
    command_id: str
    step: int
    order: Order


class Immigrated(Message, frozen=True, tag=True):
    """A neighbour's migrants of an epoch arrived (may be empty).

    Attributes:
        island: the receiving island.
        source: the sending island.
        epoch: number of the epoch that ended there, from 0.
        migrants: individuals with their fitness at the source.
        follows_closing: an island had finished before, and what it did not send has
            influenced the source.
    """

    island: IslandNumber
    source: IslandNumber
    epoch: Count
    migrants: tuple[Individual, ...]
    follows_closing: bool = False


class NeighbourClosed(Message, frozen=True, tag=True):
    """A neighbour has finished and sends no more migrants."""

    island: IslandNumber
    neighbour: IslandNumber


MigrationEvent = Immigrated | NeighbourClosed
"""Events that follow from other islands' commands.

They are journalled if the other island is of another group.
"""


def source_of(event: MigrationEvent) -> int:
    """Return the island that an event comes from."""
    return event.source if isinstance(event, Immigrated) else event.neighbour


class Served(Message, frozen=True, tag=True):
    """A group of islands needs no more migrants of this one."""

    group: Count


class Audited(Message, frozen=True, tag=True):
    """The same evaluation was done twice, by two workers if there are two."""

    first: Outcome
    second: Outcome

    @property
    def agrees(self) -> bool:
        """Both outcomes are equal to the last bit."""
        one, other = self.first, self.second
        return (one.evaluation, one.reason) == (other.evaluation, other.reason)

    @property
    def is_settled(self) -> bool:
        """The first outcome counts: both are equal, or both crashed their processes.

        What ends a process may differ between machines, and from time to time.
        """
        are_quarantined = self.first.is_quarantined and self.second.is_quarantined
        return self.agrees or are_quarantined


Answered = Bred | Outcome | Asked
"""Events that answer a request of an island; an arena requests no evaluation."""

ExternalEvent = Answered | Advanced | Commanded
"""Journalled events that an island or an arena handles."""

JournalledEvent = ExternalEvent | MigrationEvent | Audited | Served
"""Events that the journal keeps: all that do not follow from other events."""

IslandEvent = Started | Answered | MigrationEvent

ArenaEvent = Started | Bred | Asked | Advanced | Commanded | MigrationEvent

# --- Commands ------------------------------------------------------


class Ask(Message, frozen=True):
    """Ask the learner of a newborn which parameters to try.

    Attributes:
        number: number of the request, from 0.
        start: parameters at which the learner begins, as shares of their ranges.
        most: greatest number of points, at least 1.
        told: what was tried so far, all trials of a request together.
    """

    birth: BirthId
    number: int
    start: tuple[float, ...]
    most: int
    told: tuple[Batch, ...]


class Record(Message, frozen=True):
    """Write a row of a table; the rows of a table have a reproducible order."""

    table: str
    row: Mapping[str, Any]


class Append(Message, frozen=True):
    """Append the poses of an advance to their table.

    Attributes:
        event: the advance; without poses in a replay, where they are on disk already.
    """

    event: Advanced


class Emigrate(Message, frozen=True):
    """Send the migrants of an epoch (may be empty) to a neighbour.

    Attributes:
        island: the sending island.
        to: the receiving island.
        epoch: number of the epoch that ended, from 0.
        migrants: individuals that are moved or copied.
        follows_closing: as of ``Immigrated``.
    """

    island: int
    to: int
    epoch: int
    migrants: tuple[Individual, ...]
    follows_closing: bool = False


class Finish(Message, frozen=True):
    """The island has finished; its neighbours are informed."""

    island: int
    neighbours: tuple[int, ...] = ()


def arrival(command: Emigrate) -> Immigrated:
    """Return the event that a command is for the receiving island."""
    sent, migrants = command, command.migrants
    return Immigrated(sent.to, sent.island, sent.epoch, migrants, sent.follows_closing)


IslandCommand = Breed | Evaluate | Ask | Record | Emigrate | Finish

ArenaCommand = Breed | Ask | AdvanceShard | Record | Append | Emigrate | Finish
