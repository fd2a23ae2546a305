"""Arrow tables of a run: what each column holds, its unit, whether it repeats.

Every field carries ``unit`` and ``repeatable`` in its metadata. Repeatable columns
are equal, row by row, in two runs of the same experiment and seed; the others tell
of machines and clocks. Every row starts with ``record``, its number in its table.
"""

from typing import Any

import pyarrow as pa

from schema.errors import MalformedMessage
from schema.parts import BodySpace
from schema.robot.genome import Genome, walk
from schema.robot.robot import Robot

VERSION = 2
"""Of all tables; goes up when a column changes its name, type or meaning."""

Row = dict[str, Any]


def _column(
    name: str,
    kind: pa.DataType,
    unit: str = "",
    *,
    is_repeatable: bool = True,
    is_nullable: bool = False,
    absent: int | None = None,
) -> pa.Field:
    """Return a column; ``absent`` stands for it in rows older than the column."""
    metadata = {"unit": unit, "repeatable": "true" if is_repeatable else "false"}
    if absent is not None:
        metadata["absent"] = str(absent)
    return pa.field(name, kind, nullable=is_nullable, metadata=metadata)


def _table(name: str, *columns: pa.Field, is_repeatable: bool = True) -> pa.Schema:
    metadata = {"revolve.schema": name, "revolve.schema_version": str(VERSION)}
    record = _column("record", pa.int64(), is_repeatable=is_repeatable)
    return pa.schema([record, *columns], metadata=metadata)


def _inner(name: str, kind: pa.DataType) -> pa.Field:
    return pa.field(name, kind, nullable=False)


PARENT = pa.struct([_inner("island", pa.int32()), _inner("birth", pa.int64())])
"""A parent's name; the first of two is the one that was copied."""

PART = pa.struct(
    [
        _inner("idx", pa.int32()),
        _inner("parent", pa.int32()),
        _inner("parent_slot", pa.int32()),
        _inner("child_slot", pa.int32()),
        _inner("kind", pa.string()),
        _inner("rot", pa.int32()),
        _inner("params", pa.list_(_inner("item", pa.float64()))),
        _inner("gene", pa.uint64()),
    ]
)
"""A part of a body, in the order and with the meaning of ``schema.robot.Part``."""

_BIRTH_ISLAND = _column("birth_island", pa.int32(), is_nullable=True)
"""Where an immigrant was born; null of those who live where they were born.

``island`` is where something happened. An individual's name is its island of birth
and its ``birth`` there: ``coalesce(birth_island, island), birth``.
"""

BIRTHS = _table(
    "births",
    _column("island", pa.int32()),
    _column("birth", pa.int64()),
    _column("parents", pa.list_(_inner("item", PARENT))),
    _column("generation", pa.int32(), is_nullable=True),
    _column("rank", pa.int32()),
    _column("attempts", pa.int32()),
    _column("genome", pa.binary()),
    _column("body", pa.list_(_inner("item", PART)), "params: m, rad, 1 by type"),
    _column("parts", pa.int32()),
    _column("joints", pa.int32()),
    _column("motors", pa.int32()),
    _column("extremities", pa.int32()),
    _column("inputs", pa.int32()),
    _column("outputs", pa.int32()),
    _column("hidden", pa.int32()),
    _column("connections", pa.int32()),
    _column("sim_time_s", pa.float64(), "s", is_nullable=True),
    _column("x", pa.float64(), "m", is_nullable=True),
    _column("y", pa.float64(), "m", is_nullable=True),
)
"""One row per individual born; founders have no parents.

When and where it was born is null off-line, its generation on-line.
"""

EVALUATIONS = _table(
    "evaluations",
    _column("island", pa.int32()),
    _BIRTH_ISLAND,
    _column("birth", pa.int64()),
    _column("trial", pa.int32(), absent=0),
    _column("status", pa.string()),
    _column("reason", pa.string()),
    _column("fitness", pa.float64(), is_nullable=True),
    _column("path_velocity", pa.float64(), "m/s", is_nullable=True),
    _column("straight_velocity", pa.float64(), "m/s", is_nullable=True),
    _column("simulated_s", pa.float64(), "s", is_nullable=True),
    _column("wall_s", pa.float64(), "s", is_repeatable=False),
    _column("worker", pa.string(), is_repeatable=False),
    _column("platform", pa.string(), is_repeatable=False),
)
"""One row per evaluation finished; status is "ok", or "failed" with a reason.

Trial 0 is the one at birth; where robots are judged anew, more rows have a greater.
"""

POPULATION = _table(
    "population",
    _column("island", pa.int32()),
    _column("births", pa.int64()),
    _BIRTH_ISLAND,
    _column("birth", pa.int64()),
    _column("fitness", pa.float64(), is_nullable=True),
)
"""One row per individual alive when ``births`` individuals had been born.

On-line there is a set of rows at each birth, the newborn's included; fitness is
null of those who are not mature.
"""

