"""Schemas of the Arrow tables of a run, with the meaning of each column.

Every field has ``unit`` and ``repeatable`` in its metadata. Repeatable columns are
equal, row by row, in two runs of the same experiment and seed; the others depend on
machines and clocks.

Columns of several tables:

- ``record``: number of the row in its table.
- ``seed``: random seed of the run or campaign; repeats of a campaign share it.
- ``run_id``: identifier of the run, see ``schema.tables.description.run_columns``.
- ``island``: number of the island where the event of the row happened.
- ``birth_island``, ``birth``: id of an individual, the island and the number of its
  birth. ``birth_island`` is null if it equals ``island``, so that the id is
  ``coalesce(birth_island, island), birth``.
- ``births``: number of individuals born on the island so far.
- ``sim_time_s``: simulated time of an arena [s].
- ``path_velocity``, ``straight_velocity``: length of the path of the core, and
  distance between its ends, per second of the fitness window [m/s].
- ``fitness``: higher is better.
- ``measures``: numbers of ``measures.names`` by name; null if the experiment has none,
  if the evaluation failed, or if the robot has no fitness yet.
"""

from collections.abc import Mapping
from itertools import chain
from typing import Any

import pyarrow as pa

from schema.errors import MalformedMessage
from schema.parts import BodySpace
from schema.robot.genome import Node, walk
from schema.robot.robot import Robot

VERSION = 2
"""Version of all schemas; rises when a column changes its name, type or meaning."""

Row = dict[str, Any]


TABLES: dict[str, pa.Schema] = {}
"""Schemas by table name; each table below adds itself."""

ROWS: dict[str, pa.Schema] = {}
"""Schemas of rows in messages and as state machines make them, by table name.

They lack ``record``, what is the same in all rows of a run, and all metadata.
"""


def _columns(
    names: str,
    kind: pa.DataType,
    unit: str = "",
    *,
    is_repeatable: bool = True,
    is_nullable: bool = False,
    absent: int | None = None,
) -> list[pa.Field]:
    """Return columns of one type, given their names with spaces between.

    ``absent`` is their value in rows that are older than they.
    """
    metadata = {"unit": unit, "repeatable": "true" if is_repeatable else "false"}
    if absent is not None:
        metadata["absent"] = str(absent)
    return [
        pa.field(name, kind, nullable=is_nullable, metadata=metadata)
        for name in names.split()
    ]


_OF_RUN = [
    *_columns("seed", pa.uint64(), is_nullable=True),
    *_columns("run_id", pa.string(), is_repeatable=False, is_nullable=True),
]
"""Last columns of each table; null only if ``run.json`` is lost."""


def _table(
    name: str, *columns: list[pa.Field], is_repeatable: bool = True
) -> pa.Schema:
    """Return a schema; ``is_repeatable`` false holds for all of its columns."""
    metadata = {"revolve.schema": name, "revolve.schema_version": str(VERSION)}
    own = list(chain(*columns))
    ROWS[name] = pa.schema([field.remove_metadata() for field in own])
    of_run = [field for field in _OF_RUN if field.name not in ROWS[name].names]
    fields = [*_columns("record", pa.int64()), *own, *of_run]
    if not is_repeatable:
        fields = [
            field.with_metadata(field.metadata | {b"repeatable": b"false"})
            for field in fields
        ]
    TABLES[name] = pa.schema(fields, metadata=metadata)
    return TABLES[name]


def _inner(name: str, kind: pa.DataType) -> pa.Field:
    return pa.field(name, kind, nullable=False)


PARENT = pa.struct([_inner("island", pa.int32()), _inner("birth", pa.int64())])
"""Id of a parent; of two, the first is the one whose copy was changed."""

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
"""Part of a body; the fields are those of ``schema.robot.robot.Part``."""

MEASURES = pa.map_(
    pa.field("key", pa.string(), nullable=False),
    pa.field("value", pa.float64(), nullable=False),
)
"""Measures of a robot by name: short names of ``measures.names``, or attributes."""

