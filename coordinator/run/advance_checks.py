"""Checks of advances and poses against their requests and the state of their arenas.

An advance that passes names exactly the robots that live, and its times, ages and
counts are those that follow from the request; so no state machine raises for it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute

from coordinator.run.requests import (
    Expected,
    check_count,
    check_job,
    check_velocities,
    impossible,
)
from schema.experiment.document import Experiment
from schema.limits import (
    ANGLE_BYTES,
    CHANNEL_NUMBERS,
    COLUMNS_BYTES,
    GREATEST_COORDINATE,
    JUDGEMENT_BYTES,
    POSE_BYTES,
    SNAPSHOT_BYTES,
    SNAPSHOT_ROBOT_BYTES,
    SNAPSHOT_SAMPLE_BYTES,
    TOUCH_BYTES,
)
from schema.parts import BodySpace, Vector
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.tables.received import received_columns
from schema.wire.arena import Advance, Casualty, Changes, Judgement, Touch
from schema.wire.arena_codec import AdvanceAnswer

_SHOWN = 3
"""Robots that a message names."""
_ROUNDING_S = 1e-6
_NO_POSES = (0, 0, 0)
_UNIT = 0.01
"""Greatest difference of a quaternion's length from 1."""


@dataclass(frozen=True, slots=True)
class Inserted:
    """A living robot of an arena.

    Attributes:
        step: of its insertion.
        joints: their number; None if its body is not known, as after a snapshot.
        window: step at which the window of its fitness was restarted last; 0 if it
            never was.
    """

    step: int
    joints: int | None
    window: int = 0


def inserted(robot: Robot, space: BodySpace, step: int) -> Inserted:
    """Return what advances are checked against for a robot inserted at a step."""
    shapes = (space[part.kind].shape(part.parameters) for part in robot.parts)
    return Inserted(step, sum(shape.joint is not None for shape in shapes))


def restarted(changes: Changes) -> list[BirthId]:
    """Return the robots whose windows changes restart."""
    return [change.birth for change in changes.brains if change.restarts_window]


@dataclass(frozen=True, slots=True)
class ExpectedAdvance:
    """What a correct answer to a request to advance an arena has.

    Attributes:
        job: epoch and number of the request.
        from_step, until: of the request.
        born: robots that live after the requested changes.
        experiment: of the island.
        wants_snapshot: the answer must hold the state at the end.
        is_whole: the request has what is needed to rebuild the state.
    """

    job: Expected
    from_step: int
    until: int
    born: Mapping[BirthId, Inserted]
    experiment: Experiment
    wants_snapshot: bool
    is_whole: bool

    @property
    def samples(self) -> range:
        """Steps at which poses are recorded."""
        interval = self.experiment.simulation.pose_steps
        first = self.from_step // interval + 1
        return range(first * interval, self.until + 1, interval)

    @property
    def has_touches(self) -> bool:
        """The arena records which robots touch."""
        arena = self.experiment.arena
        return arena is not None and arena.record_touches

    @property
    def most_rows(self) -> int:
        """Number of poses if all robots live to the end."""
        return len(self.samples) * len(self.born)

    @property
    def most_pose_bytes(self) -> int:
        """Length of columns with as many poses."""
        most = self.experiment.space.max_parts
        joints = sum(
            most if one.joints is None else one.joints for one in self.born.values()
        )
        a_sample = len(self.born) * POSE_BYTES + joints * ANGLE_BYTES
        return COLUMNS_BYTES + len(self.samples) * a_sample

    @property
    def _most_channel_bytes(self) -> int:
        """Length of all channels of a trace in one sample of a window."""
        space = self.experiment.space
        return 8 * (CHANNEL_NUMBERS + 4 * space.max_parts + space.max_inputs)

    @property
    def most_bytes(self) -> int:
        """Greatest length of a correct answer [bytes]."""
        robots, simulation = len(self.born), self.experiment.simulation
        window = simulation.window_steps // simulation.pose_steps + 2
        sample_bytes = SNAPSHOT_SAMPLE_BYTES + self._most_channel_bytes
        robot_bytes = SNAPSHOT_ROBOT_BYTES + window * sample_bytes
        return (
            self.most_pose_bytes
            + robots * JUDGEMENT_BYTES
            + self.has_touches * robots**2 * TOUCH_BYTES
            + self.wants_snapshot * (SNAPSHOT_BYTES + robots * robot_bytes)
        )


