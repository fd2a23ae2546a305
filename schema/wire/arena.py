"""Changes and advances of arena shards, exchanged by coordinator and worker.

Time in an arena is counted in physics steps from its start. The worker that holds a
shard advances it to a given step. An advance is a pure function of the state of the
shard, the changes and the step.
"""

from typing import Annotated

from msgspec import Meta

from schema.experiment.section import Count
from schema.limits import MOST_LIVING, MOST_PATCHES, MOST_TOUCHES, Finite
from schema.parts import Vector
from schema.robot.brain import Brain
from schema.robot.ids import BirthId, IslandNumber
from schema.robot.results import Measures
from schema.robot.robot import Robot
from schema.wire.codec import Message

Births = Annotated[tuple[BirthId, ...], Meta(max_length=MOST_LIVING)]
Digest = Annotated[bytes, Meta(min_length=32, max_length=32)]
Box = tuple[Finite, Finite, Finite, Finite]
"""Least x, y, then greatest x, y of a box seen from above, world frame [m]."""


class Insertion(Message, frozen=True):
    """Insertion of a robot into the arena.

    Attributes:
        birth: id of the robot.
        robot: body and brain.
        place: centre of the core in the ground plane, world frame [m].
        heading: rotation about z [rad].
    """

    birth: BirthId
    robot: Robot
    place: tuple[Finite, Finite]
    heading: Finite = 0.0


class BrainChange(Message, frozen=True):
    """Replacement of a living robot's brain; neuron states are reset.

    Attributes:
        birth: id of the robot.
        brain: the new brain, whose first tick is the next one of the arena.
        restarts_window: the window of its fitness begins now; its age goes on.
    """

    birth: BirthId
    brain: Brain
    restarts_window: bool = False


class Changes(Message, frozen=True):
    """Changes of an arena before an advance.

    Attributes:
        removals: robots that leave, first of all.
        insertions: robots that come.
        brains: new brains of robots that live then.
        lights: positions of the patches that shine until the next changes, world frame
            [m].
    """

    removals: Births = ()
    insertions: Annotated[tuple[Insertion, ...], Meta(max_length=MOST_LIVING)] = ()
    brains: Annotated[tuple[BrainChange, ...], Meta(max_length=MOST_LIVING)] = ()
    lights: Annotated[tuple[Vector, ...], Meta(max_length=MOST_PATCHES)] = ()


class PastAdvance(Message, frozen=True):
    """Past advance to repeat.

    Attributes:
        changes: before the advance.
        until: step that it reached.
        digest: of the state at that step.
    """

    changes: Changes
    until: Count
    digest: Digest


class Rebuild(Message, frozen=True):
    """Data to rebuild the state of a shard.

    Attributes:
        snapshot: of the shard; empty for an arena before its first advance.
        history: advances since the snapshot, oldest first.
        living: robots that must live at the end, if the advances ran on another
            platform, where results may differ.
    """

    snapshot: bytes
    history: tuple[PastAdvance, ...]
    living: Births | None = None


class ArenaPart(Message, frozen=True):
    """What is different for a worker that advances only a part of an arena's robots.

    Attributes:
        number: of the part; a worker holds each part by itself.
        departures: robots that leave first: other workers advance them, or they died.
        arrivals: state of robots that come then, an ``ArenaState``; empty if none does.
        checks_merges: robots are born in some part, so merges are checked in all.
        judges: the advance ends, so robots are judged.
        work_j: work of the motors of the part's robots so far in this advance, by
            birth [J]; empty at its start.
    """

    number: Count
    departures: Births
    arrivals: bytes
    checks_merges: bool
    judges: bool
    work_j: Annotated[tuple[Finite, ...], Meta(max_length=MOST_LIVING)] = ()