_ISLAND = _columns("island", pa.int32())
_INDIVIDUAL = [
    *_ISLAND,
    *_columns("birth_island", pa.int32(), is_nullable=True),
    *_columns("birth", pa.int64()),
]
_OUTCOME = [
    *_columns("fitness", pa.float64(), is_nullable=True),
    *_columns("path_velocity straight_velocity", pa.float64(), "m/s", is_nullable=True),
    *_columns("simulated_s", pa.float64(), "s", is_nullable=True),
]

BIRTHS = _table(
    "births",
    _ISLAND,
    _columns("birth", pa.int64()),
    _columns("parents", pa.list_(_inner("item", PARENT))),
    _columns("generation", pa.int32(), is_nullable=True),
    _columns("rank attempts", pa.int32()),
    _columns("genome", pa.binary()),
    _columns("body", pa.list_(_inner("item", PART)), "params: m, rad, 1 by type"),
    _columns("parts joints motors extremities", pa.int32()),
    _columns("inputs outputs hidden connections", pa.int32()),
    _columns("sim_time_s", pa.float64(), "s", is_nullable=True),
    _columns("x y", pa.float64(), "m", is_nullable=True),
    _columns("robot", pa.binary(), is_repeatable=False, is_nullable=True),
)
"""One row per individual born.

- ``parents``: ids of the parents; empty for founders.
- ``generation``: number of the brood; null on-line.
- ``rank``: 1 for founders, otherwise one more than the greatest rank of the parents.
- ``attempts``: matings that this birth took.
- ``genome``: bytes of the genome, Protobuf in runs of the encoding
  ``revolve-angle``, otherwise as the experiment's encoding writes them.
- ``body``: the parts, core first.
- ``parts``, ``joints``, ``motors``, ``extremities``, ``inputs``, ``outputs``,
  ``hidden``, ``connections``: counts, see ``sizes``.
- ``sim_time_s``, ``x``, ``y``: time and place of birth, world frame; null off-line.
- ``robot``: Protobuf bytes of the robot; null in runs of ``revolve-angle``, whose
  genomes are enough, and in runs that are older than this column.
"""

EVALUATIONS = _table(
    "evaluations",
    _INDIVIDUAL,
    _columns("trial", pa.int32(), absent=0),
    _columns("status reason", pa.string()),
    _OUTCOME,
    _columns("wall_s", pa.float64(), "s", is_repeatable=False),
    _columns("worker platform", pa.string(), is_repeatable=False),
    _columns("measures", MEASURES, "by measure", is_nullable=True),
)
"""One row per finished evaluation.

- ``trial``: number of the evaluation of this robot; 0 is the one at birth, others are
  re-evaluations.
- ``status``, ``reason``: "ok", or "failed" with a reason; then the numbers are null.
- ``simulated_s``: simulated time, warm-up included [s].
- ``wall_s``, ``worker``, ``platform``: duration by the clock, and where it ran.
"""

POPULATION = _table(
    "population",
    _ISLAND,
    _columns("births", pa.int64()),
    _columns("birth_island", pa.int32(), is_nullable=True),
    _columns("birth", pa.int64()),
    _columns("fitness", pa.float64(), is_nullable=True),
)
"""One row per individual alive when ``births`` individuals had been born.

On-line there is a set of rows at each birth, with a row for the new robot. ``fitness``
is null if the evaluation failed or the robot is not mature.
"""

FITNESS = _table(
    "fitness",
    _INDIVIDUAL,
    _columns("sim_time_s", pa.float64(), "s"),
    _columns("births", pa.int64()),
    _columns("age_s", pa.float64(), "s"),
    _columns("path_velocity straight_velocity", pa.float64(), "m/s"),
    _columns("fitness", pa.float64()),
    _columns("is_mature", pa.bool_()),
    _columns("measures", MEASURES, "by measure", is_nullable=True),
)
"""One row per living robot and sample of an arena, mature or not.

``age_s`` is the time since birth [s]; ``is_mature`` is whether the robot has lived
its warm-up and a whole fitness window.
"""

