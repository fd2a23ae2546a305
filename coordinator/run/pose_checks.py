"""Checks of the poses of an advance, and how their table has them."""

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute

from coordinator.run.advance_checks import ExpectedAdvance, names
from coordinator.run.answer_checks import impossible
from schema.robot.ids import BirthId
from schema.tables.received import received_columns
from schema.wire.arena import Advance

_NO_POSES = (0, 0, 0)
_UNIT = 0.01
"""Greatest difference of a quaternion's length from 1."""


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
                f"poses: robot {names([birth])} must have {robot.joints} angles"
            )
    for one in advance.judgements:
        if found.pop(one.birth, _NO_POSES)[0] != len(expected.samples):
            raise impossible(
                f"poses: robot {names([one.birth])} must have {len(expected.samples)}"
            )
    for fallen in advance.casualties:
        before = sum(step <= fallen.step for step in expected.samples)
        if found.pop(fallen.birth, _NO_POSES)[0] > before:
            raise impossible(
                f"poses: robot {names([fallen.birth])} must have <= {before}"
            )
    if found:
        raise impossible(f"poses: robots {names(found)} do not live here")
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
