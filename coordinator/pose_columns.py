"""Poses as a worker tells of them, as rows of the arena that they are in."""

import pyarrow as pa
import pyarrow.compute

from schema.tables import read_columns


def place_poses(columns: bytes, island: int) -> tuple[bytes, int]:
    """Return the poses of an arena, immigrants told from natives, and their number.

    Args:
        columns: Arrow IPC stream; ``island`` is where each was born.
        island: where they live.

    Raises:
        MalformedMessage: the columns are none of poses.
    """
    poses = read_columns("poses", columns)
    born = poses["island"]
    if pa.compute.all(pa.compute.equal(born, island), min_count=0).as_py():
        return columns, poses.num_rows
    is_foreign = pa.compute.not_equal(born, island)
    nobody = pa.scalar(None, pa.int32())
    schema = poses.schema
    here = pa.repeat(pa.scalar(island, pa.int32()), poses.num_rows)
    poses = poses.set_column(
        schema.get_field_index("birth_island"),
        schema.field("birth_island"),
        pa.compute.if_else(is_foreign, born, nobody),
    ).set_column(schema.get_field_index("island"), schema.field("island"), here)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, schema) as writer:
        writer.write_table(poses)
    return bytes(sink.getvalue().to_pybytes()), poses.num_rows