FITNESS = _table(
    "fitness",
    _column("island", pa.int32()),
    _BIRTH_ISLAND,
    _column("birth", pa.int64()),
    _column("sim_time_s", pa.float64(), "s"),
    _column("births", pa.int64()),
    _column("age_s", pa.float64(), "s"),
    _column("path_velocity", pa.float64(), "m/s"),
    _column("straight_velocity", pa.float64(), "m/s"),
    _column("fitness", pa.float64()),
    _column("is_mature", pa.bool_()),
)
"""One row per living robot and sample of an arena, mature or not."""

_COORDINATE = pa.float32()

POSES = _table(
    "poses",
    _column("island", pa.int32()),
    _BIRTH_ISLAND,
    _column("birth", pa.int64()),
    _column("sim_time_s", pa.float64(), "s"),
    *(_column(axis, _COORDINATE, "m") for axis in "xyz"),
    *(_column(f"q{axis}", _COORDINATE) for axis in "wxyz"),
    _column("angles", pa.list_(_inner("item", _COORDINATE)), "rad"),
)
"""One row per living robot and pose of an arena: enough to draw it.

Position and attitude (unit quaternion) of the core, world frame, and the angle of
every joint, driven or not, by ascending part.
"""

DEATHS = _table(
    "deaths",
    _column("island", pa.int32()),
    _BIRTH_ISLAND,
    _column("birth", pa.int64()),
    _column("sim_time_s", pa.float64(), "s"),
    _column("births", pa.int64()),
    _column("reason", pa.string()),
    _column("detail", pa.string()),
    _column("x", pa.float64(), "m"),
    _column("y", pa.float64(), "m"),
    _column("z", pa.float64(), "m", is_nullable=True),
)
"""One row per robot that left an arena, and where its core was.

Reason is "selection" (less fit than the survivors' rule asks), "cull" (an arena
full of the mature made room), "diverged" (its physics did; ``detail`` says how),
"removed" (by an operator), "migrated" (it was moved to another island) or
"replaced" (it made room for an immigrant); z is null if it had not lived yet.
"""

TOUCHES = _table(
    "touches",
    _column("island", pa.int32()),
    _BIRTH_ISLAND,
    _column("birth", pa.int64()),
    _column("other_island", pa.int32()),
    _column("other_birth", pa.int64()),
    _column("sim_time_s", pa.float64(), "s"),
    _column("over_s", pa.float64(), "s"),
    _column("duration_s", pa.float64(), "s"),
)
"""One row per pair that touched: for how long of the time ``over_s`` that ended."""

MIGRATIONS = _table(
    "migrations",
    _column("island", pa.int32()),
    _column("to", pa.int32()),
    _column("epoch", pa.int64()),
    _column("births", pa.int64()),
    _column("sim_time_s", pa.float64(), "s", is_nullable=True),
    _column("birth_island", pa.int32()),
    _column("birth", pa.int64()),
    _column("fitness", pa.float64(), is_nullable=True),
)
"""One row per migrant that was sent, when ``births`` had been born on its island.

Fitness is what it was judged there, null if that failed; when is null off-line.
"""

AUDITS = _table(
    "audits",
    *(
        _column(name, kind, unit, is_repeatable=False, is_nullable=is_nullable)
        for name, kind, unit, is_nullable in (
            ("island", pa.int32(), "", False),
            ("birth", pa.int64(), "", False),
            ("trial", pa.int32(), "", False),
            ("agrees", pa.bool_(), "", False),
            ("worker", pa.string(), "", False),
            ("platform", pa.string(), "", False),
            ("reason", pa.string(), "", False),
            ("fitness", pa.float64(), "", True),
            ("path_velocity", pa.float64(), "m/s", True),
            ("straight_velocity", pa.float64(), "m/s", True),
            ("simulated_s", pa.float64(), "s", True),
        )
    ),
    is_repeatable=False,
)
"""Two rows per evaluation that two workers did: what each of them came to.

Which evaluations are audited is a flag, so nothing here repeats.
"""

DRIFTS = _table(
    "drifts",
    *(
        _column(name, kind, is_repeatable=False)
        for name, kind in (
            ("island", pa.int32()),
            ("step", pa.int64()),
            ("before", pa.string()),
            ("after", pa.string()),
            ("worker", pa.string()),
        )
    ),
    is_repeatable=False,
)
"""One row per arena that a worker of another platform went on with.

``step`` is the first that it reached; ``before`` and ``after`` are platforms. From
there on the run is another one than on a single platform: this is allowed by a flag.
"""

_INSTANT = pa.timestamp("ms", tz="UTC")