def check_answer(answer: AdvanceAnswer, expected: ExpectedAdvance) -> None:
    """Raise unless an answer is to its request and has the snapshot that was wanted.

    The advance itself is not checked. It is missing if the worker lacks the state.

    Raises:
        MalformedMessage: the answer to another request; no advance although the state
            came with the request; no snapshot, one that was not wanted, or one of
            another state.
    """
    check_job(answer.epoch, answer.number, expected.job)
    advance = answer.advance
    if advance is None:
        if expected.is_whole:
            raise impossible("answer: lacks the state that came with the request")
        return
    if bool(answer.snapshot) != expected.wants_snapshot:
        raise impossible(
            "advance: a snapshot was wanted, got none"
            if expected.wants_snapshot
            else "advance: no snapshot was wanted, got one"
        )
    if answer.snapshot and sha256(answer.snapshot).digest() != advance.digest:
        raise impossible("advance: the snapshot must have the digest of the state")


def check_advance(advance: Advance, expected: ExpectedAdvance) -> None:
    """Raise unless an advance is a result of its request; poses are not checked.

    Raises:
        MalformedMessage: another step; unknown, missing or repeated robots; numbers
            that do not follow from the request.
    """
    if advance.step != expected.until:
        raise impossible(
            f"advance: must reach step {expected.until}, got {advance.step}"
        )
    _check_robots(advance, expected.born)
    for one in advance.judgements:
        _check_judgement(one, expected)
    last = expected.from_step
    for fallen in advance.casualties:
        if not last <= fallen.step <= expected.until:
            raise impossible(
                f"casualty {_names([fallen.birth])}: step must be in "
                f"{last}..{expected.until}, got {fallen.step}"
            )
        last = fallen.step
        _check_place(fallen)
    _check_touches(advance.touches, expected)


def _check_robots(advance: Advance, born: Mapping[BirthId, Inserted]) -> None:
    """Raise unless exactly the living robots are reported, each once."""
    judged = [one.birth for one in advance.judgements]
    if any(a >= b for a, b in pairwise(judged)):
        raise impossible("advance: judgements must ascend by birth")
    reported = {*judged, *(one.birth for one in advance.casualties)}
    problems = []
    if unknown := reported - born.keys():
        problems.append(f"unknown {_names(unknown)}")
    if missing := born.keys() - reported:
        problems.append(f"missing {_names(missing)}")
    if len(reported) < len(advance.judgements) + len(advance.casualties):
        problems.append("a robot is reported twice")
    if problems:
        raise impossible(
            "advance: must report each living robot once: " + ", ".join(problems)
        )


def _check_judgement(one: Judgement, expected: ExpectedAdvance) -> None:
    name, robot = _names([one.birth]), expected.born[one.birth]
    simulation = expected.experiment.simulation
    age_s = (expected.until - robot.step) * simulation.timestep_s
    if one.age_s != age_s:
        raise impossible(f"robot {name}: age must be {age_s} s, got {one.age_s} s")
    is_mature = _window(robot, expected) > (
        simulation.window_steps // simulation.pose_steps
    )
    if one.is_mature != is_mature:
        raise impossible(f"robot {name}: is_mature must be {is_mature}")
    check_velocities(one.path_velocity, one.straight_velocity)
    if one.measures or is_mature:
        check_count(one.measures, len(expected.experiment.measures.names))
    _check_place(one)