_COORDINATE = pa.float32()

POSES = _table(
    "poses",
    _INDIVIDUAL,
    _columns("sim_time_s", pa.float64(), "s"),
    _columns("x y z", _COORDINATE, "m"),
    _columns("qw qx qy qz", _COORDINATE),
    _columns("angles", pa.list_(_inner("item", _COORDINATE)), "rad"),
)
"""One row per living robot and recorded pose of an arena.

- ``x``, ``y``, ``z``: centre of the core, world frame [m].
- ``qw``, ``qx``, ``qy``, ``qz``: attitude of the core as a unit quaternion.
- ``angles``: angle of every joint, driven or not, by ascending part [rad]; of a slider
  its displacement [m].
"""

DEATHS = _table(
    "deaths",
    _INDIVIDUAL,
    _columns("sim_time_s", pa.float64(), "s"),
    _columns("births", pa.int64()),
    _columns("reason detail", pa.string()),
    _columns("x y", pa.float64(), "m"),
    _columns("z", pa.float64(), "m", is_nullable=True),
)
"""One row per robot that left an arena.

- ``reason``: "selection" (below the share of the mean fitness), "cull" (removed from
  an arena full of mature robots), "diverged" (its simulation diverged; ``detail`` says
  how), "removed" (by an operator), "migrated" (moved to another island) or "replaced"
  (made room for an immigrant).
- ``x``, ``y``, ``z``: centre of its core, world frame [m]; ``z`` is null if the robot
  left before its first step.
"""

TOUCHES = _table(
    "touches",
    _INDIVIDUAL,
    _columns("other_island", pa.int32()),
    _columns("other_birth", pa.int64()),
    _columns("sim_time_s over_s duration_s", pa.float64(), "s"),
)
"""One row per pair of robots that touched during an interval of an arena.

- ``other_island``, ``other_birth``: id of the second robot.
- ``over_s``: length of the interval, which ends at ``sim_time_s`` [s].
- ``duration_s``: time in contact during the interval [s].
"""

MIGRATIONS = _table(
    "migrations",
    _columns("island to", pa.int32()),
    _columns("epoch births", pa.int64()),
    _columns("sim_time_s", pa.float64(), "s", is_nullable=True),
    _columns("birth_island", pa.int32()),
    _columns("birth", pa.int64()),
    _columns("fitness", pa.float64(), is_nullable=True),
)
"""One row per migrant sent.

- ``island``, ``to``: numbers of the islands that it left and reached.
- ``epoch``: number of the migration epoch.
- ``fitness``: on the island that it left; null if its evaluation failed.
- ``sim_time_s``: null off-line.
"""

AUDITS = _table(
    "audits",
    _ISLAND,
    _columns("birth", pa.int64()),
    _columns("trial", pa.int32()),
    _columns("agrees", pa.bool_()),
    _columns("worker platform reason", pa.string()),
    _OUTCOME,
    is_repeatable=False,
)
"""Two rows per evaluation that two workers did, one for the answer of each.

``agrees`` is whether both answers are equal; ``trial`` and the numbers are as in
``evaluations``, and ``reason`` is that of a failure. A flag selects the evaluations
to audit, so no column is repeatable.
"""

DRIFTS = _table(
    "drifts",
    _ISLAND,
    _columns("step", pa.int64()),
    _columns("before after worker", pa.string()),
    is_repeatable=False,
)
"""One row per arena that moved to a worker of another platform.

``step`` is the first physics step that the new worker reached; ``before`` and
``after`` are the platforms. From there on, the run differs from one on a single
platform. A flag allows it.
"""

_INSTANT = pa.timestamp("ms", tz="UTC")