class AdvanceShard(Message, frozen=True, tag="advance"):
    """Change an arena shard, then advance it.

    Attributes:
        island: number of the arena.
        number: number of the advance, from 0.
        until: step to reach.
        changes: changes before the advance.
        wants_snapshot: a snapshot is due at the end of the advance.
        wants_tracks: the rules of the arena need ``Advance.tracks``.
        from_step: step at which the advance starts.
        from_digest: of the state at that step; empty before the first advance.
        rebuild: data to rebuild the state at the start; None for a worker that
            holds it.
        part: that is advanced; None for the whole arena.
    """

    island: IslandNumber
    number: Count
    until: Count
    changes: Changes
    wants_snapshot: bool
    wants_tracks: bool = False
    from_step: Count = 0
    from_digest: Annotated[bytes, Meta(max_length=32)] = b""
    rebuild: Rebuild | None = None
    part: ArenaPart | None = None


class Judgement(Message, frozen=True, array_like=True):
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
    age_s: Finite
    path_velocity: Finite
    straight_velocity: Finite
    fitness: Finite
    is_mature: bool
    place: Vector
    measures: Measures = ()


class Casualty(Message, frozen=True, array_like=True):
    """Removal of a robot whose simulation diverged.

    Attributes:
        birth: id of the robot.
        step: at which it was removed.
        reason: what diverged.
        place: of the core when it was removed, world frame [m].
    """

    birth: BirthId
    step: Count
    reason: str
    place: Vector


class Touch(Message, frozen=True, array_like=True):
    """Contact of two robots during an advance.

    Attributes:
        first, second: ids of the robots.
        duration_s: total duration [s].
    """

    first: BirthId
    second: BirthId
    duration_s: Finite


class Poses(Message, frozen=True, array_like=True):
    """N samples of robots' poses, as columns of little-endian numbers.

    Attributes:
        islands: islands on which the robots were born, N int32.
        births: their numbers there, N int64.
        times_s: simulated times [s], N float64.
        cores: position [m] and quaternion, core to world, of each core, N x 7 float32.
        joints: numbers of joint angles, N int32.
        angles: joint angles, sample by sample [rad], float32.
    """

    islands: bytes = b""
    births: bytes = b""
    times_s: bytes = b""
    cores: bytes = b""
    joints: bytes = b""
    angles: bytes = b""


NO_POSES = Poses()


class Advance(Message, frozen=True, tag="advance"):
    """Result of an advance.

    Attributes:
        step: at its end.
        digest: SHA-256 of the state at that step, as of a snapshot of it.
        judgements: of all living robots, by birth.
        casualties: by step and birth.
        touches: by pair; empty unless the experiment records them.
        poses: samples of the robots' poses; empty in a journal.
        snapshot: the state at that step; empty if it was not wanted, and in a journal.
        work_j: motor work of the robots of ``judgements`` during the advance [J];
            empty unless tracks were wanted.
        tracks: positions of their cores in the ground plane at the S samples of poses
            [m], R x S x 2 float32; empty unless wanted. The coordinator takes them
            from the poses.
        boxes: swept by the robots of a part, by birth, also by those that diverged;
            empty for a whole arena, and in a journal.
        costs: of these robots, in a unit of the worker.
    """

    step: Count
    digest: Digest
    judgements: Annotated[tuple[Judgement, ...], Meta(max_length=MOST_LIVING)]
    casualties: Annotated[tuple[Casualty, ...], Meta(max_length=MOST_LIVING)]
    touches: Annotated[tuple[Touch, ...], Meta(max_length=MOST_TOUCHES)]
    poses: Poses = NO_POSES
    snapshot: bytes = b""
    work_j: Annotated[tuple[Finite, ...], Meta(max_length=MOST_LIVING)] = ()
    tracks: bytes = b""
    boxes: Annotated[tuple[Box, ...], Meta(max_length=MOST_LIVING)] = ()
    costs: Annotated[tuple[Finite, ...], Meta(max_length=MOST_LIVING)] = ()


class Live(Message, frozen=True):
    """Message to viewers after each advance, published best effort.

    Attributes:
        run: name of the run.
        shard: number of the arena's island.
        advance: the result, poses included.
        is_part: of some of the arena's robots only.
    """

    run: str
    shard: IslandNumber
    advance: Advance
    is_part: bool = False