def _window(robot: Inserted, expected: ExpectedAdvance) -> int:
    """Return how many samples a robot's window has been given.

    The first one is taken at birth if there is no warm-up, and at a restart.
    """
    simulation, born = expected.experiment.simulation, robot.step
    interval, warmup = simulation.pose_steps, simulation.warmup_steps
    last = expected.until // interval
    if robot.window > born:
        return last - (max(robot.window, born + warmup) - 1) // interval
    before = (born + warmup - 1) // interval if warmup else born // interval
    return last - before + (not warmup)


def _check_place(one: Judgement | Casualty) -> None:
    place: Vector = one.place
    if max(map(abs, place)) > GREATEST_COORDINATE:
        raise impossible(
            f"robot {_names([one.birth])}: coordinates must be within "
            f"{GREATEST_COORDINATE:g} m, got {place}"
        )


def _check_touches(touches: Sequence[Touch], expected: ExpectedAdvance) -> None:
    if touches and not expected.has_touches:
        raise impossible("advance: touches are not recorded, got some")
    arena, simulation = expected.experiment.arena, expected.experiment.simulation
    assert arena is not None
    steps = expected.until - expected.from_step + arena.proximity_steps
    longest_s = steps * simulation.timestep_s + _ROUNDING_S
    for touch in touches:
        pair = (touch.first, touch.second)
        if touch.first == touch.second or not expected.born.keys() >= set(pair):
            raise impossible(
                f"touch: must be of two robots that live here, got {_names(pair)}"
            )
        if not 0.0 < touch.duration_s <= longest_s:
            raise impossible(
                f"touch of {_names(pair)}: must take up to {longest_s:g} s, "
                f"got {touch.duration_s} s"
            )
    pairs = [(touch.first, touch.second) for touch in touches]
    if any(a >= b for a, b in pairwise(pairs)):
        raise impossible("advance: touches must ascend by pair")


def read_poses(columns: bytes, advance: Advance, expected: ExpectedAdvance) -> pa.Table:
    """Return the poses of an advance that passes ``check_advance``.

    Raises:
        MalformedMessage: not the columns of poses; poses at other times, of other
            robots, repeated, missing or not finite.
    """
    rows = received_columns(
        "poses",
        columns,
        most_bytes=expected.most_pose_bytes,
        most_rows=expected.most_rows,
    )
    _check_numbers(rows)
    samples = _sample_of_row(rows, expected)
    found = _poses_of_robots(rows, samples)
    for birth, (_, least, most) in found.items():
        robot = expected.born.get(birth)
        if robot is None or robot.joints is None:
            continue
        if (least, most) != (robot.joints, robot.joints):
            raise impossible(
                f"poses: robot {_names([birth])} must have {robot.joints} angles"
            )
    for one in advance.judgements:
        if found.pop(one.birth, _NO_POSES)[0] != len(expected.samples):
            raise impossible(
                f"poses: robot {_names([one.birth])} must have {len(expected.samples)}"
            )
    for fallen in advance.casualties:
        before = sum(step <= fallen.step for step in expected.samples)
        if found.pop(fallen.birth, _NO_POSES)[0] > before:
            raise impossible(
                f"poses: robot {_names([fallen.birth])} must have <= {before}"
            )
    if found:
        raise impossible(f"poses: robots {_names(found)} do not live here")
    return rows