RUNS = _table(
    "runs",
    _columns("name", pa.string()),
    _columns("run", pa.int32()),
    _columns("seed", pa.uint64()),
    _columns("document state", pa.string()),
    _columns("versions platform cpu_flags", pa.string(), is_repeatable=False),
    _columns("start", _INSTANT, is_repeatable=False),
    _columns("end", _INSTANT, is_repeatable=False, is_nullable=True),
)
"""One row, which describes the run.

- ``name``, ``run``, ``seed``: name of the experiment, number of the repeat, seed.
- ``document``, ``versions``: the experiment, and versions of libraries, as JSON.
- ``state``: of the run.
- ``platform``, ``cpu_flags``: of the coordinator.
- ``start``, ``end``: times by the clock.

No column may be named ``experiment``: a folder of finished runs has that name, and
readers of a campaign make a column of it.
"""


def read_columns(table: str, columns: bytes) -> pa.Table:
    """Return the rows of an Arrow stream.

    Args:
        table: name of their table.
        columns: Arrow IPC stream of the columns in ``ROWS``; empty for no rows.

    Raises:
        MalformedMessage: not such a stream, or columns of other names or types.
    """
    schema = ROWS[table]
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
        raise MalformedMessage(f"{table}: not an Arrow stream: {error}") from None
    return found


def _described(schema: pa.Schema) -> str:
    return ", ".join(f"{field.name}: {field.type}" for field in schema)


def is_earlier(found: pa.Schema, schema: pa.Schema) -> bool:
    """Return whether a schema is that of a table, now or before it got new columns.

    Args:
        found: schema of stored rows, with metadata.
        schema: present schema of the table.
    """
    known = [field for field in schema if field.name in found.names]
    missing = [field for field in schema if field.name not in found.names]
    return found.equals(pa.schema(known, schema.metadata), check_metadata=True) and all(
        field.nullable or b"absent" in field.metadata for field in missing
    )


def absent_value(field: pa.Field) -> int | None:
    """Return the value of a column in rows that are older than it; None is null."""
    absent = field.metadata.get(b"absent")
    return absent and int(absent)


def completed(
    rows: pa.Table, schema: pa.Schema, of_run: Mapping[str, object]
) -> pa.Table:
    """Return rows with the columns added that they lack.

    Args:
        rows: of a table.
        schema: present schema of the table.
        of_run: values of columns that are the same in all rows of the run.

    Raises:
        ValueError: the rows are not of the table.
    """
    missing = [field for field in schema if field.name not in rows.column_names]
    for field in missing:
        value = pa.scalar(of_run.get(field.name, absent_value(field)), field.type)
        rows = rows.append_column(field, pa.repeat(value, rows.num_rows))
    # Parquet has its own name for the items of a list.
    return rows.select(schema.names).cast(schema)


def repeatable(schema: pa.Schema) -> list[str]:
    """Return the names of the repeatable columns."""
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


def sizes(robot: Robot, genome: object, space: BodySpace) -> dict[str, int]:
    """Return the counts of a births row.

    Args:
        robot: the phenotype.
        genome: of the phenotype.
        space: its part types.

    Returns:
        ``parts``, ``joints`` (driven or not), ``motors`` (driven), ``extremities``
        (parts without children; a lone core counts 1), ``inputs``, ``outputs``,
        ``hidden``, and ``connections`` of a genome of ``revolve-angle``, including
        unresolved ones; of another genome's robot.

    Source: thesis section 6.3; the code of the original.
    """
    kinds = [space[part.kind] for part in robot.parts]
    brain = robot.brain
    connections = len(brain.connections)
    if isinstance(genome, Node):
        connections = sum(len(node.connections) for node, _, _ in walk(genome))
    # Includes -1, the parent of the core.
    parents = {part.parent for part in robot.parts}
    return {
        "parts": len(robot.parts),
        "joints": sum(
            kind.shape(part.parameters).joint is not None
            for kind, part in zip(kinds, robot.parts, strict=True)
        ),
        "motors": sum(kind.outputs for kind in kinds),
        "extremities": len(robot.parts) + 1 - len(parents),
        "inputs": brain.count("input"),
        "outputs": brain.count("output"),
        "hidden": brain.count("hidden"),
        "connections": connections,
    }
