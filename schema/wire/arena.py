"""Changes and advances of arena shards, exchanged by coordinator and worker.

Time in an arena is counted in physics steps from its start. The worker that holds a
shard advances it to a given step. An advance is a pure function of the state of the
shard, the changes and the step.
"""

from dataclasses import dataclass

from schema.parts import Vector
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Robot


@dataclass(frozen=True, slots=True)
class Insertion:
    """Insertion of a robot into the arena.

    Attributes:
        birth: id of the robot.
        robot: body and brain.
        place: centre of the core in the ground plane, world frame [m].
        heading: rotation about z [rad].
    """

    birth: BirthId
    robot: Robot
    place: tuple[float, float]
    heading: float = 0.0


@dataclass(frozen=True, slots=True)
class BrainChange:
    """Replacement of a living robot's brain; neuron states are reset.

    Attributes:
        birth: id of the robot.
        brain: the new brain, whose first tick is the next one of the arena.
        restarts_window: the window of its fitness begins now; its age goes on.
    """

    birth: BirthId
    brain: Brain
    restarts_window: bool = False


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes of an arena before an advance: removals, insertions, brains."""

    removals: tuple[BirthId, ...] = ()
    insertions: tuple[Insertion, ...] = ()
    brains: tuple[BrainChange, ...] = ()


@dataclass(frozen=True, slots=True)
class Judgement:
    """Fitness of a living robot at the end of an advance.

    Attributes:
        birth: id of the robot.
        age_s: simulated time since insertion [s].
        path_velocity, straight_velocity: over the sliding window [m/s].
        fitness: of the window; 0 before a quarter of the window.
        is_mature: its age is at least the warm-up and a whole window.
        place: centre of the core, world frame [m].
        measures: of the window, in the order of the experiment's ``measures.names``;
            empty before a quarter of the window.
    """

    birth: BirthId
    age_s: float
    path_velocity: float
    straight_velocity: float
    fitness: float
    is_mature: bool
    place: Vector
    measures: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Casualty:
    """Removal of a robot whose simulation diverged, with the reason."""

    birth: BirthId
    step: int
    reason: str
    place: Vector


@dataclass(frozen=True, slots=True)
class Touch:
    """Contact of two robots during an advance, and its total duration [s]."""

    first: BirthId
    second: BirthId
    duration_s: float


@dataclass(frozen=True, slots=True)
class Advance:
    """Result of an advance.

    Attributes:
        step: at its end.
        digest: SHA-256 of the state at that step, as of a snapshot of it.
        judgements: of all living robots, by birth.
        casualties: in the order in which they diverged.
        touches: by pair; empty unless the experiment records them.
        poses: Arrow IPC stream of samples (schema.tables.columns.POSES without record).
    """

    step: int
    digest: bytes
    judgements: tuple[Judgement, ...]
    casualties: tuple[Casualty, ...]
    touches: tuple[Touch, ...]
    poses: bytes