def _poses_of_robots(
    rows: pa.Table, samples: npt.NDArray[np.int64]
) -> dict[BirthId, tuple[int, int, int]]:
    """Return each robot's number of poses, and the least and most angles of one.

    Raises:
        MalformedMessage: two poses of one robot in one sample.
    """
    islands, numbers = rows["island"].to_numpy(), rows["birth"].to_numpy()
    order = np.lexsort((samples, numbers, islands))
    keys = [column[order] for column in (islands, numbers, samples)]
    is_other = [column[1:] != column[:-1] for column in keys]
    is_new = is_other[0] | is_other[1]
    if not (is_new | is_other[2]).all():
        raise impossible("poses: must have one row per robot and time")
    if not len(order):
        return {}
    starts = np.concatenate([[0], np.flatnonzero(is_new) + 1])
    counts = np.diff(starts, append=len(order))
    angles = pyarrow.compute.list_value_length(rows["angles"]).to_numpy()[order]
    births = zip(keys[0][starts].tolist(), keys[1][starts].tolist(), strict=True)
    facts = zip(
        counts.tolist(),
        np.minimum.reduceat(angles, starts).tolist(),
        np.maximum.reduceat(angles, starts).tolist(),
        strict=True,
    )
    return {BirthId(*birth): fact for birth, fact in zip(births, facts, strict=True)}


def _sample_of_row(rows: pa.Table, expected: ExpectedAdvance) -> npt.NDArray[np.int64]:
    """Return the number of the sample of each row.

    Raises:
        MalformedMessage: times that are not those of samples, or descend.
    """
    timestep_s = expected.experiment.simulation.timestep_s
    times = np.array([step * timestep_s for step in expected.samples])
    found = rows["sim_time_s"].to_numpy()
    samples: npt.NDArray[np.int64] = np.searchsorted(times, found).astype(np.int64)
    is_known = samples < len(times)
    if not is_known.all() or (times[samples] != found).any():
        raise impossible(
            "poses: must be at multiples of simulation.pose_steps after step "
            f"{expected.from_step} up to {expected.until}"
        )
    if (np.diff(samples) < 0).any():
        raise impossible("poses: times must ascend")
    return samples


def _check_numbers(rows: pa.Table) -> None:
    if rows["birth_island"].null_count < rows.num_rows:
        raise impossible("poses: birth_island must be null")
    columns = [rows[name].to_numpy() for name in ("x", "y", "z")]
    attitude = np.stack([rows[f"q{axis}"].to_numpy() for axis in "wxyz"])
    # A signalling NaN warns when it is converted.
    with np.errstate(invalid="ignore"):
        lengths = np.sqrt((attitude.astype(np.float64) ** 2).sum(axis=0))
    angles = pyarrow.compute.list_flatten(rows["angles"]).to_numpy()
    if not all(np.isfinite(each).all() for each in (*columns, lengths, angles)):
        raise impossible("poses: must be finite")
    if (np.abs(lengths - 1.0) > _UNIT).any():
        raise impossible("poses: quaternions must have the length 1")


def place_poses(columns: bytes, poses: pa.Table, island: int) -> bytes:
    """Return the poses of an arena as the table has them.

    Args:
        columns: Arrow IPC stream; ``island`` is where each robot was born.
        poses: the rows of the columns.
        island: where the robots live; ``birth_island`` is set for immigrants only.
    """
    born = poses["island"]
    if pa.compute.all(pa.compute.equal(born, island), min_count=0).as_py():
        return columns
    is_immigrant = pa.compute.not_equal(born, island)
    absent = pa.scalar(None, pa.int32())
    schema = poses.schema
    here = pa.repeat(pa.scalar(island, pa.int32()), poses.num_rows)
    poses = poses.set_column(
        schema.get_field_index("birth_island"),
        schema.field("birth_island"),
        pa.compute.if_else(is_immigrant, born, absent),
    ).set_column(schema.get_field_index("island"), schema.field("island"), here)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, schema) as writer:
        writer.write_table(poses)
    return bytes(sink.getvalue().to_pybytes())


def _names(births: Iterable[BirthId]) -> str:
    """Return the first of some births as text, and how many more there are."""
    ordered = sorted(births)
    shown = ", ".join(f"{one.island}/{one.number}" for one in ordered[:_SHOWN])
    more = len(ordered) - _SHOWN
    return f"{shown} and {more} more" if more > 0 else shown
