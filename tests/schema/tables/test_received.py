"""Arrow columns of other processes: what is refused, and at what cost."""

import resource
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pyarrow as pa
import pytest

from schema.errors import MalformedMessage
from schema.robot.ids import BirthId
from schema.tables.columns import ROWS
from schema.tables.received import received_columns
from tests.coordinator.arena_world import poses

SCHEMA = ROWS["poses"]
COLUMNS = poses([BirthId(0, number) for number in range(5)], 1.0)


def read(columns: bytes, most_bytes: int = 1 << 24, most_rows: int = 5) -> pa.Table:
    return received_columns(
        "poses", columns, most_bytes=most_bytes, most_rows=most_rows
    )


def written(
    rows: pa.Table | pa.RecordBatch,
    schema: pa.Schema = SCHEMA,
    compression: str | None = None,
) -> bytes:
    sink = pa.BufferOutputStream()
    chosen = pa.ipc.IpcWriteOptions(compression=compression)
    with pa.ipc.new_stream(sink, schema, options=chosen) as writer:
        writer.write(rows)
    return bytes(sink.getvalue().to_pybytes())


def with_column(name: str, column: pa.Array) -> bytes:
    rows = read(COLUMNS)
    place = SCHEMA.get_field_index(name)
    return written(rows.set_column(place, SCHEMA.field(name), column))


def test_columns_of_a_worker_are_read() -> None:
    assert read(COLUMNS)["birth"].to_pylist() == [0, 1, 2, 3, 4]
    assert read(b"").num_rows == 0


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: COLUMNS[:200], "not an Arrow stream"),
        (lambda: b"\0" * 64, "not an Arrow stream"),
        (lambda: written(read(COLUMNS), compression="zstd"), "must not be compressed"),
        (lambda: written(read(COLUMNS), compression="lz4"), "must not be compressed"),
        (lambda: with_column("x", pa.nulls(5, pa.float32())), "x: must not be null"),
        (
            lambda: with_column(
                "angles", pa.array([[0.5, None]] * 5, SCHEMA.field("angles").type)
            ),
            "angles: must not be null",
        ),
        (
            lambda: written(read(COLUMNS).drop_columns("z"), SCHEMA.remove(6)),
            "other columns",
        ),
    ],
)
def test_other_columns_are_refused(make: Callable[[], bytes], why: str) -> None:
    with pytest.raises(MalformedMessage, match=why):
        read(make())


@pytest.mark.parametrize("limits", [{"most_bytes": 100}, {"most_rows": 4}])
def test_too_many_bytes_or_rows_are_refused(limits: dict[str, int]) -> None:
    with pytest.raises(MalformedMessage) as raised:
        read(COLUMNS, **limits)
    assert raised.value.kind == "too large"


def test_many_small_batches_are_refused() -> None:
    sink = pa.BufferOutputStream()
    (batch,) = read(COLUMNS).to_batches()
    with pa.ipc.new_stream(sink, SCHEMA) as writer:
        for _ in range(1000):
            writer.write(batch.slice(0, 0))
    with pytest.raises(MalformedMessage, match="record batches"):
        read(bytes(sink.getvalue().to_pybytes()))


def test_a_decompression_bomb_costs_nothing() -> None:
    count = 4_000_000
    bomb = pa.record_batch(
        [
            pa.nulls(count, field.type)
            if field.nullable
            else pa.repeat(pa.scalar([] if name == "angles" else 0, field.type), count)
            for name, field in zip(SCHEMA.names, SCHEMA, strict=True)
        ],
        schema=SCHEMA,
    )
    data = written(bomb, compression="zstd")
    del bomb
    assert len(data) < 1 << 18
    before = pa.total_allocated_bytes()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(MalformedMessage, match="compressed"):
        read(data, most_rows=count)
    assert pa.total_allocated_bytes() - before < 1 << 20
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 1 << 14


@pytest.mark.parametrize("seed", range(4))
def test_damaged_columns_are_read_or_refused(seed: int) -> None:
    """A field's name that is not UTF-8 made Arrow raise a ``UnicodeDecodeError``."""
    rng = np.random.default_rng(seed)
    for _ in range(1500):
        damaged = bytearray(COLUMNS)
        for _ in range(int(rng.integers(1, 5))):
            damaged[int(rng.integers(len(damaged)))] = int(rng.integers(256))
        with suppress(MalformedMessage):
            rows = read(bytes(damaged))
            assert rows.num_rows <= 5
            rows.to_pylist()