RUNS = _table(
    "runs",
    _column("name", pa.string()),
    _column("run", pa.int32()),
    _column("seed", pa.uint64()),
    _column("document", pa.string()),
    _column("state", pa.string()),
    _column("versions", pa.string(), is_repeatable=False),
    _column("platform", pa.string(), is_repeatable=False),
    _column("cpu_flags", pa.string(), is_repeatable=False),
    _column("start", _INSTANT, is_repeatable=False),
    _column("end", _INSTANT, is_repeatable=False, is_nullable=True),
)
"""One row: what was run; ``document`` (the experiment) and ``versions`` are JSON.

No column may be called ``experiment``: that is a folder name of a finished run,
which readers of a campaign turn into a column.
"""

TABLES: dict[str, pa.Schema] = {
    "births": BIRTHS,
    "evaluations": EVALUATIONS,
    "population": POPULATION,
    "fitness": FITNESS,
    "poses": POSES,
    "deaths": DEATHS,
    "touches": TOUCHES,
    "migrations": MIGRATIONS,
    "audits": AUDITS,
    "drifts": DRIFTS,
    "runs": RUNS,
}
"""Schemas by table name."""


def read_columns(table: str, columns: bytes) -> pa.Table:
    """Return rows that came as columns.

    Args:
        table: whose they are.
        columns: Arrow IPC stream of all columns but ``record``; no bytes, no rows.

    Raises:
        MalformedMessage: not such a stream, or columns of other names or types.
    """
    schema = TABLES[table].remove(0)
    if not columns:
        return schema.empty_table()
    try:
        with pa.ipc.open_stream(columns) as reader:
            found = reader.read_all()
        if not found.schema.equals(schema):
            raise MalformedMessage(
                f"{table}: columns must be {_described(schema)}, got "
                f"{_described(found.schema)}"
            )
        found.validate(full=True)
    except (pa.ArrowException, OSError) as error:
        raise MalformedMessage(f"{table}: no Arrow stream: {error}") from None
    return found


def _described(schema: pa.Schema) -> str:
    return ", ".join(f"{field.name}: {field.type}" for field in schema)


def is_earlier(found: pa.Schema, schema: pa.Schema) -> bool:
    """Return whether rows are of a table, or of it before it got its newest columns.

    Args:
        found: what the rows are, with metadata.
        schema: of the table, now.
    """
    known = [field for field in schema if field.name in found.names]
    lacking = [field for field in schema if field.name not in found.names]
    return found.equals(pa.schema(known, schema.metadata), check_metadata=True) and all(
        field.nullable or b"absent" in field.metadata for field in lacking
    )


def completed(rows: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return rows with the columns that their table got since they were written.

    Raises:
        ValueError: they are none of the table.
    """
    lacking = [field for field in schema if field.name not in rows.column_names]
    for field in lacking:
        absent = field.metadata.get(b"absent")
        value = pa.scalar(absent and int(absent), field.type)
        rows = rows.append_column(field, pa.repeat(value, rows.num_rows))
    # Parquet has its own name for the items of a list.
    return rows.select(schema.names).cast(schema)


def repeatable(schema: pa.Schema) -> list[str]:
    """Return the names of the columns that two equal runs have in common."""
    return [field.name for field in schema if field.metadata[b"repeatable"] == b"true"]


def body_rows(robot: Robot) -> list[Row]:
    """Return the ``body`` of a births row: one dictionary per part, core first."""
    return [
        {
            "idx": index,
            "parent": part.parent,
            "parent_slot": part.parent_slot,
            "child_slot": part.slot,
            "kind": part.kind,
            "rot": part.orientation,
            "params": part.parameters,
            "gene": part.gene,
        }
        for index, part in enumerate(robot.parts)
    ]


def sizes(robot: Robot, genome: Genome, space: BodySpace) -> dict[str, int]:
    """Return the counts of a births row.

    Args:
        robot: the phenotype.
        genome: what it developed from.
        space: its part types.

    Returns:
        ``parts``, ``joints`` (driven or not), ``motors`` (driven), ``extremities``
        (parts without children; a lone core counts 1), ``inputs``, ``outputs``,
        ``hidden``, and ``connections`` of the genome, unresolvable ones included.

    Source: thesis section 6.3; facts of the original, section 8.
    """
    kinds = [space[part.kind] for part in robot.parts]
    layers = [neuron.layer for neuron in robot.brain.neurons]
    # The core's parent, -1, is among them.
    parents = {part.parent for part in robot.parts}
    return {
        "parts": len(robot.parts),
        "joints": sum(
            kind.shape(part.parameters).joint is not None
            for kind, part in zip(kinds, robot.parts, strict=True)
        ),
        "motors": sum(kind.outputs for kind in kinds),
        "extremities": len(robot.parts) + 1 - len(parents),
        "inputs": layers.count("input"),
        "outputs": layers.count("output"),
        "hidden": layers.count("hidden"),
        "connections": sum(len(node.connections) for node, _, _ in walk(genome)),
    }
