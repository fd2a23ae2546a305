"""Columns of tables, and Arrow without pandas."""

import io
import subprocess
import sys
from collections.abc import Callable

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from coordinator.islands.rows import body_rows, origin_columns, sizes
from schema.parts import BUILT_IN
from schema.robot.genome import Genome, NeuronGene, Node, develop
from schema.tables.columns import BIRTHS, TABLES, repeatable
from schema.wire.genome_bytes import encode_genome
from schema.wire.protobuf import decode_genome, encode_robot

NodeMaker = Callable[..., Node]
HIDDEN = NeuronGene("Simple", (0.0, 0.5))


def birth(genome: Genome, record: int) -> dict[str, object]:
    robot = develop(genome, BUILT_IN)
    return {
        "record": record,
        "island": 0,
        "birth": record,
        "parents": [{"island": 0, "birth": 1}, {"island": 0, "birth": 0}],
        "generation": None,
        "rank": 2,
        "attempts": 1,
        "genome": encode_genome(genome),
        "body": body_rows(robot),
        **sizes(robot, BUILT_IN),
        "connections": 3,
        "sim_time_s": None if record else 15.0,
        "x": None if record else -1.5,
        "y": None if record else 0.0,
        "robot": encode_robot(robot) if record else None,
        **origin_columns(None),
        "seed": 7,
        "run_id": "0123456789ab",
    }


@pytest.mark.parametrize("name", TABLES)
def test_every_column_has_a_description_and_a_unit(name: str) -> None:
    schema = TABLES[name]
    assert schema.metadata[b"description"]
    assert schema.names[0] == "record"
    assert schema.metadata[b"revolve.schema"] == name.encode()
    assert int(schema.metadata[b"revolve.schema_version"]) >= 1
    for field in schema:
        assert set(field.metadata) - {b"absent"} == {
            b"unit",
            b"description",
            b"repeatable",
        }
        text = field.metadata[b"description"].decode()
        assert len(text) > 10
        assert not text.endswith(".")
        if field.name.endswith("_s"):
            assert field.metadata[b"unit"] == b"s"
        if field.name.endswith("velocity"):
            assert field.metadata[b"unit"] == b"m/s"
        if field.name in "xyz":
            assert field.metadata[b"unit"] == b"m"
        is_float = pa.types.is_floating(getattr(field.type, "value_type", field.type))
        assert bool(field.metadata[b"unit"]) >= is_float


@pytest.mark.parametrize(
    ("name", "others"),
    [
        ("births", {"robot", "origin_run", "origin_file", "run_id"}),
        ("evaluations", {"wall_s", "worker", "platform", "point", "run_id"}),
        ("population", {"run_id"}),
        ("fitness", {"run_id"}),
        ("poses", {"run_id"}),
        ("deaths", {"run_id"}),
        ("touches", {"run_id"}),
        ("runs", {"versions", "platform", "cpu_flags", "start", "end", "run_id"}),
    ],
)
def test_columns_of_machines_and_clocks_are_not_repeatable(
    name: str, others: set[str]
) -> None:
    schema = TABLES[name]
    assert set(schema.names) - set(repeatable(schema)) == others


@pytest.mark.parametrize("name", TABLES)
def test_every_table_names_its_run(name: str) -> None:
    schema = TABLES[name]
    assert schema.field("seed").type == pa.uint64()
    assert schema.field("run_id").type == pa.string()
    assert schema.names[-1] == "run_id"


def test_no_column_has_the_name_of_a_partition() -> None:
    assert all("experiment" not in schema.names for schema in TABLES.values())


@given(data=st.data())
def test_births_round_trip_through_stream_and_parquet(
    genomes: SearchStrategy[Genome], data: DataObject
) -> None:
    genome = data.draw(genomes)
    rows = [birth(genome, record) for record in range(2)]
    assert set(rows[0]) == set(BIRTHS.names)
    batch = pa.RecordBatch.from_pylist(rows, schema=BIRTHS)
    batch.validate(full=True)
    sink = io.BytesIO()
    pq.write_table(pa.Table.from_batches([batch]), sink)
    table = pq.read_table(io.BytesIO(sink.getvalue()))
    assert table.schema.metadata[b"revolve.schema"] == b"births"
    (first, second) = table.to_pylist()
    assert decode_genome(first["genome"]) == genome
    parts = develop(genome, BUILT_IN).parts
    assert [tuple(row["params"]) for row in first["body"]] == [
        part.parameters for part in parts
    ]
    assert [row["gene"] for row in first["body"]] == [part.gene for part in parts]
    assert [row["idx"] for row in second["body"]] == list(range(len(parts)))
    assert [row["birth"] for row in first["parents"]] == [1, 0]


PROGRAM = """
import sys
from schema.tables.arrow import skip_pandas
skip_pandas()
import pyarrow as pa
numbers = pa.array([1, 2])
assert "pandas" not in sys.modules
assert numbers.to_pandas().sum() == 3
assert "pandas" in sys.modules
"""


def test_arrays_are_made_without_pandas_and_still_convert_to_it() -> None:
    pytest.importorskip("pandas")
    subprocess.run([sys.executable, "-c", PROGRAM], check=True)
