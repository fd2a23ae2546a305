"""What the holder of an arena shard and whoever decides over it tell each other.

Time in an arena is counted in physics steps since it began. The worker that holds
a shard advances it to a step it is given; an advance is a pure function of the
shard's state, the changes made first and the step to reach.
"""

from dataclasses import dataclass

from schema.parts import Vector
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Robot


@dataclass(frozen=True, slots=True)
class Insertion:
    """A robot to be put into the arena.

    Attributes:
        birth: who it is.
        robot: what it is.
        place: where the core's centre goes in the ground plane, world frame [m].
        heading: turn about z [rad].
    """

    birth: BirthId
    robot: Robot
    place: tuple[float, float]
    heading: float = 0.0


@dataclass(frozen=True, slots=True)
class BrainChange:
    """An operator replaces a living robot's brain; its states begin anew."""

    birth: BirthId
    brain: Brain


@dataclass(frozen=True, slots=True)
class Changes:
    """What is done to an arena before it advances: removals, insertions, brains."""

    removals: tuple[BirthId, ...] = ()
    insertions: tuple[Insertion, ...] = ()
    brains: tuple[BrainChange, ...] = ()


@dataclass(frozen=True, slots=True)
class Judgement:
    """How a living robot does at the end of an advance.

    Attributes:
        birth: who.
        age_s: since insertion [s].
        path_velocity, straight_velocity: over the sliding window [m/s].
        fitness: of the window; 0 before a quarter of it has been lived.
        is_mature: it has lived its warm-up and a whole window.
        place: core's centre, world frame [m].
    """

    birth: BirthId
    age_s: float
    path_velocity: float
    straight_velocity: float
    fitness: float
    is_mature: bool
    place: Vector


@dataclass(frozen=True, slots=True)
class Casualty:
    """A robot whose physics diverged: it is gone, with the reason."""

    birth: BirthId
    step: int
    reason: str
    place: Vector


@dataclass(frozen=True, slots=True)
class Touch:
    """Two robots touched each other during an advance, for so long [s]."""

    first: BirthId
    second: BirthId
    duration_s: float


@dataclass(frozen=True, slots=True)
class Advance:
    """What an advance came to.

    Attributes:
        step: reached.
        digest: SHA-256 of the state there, which is that of a snapshot of it.
        judgements: of all living robots, by birth.
        casualties: in the order in which they fell.
        touches: by pair; empty unless the experiment asks for them.
        poses: Arrow IPC stream of samples (schema.tables.columns.POSES without record).
    """

    step: int
    digest: bytes
    judgements: tuple[Judgement, ...]
    casualties: tuple[Casualty, ...]
    touches: tuple[Touch, ...]
    poses: bytes
