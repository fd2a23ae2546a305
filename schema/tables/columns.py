"""Schemas of the Arrow tables of a run, with the meaning of each column.

Every field has ``unit``, ``description`` and ``repeatable`` in its metadata, and every
schema has the ``description`` of its rows. Units are symbols, "1" for ratios, and empty
for names, numbers of things and counts. Repeatable columns are equal, row by row, in
two runs of the same experiment and seed; the others depend on machines and clocks.

No column may be named ``experiment``: a folder of finished runs has that name, and
readers of a campaign make a column of it.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import pyarrow as pa

VERSION = 2
"""Version of all schemas; rises when a column changes its name, type or meaning."""

Row = dict[str, Any]


TABLES: dict[str, pa.Schema] = {}
"""Schemas by table name; each table below adds itself."""

ROWS: dict[str, pa.Schema] = {}
"""Schemas of rows in messages and as state machines make them, by table name.

They lack ``record``, what is the same in all rows of a run, and all metadata.
"""


Columns = tuple[pa.Field, ...]


def _column(
    name: str,
    kind: pa.DataType,
    description: str,
    *,
    unit: str = "",
    is_repeatable: bool = True,
    is_nullable: bool = False,
    absent: int | None = None,
) -> pa.Field:
    """Return a column; ``absent`` is its value in rows that are older than it."""
    metadata = {
        "unit": unit,
        "description": description,
        "repeatable": "true" if is_repeatable else "false",
    }
    if absent is not None:
        metadata["absent"] = str(absent)
    return pa.field(name, kind, nullable=is_nullable, metadata=metadata)


_nullable = partial(_column, is_nullable=True)
_local = partial(_column, is_repeatable=False)

_RECORD = _column("record", pa.int64(), "number of the row in its table, from 0")
_SEED = "random seed of the run or campaign"
_OF_RUN = (
    _nullable("seed", pa.uint64(), f"{_SEED}; repeats of a campaign share it"),
    _nullable(
        "run_id",
        pa.string(),
        "identifier of the run; another for each run, also of the same seed",
        is_repeatable=False,
    ),
)
"""Last columns of each table; null only if ``run.json`` is lost."""


def _table(
    name: str, description: str, *columns: pa.Field, is_repeatable: bool = True
) -> pa.Schema:
    """Return a schema; ``is_repeatable`` false holds for all of its columns."""
    ROWS[name] = pa.schema([field.remove_metadata() for field in columns])
    of_run = [field for field in _OF_RUN if field.name not in ROWS[name].names]
    fields = [_RECORD, *columns, *of_run]
    if not is_repeatable:
        fields = [
            field.with_metadata(field.metadata | {b"repeatable": b"false"})
            for field in fields
        ]
    metadata = {
        "revolve.schema": name,
        "revolve.schema_version": str(VERSION),
        "description": description,
    }
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

_FLOAT = pa.float64()
_COORDINATE = pa.float32()
_INSTANT = pa.timestamp("ms", tz="UTC")

_ISLAND = _column("island", pa.int32(), "number of the island where it happened")
_BIRTH = _column("birth", pa.int64(), "number of the birth of the individual")
_BIRTH_ISLAND = _nullable(
    "birth_island",
    pa.int32(),
    "island where the individual was born; null if it is that of the column island",
)
_INDIVIDUAL = (_ISLAND, _BIRTH_ISLAND, _BIRTH)
_SECOND_ROBOT = (
    _column("other_island", pa.int32(), "island where the second robot was born"),
    _column("other_birth", pa.int64(), "number of the birth of the second robot"),
)
_BIRTHS = _column("births", pa.int64(), "individuals born on the island so far")
_TIME = _column("sim_time_s", _FLOAT, "simulated time of the arena", unit="s")
_FITNESS_UNIT = "m/s, or as of fitness.function"


def _fitness(description: str) -> pa.Field:
    return _nullable("fitness", _FLOAT, description, unit=_FITNESS_UNIT)


_VELOCITIES = (
    _column(
        "path_velocity",
        _FLOAT,
        "length of the core's path in the ground plane, per time of the fitness window",
        unit="m/s",
    ),
    _column(
        "straight_velocity",
        _FLOAT,
        "distance between the ends of that path, per time of the fitness window",
        unit="m/s",
    ),
)
_OUTCOME = (
    _fitness("higher is better; null if the evaluation failed"),
    *(field.with_nullable(True) for field in _VELOCITIES),
    _nullable(
        "simulated_s",
        _FLOAT,
        "simulated time, warm-up included; null if the evaluation failed",
        unit="s",
    ),
)
_MEASURES = _nullable(
    "measures",
    MEASURES,
    "numbers of measures.names by name; null if the experiment has none, if the "
    "evaluation failed, or if the robot has no fitness yet",
    unit="by measure",
)


def _axes(names: str, kind: pa.DataType, description: str) -> Columns:
    """Return columns of coordinates in the world frame, z up."""
    return tuple(
        _column(name, kind, f"{name} of {description}, world frame, z up", unit="m")
        for name in names
    )


def _counts(**descriptions: str) -> Columns:
    return tuple(_column(name, pa.int32(), text) for name, text in descriptions.items())


BIRTHS = _table(
    "births",
    "an individual born",
    _ISLAND,
    _BIRTH,
    _column(
        "parents",
        pa.list_(_inner("item", PARENT)),
        "ids of the parents (island and number of birth), first the one whose copy was "
        "changed; empty for founders",
    ),
    _nullable("generation", pa.int32(), "number of the brood; null on-line"),
    *_counts(
        rank="1 for founders, otherwise one more than the greatest rank of the parents",
        attempts="matings that this birth took",
    ),
    _column(
        "genome",
        pa.binary(),
        "bytes of the genome: Protobuf with the encoding revolve-angle, otherwise as "
        "the experiment's encoding writes them",
    ),
    _column(
        "body",
        pa.list_(_inner("item", PART)),
        "parts, core first: number (idx), number of the parent (-1 of the core), slots "
        "of parent and child (-1 of the core), part type (kind), orientation in "
        "degrees (rot), parameters (params), innovation number (gene)",
        unit="params: by part type; lengths and radii of built-in parts in mm, "
        "angles in rad, colours 1",
    ),
    *_counts(
        parts="parts, core included",
        joints="joints, driven or not",
        motors="driven joints",
        extremities="parts without children; a lone core counts 1",
        inputs="input neurons",
        outputs="output neurons",
        hidden="hidden neurons",
        connections="connections of the brain; with the encoding revolve-angle those "
        "of the genome, unresolved ones included",
    ),
    _nullable("sim_time_s", _FLOAT, "simulated time of birth; null off-line", unit="s"),
    *(
        field.with_nullable(True)
        for field in _axes("xy", _FLOAT, "the place of birth (null off-line)")
    ),
    _nullable(
        "robot",
        pa.binary(),
        "Protobuf bytes of the robot, with the brain that it has learnt; null if it is "
        "what develops from the genome with the encoding revolve-angle, and in runs "
        "that are older than this column",
        is_repeatable=False,
    ),
    *(
        _nullable(
            name,
            kind,
            f"of a given founder {text}; else null",
            is_repeatable=name not in ("origin_run", "origin_file"),
        )
        for name, kind, text in (
            ("origin_digest", pa.string(), "the SHA-256 of its genome, in hexadecimal"),
            ("origin_island", pa.int32(), "of a run the island of its birth there"),
            ("origin_birth", pa.int64(), "of a run the number of that birth"),
            ("origin_run", pa.string(), "the run_id of its run"),
            ("origin_file", pa.string(), "its robot file"),
        )
    ),
)
_PROVENANCE = (
    _local("wall_s", _FLOAT, "duration by the worker's clock", unit="s"),
    _column("worker", pa.string(), "name of the worker", is_repeatable=False),
    _column("platform", pa.string(), "platform of the worker", is_repeatable=False),
)
EVALUATIONS = _table(
    "evaluations",
    "a finished evaluation, off-line",
    *_INDIVIDUAL,
    _column(
        "trial",
        pa.int32(),
        "number of the evaluation of this robot: 0 is the one at birth (with learning "
        "the best trial, which the table learning numbers), others are re-evaluations",
        absent=0,
    ),
    _column("status", pa.string(), '"ok" or "failed"'),
    _column("reason", pa.string(), "of a failure; otherwise empty"),
    *_OUTCOME,
    *_PROVENANCE,
    _MEASURES,
    _nullable(
        "point",
        pa.int64(),
        "births at which the settings in [[changes]] had the values of the evaluation; "
        "null without changes",
        is_repeatable=False,
    ),
)
LEARNING = _table(
    "learning",
    "a trial of a newborn whose brain is learnt; in an arena an infant's, written when "
    "it grows up or dies, or with the end of the run",
    _ISLAND,
    _BIRTH,
    _column(
        "trial",
        pa.int32(),
        "number of the trial of this robot, from 0: the brain at birth",
    ),
    _column(
        "request",
        pa.int32(),
        "number of the request to the learner that led to this trial; trials of one "
        "request are tried together; 0 at samples, which are tried before",
    ),
    _fitness("higher is better; null if the trial failed"),
    _column("reason", pa.string(), "of a failure; otherwise empty"),
    _column(
        "distance",
        _FLOAT,
        "root mean square of the differences to the parameters at birth",
        unit="1",
    ),
    _column(
        "parameters",
        pa.list_(_inner("item", _FLOAT)),
        "what is learnt, as shares of the ranges, from 0 to 1: parameters of neurons, "
        "then weights, in the order of the brain",
        unit="1",
    ),
    *_PROVENANCE,
    _nullable(
        "sim_time_s",
        _FLOAT,
        "simulated time of the trial's end in an arena; null off-line",
        unit="s",
    ),
    _nullable(
        "robot",
        pa.binary(),
        "Protobuf bytes of the robot that grew up in an arena with this trial's brain; "
        "null in its other trials, and off-line, where births has it",
    ),
    _nullable(
        "sample_island",
        pa.int32(),
        "island where the robot was born whose brain this trial has, a parent or peer, "
        "as far as the bodies have parts in common; null in other trials",
    ),
    _nullable("sample_birth", pa.int64(), "number of the birth of that robot"),
)
POPULATION = _table(
    "population",
    "an individual alive when `births` individuals had been born; on-line at each "
    "birth, with a row for the new robot",
    _ISLAND,
    _BIRTHS,
    _BIRTH_ISLAND,
    _BIRTH,
    _fitness(
        "higher is better; null if the evaluation failed or the robot is not mature"
    ),
)
FITNESS = _table(
    "fitness",
    "a living robot and sample of an arena, mature or not",
    *_INDIVIDUAL,
    _TIME,
    _BIRTHS,
    _column("age_s", _FLOAT, "simulated time since birth", unit="s"),
    *_VELOCITIES,
    _column("fitness", _FLOAT, "higher is better", unit=_FITNESS_UNIT),
    _column(
        "is_mature",
        pa.bool_(),
        "whether the robot has lived its warm-up and a whole fitness window",
    ),
    _MEASURES,
    _nullable(
        "stores",
        MEASURES,
        "what the arena's rules keep for the robot, before their decision at this time",
    ),
    _nullable(
        "work_j",
        _FLOAT,
        "work of its motors since birth, read at the checks of distances; null if the "
        "arena's rules do not need it",
        unit="J",
    ),
)
POSES = _table(
    "poses",
    "a living robot and recorded pose of an arena",
    *_INDIVIDUAL,
    _TIME,
    *_axes("xyz", _COORDINATE, "the centre of the core"),
    *(
        _column(
            f"q{axis}",
            _COORDINATE,
            f"{axis} of the core's attitude, a unit quaternion, core to world",
            unit="1",
        )
        for axis in "wxyz"
    ),
    _column(
        "angles",
        pa.list_(_inner("item", _COORDINATE)),
        "angle of every joint, driven or not, by ascending part; of a slider its "
        "displacement",
        unit="rad; m of a slider",
    ),
)
DEATHS = _table(
    "deaths",
    "a robot that left an arena",
    *_INDIVIDUAL,
    _TIME,
    _BIRTHS,
    _column(
        "reason",
        pa.string(),
        '"selection" (below the share of the mean fitness), "cull" (removed from an '
        'arena full of mature robots), "diverged" (its physics or brain diverged, or '
        'code of a plug-in failed: see detail), "removed" (by an operator), "migrated" '
        '(moved to another island), "replaced" (made room for an immigrant), or as the '
        "rules of the arena say",
    ),
    _column("detail", pa.string(), "what diverged or failed; otherwise empty"),
    *_axes("xy", _FLOAT, "the centre of its core"),
    _nullable(
        "z",
        _FLOAT,
        "z of the centre of its core, world frame, z up; null if the robot left before "
        "its first step",
        unit="m",
    ),
)
TOUCHES = _table(
    "touches",
    "a pair of robots that touched during an interval of an arena",
    *_INDIVIDUAL,
    *_SECOND_ROBOT,
    _column("sim_time_s", _FLOAT, "simulated time of the interval's end", unit="s"),
    _column("over_s", _FLOAT, "length of the interval", unit="s"),
    _column("duration_s", _FLOAT, "time in contact during the interval", unit="s"),
)
MEETINGS = _table(
    "meetings",
    "a pair of robots that met, as arena.rules say, before a decision of an arena",
    *_INDIVIDUAL,
    *_SECOND_ROBOT,
    _column("sim_time_s", _FLOAT, "simulated time of the decision", unit="s"),
    _column("over_s", _FLOAT, "time since the decision before", unit="s"),
    _column("duration_s", _FLOAT, "time within the distance, by samples", unit="s"),
    _column("nearest_m", _FLOAT, "least distance of the cores", unit="m"),
)
MATINGS = _table(
    "matings",
    "a mating of parents that the rules of an arena named",
    _ISLAND,
    _TIME,
    _column("parents", pa.list_(PARENT), "ids of the parents, two or one"),
    *(
        _nullable(
            axis,
            _FLOAT,
            f"{axis} of the place near which the child is born; null if any place",
            unit="m",
        )
        for axis in "xy"
    ),
    _nullable(
        "birth", pa.int64(), "number of the birth of the child; null without one"
    ),
    _column(
        "outcome",
        pa.string(),
        '"born", "not viable" (no body passed vetting) or "no room" (a full arena, or '
        "no birth left)",
    ),
)
PATCHES = _table(
    "patches",
    "a place that the rules of an arena keep, and sample of the arena",
    _ISLAND,
    _TIME,
    _column("patch", pa.int32(), "number of the place, from 0"),
    *_axes("xy", _FLOAT, "its centre"),
    _column("radius_m", _FLOAT, "radius of the place", unit="m"),
    _column("content", _FLOAT, "what it holds, such as energy", unit="1"),
)
ARCHIVE = _table(
    "archive",
    "a change of the archive that a rule of selection keeps on an island: who is in an "
    "entry from now on; nobody if birth is null",
    _ISLAND,
    _BIRTHS,
    _TIME.with_nullable(True),
    _column("entry", pa.string(), "cell, such as 3/7, island:birth, or text of a rule"),
    _BIRTH_ISLAND,
    _BIRTH.with_nullable(True),
    _OUTCOME[0],
    _MEASURES,
)
MIGRATIONS = _table(
    "migrations",
    "a migrant sent",
    _column("island", pa.int32(), "number of the island that it left"),
    _column("to", pa.int32(), "number of the island that it reached"),
    _column("epoch", pa.int64(), "number of the migration epoch"),
    _column("births", pa.int64(), "individuals born on the island that it left so far"),
    _nullable(
        "sim_time_s",
        _FLOAT,
        "simulated time of the arena that it left; null off-line",
        unit="s",
    ),
    _column("birth_island", pa.int32(), "island where the migrant was born"),
    _BIRTH,
    _fitness("on the island that it left; null if its evaluation failed"),
)
AUDITS = _table(
    "audits",
    "an answer to an evaluation that two workers did; a flag selects the evaluations, "
    "so no column is repeatable",
    _ISLAND,
    _BIRTH,
    _column("trial", pa.int32(), "as in evaluations"),
    _column("agrees", pa.bool_(), "whether both answers are equal"),
    _column("worker", pa.string(), "name of the worker"),
    _column("platform", pa.string(), "platform of the worker"),
    _column("reason", pa.string(), "of a failure; otherwise empty"),
    *_OUTCOME,
    is_repeatable=False,
)
DRIFTS = _table(
    "drifts",
    "a move of an arena to a worker of another platform, from where on the run differs "
    "from one on a single platform; a flag allows it",
    _ISLAND,
    _column("step", pa.int64(), "first physics step that the new worker reached"),
    _column("before", pa.string(), "platform of the worker before"),
    _column("after", pa.string(), "platform of the new worker"),
    _column("worker", pa.string(), "name of the new worker"),
    is_repeatable=False,
)
RUNS = _table(
    "runs",
    "a run",
    _column("name", pa.string(), "of the experiment"),
    _column("run", pa.int32(), "number of the repeat, from 0"),
    _column("seed", pa.uint64(), _SEED),
    _column("document", pa.string(), "the experiment as JSON, with all defaults"),
    _column("state", pa.string(), "of the run: finished"),
    _local("versions", pa.string(), "versions of libraries as JSON"),
    _column("platform", pa.string(), "of the coordinator", is_repeatable=False),
    _local("cpu_flags", pa.string(), "of the coordinator's machine"),
    _column("start", _INSTANT, "time by the clock, UTC", is_repeatable=False),
    _nullable("end", _INSTANT, "time by the clock, UTC", is_repeatable=False),
)


def repeatable(schema: pa.Schema) -> list[str]:
    """Return the names of the repeatable columns."""
    return [field.name for field in schema if field.metadata[b"repeatable"] == b"true"]


def completed(
    rows: pa.Table, schema: pa.Schema, of_run: Mapping[str, object]
) -> pa.Table:
    """Return rows of earlier versions with the columns of the schema that they lack.

    ``of_run`` has the values of columns that are the same in all rows of the run.

    Raises:
        ValueError: the rows are not of the table.
    """
    missing = [field for field in schema if field.name not in rows.column_names]
    for field in missing:
        # Of rows that are older than a column; otherwise they have null.
        absent = field.metadata.get(b"absent")
        value = pa.scalar(of_run.get(field.name, absent and int(absent)), field.type)
        rows = rows.append_column(field, pa.repeat(value, rows.num_rows))
    # Parquet has its own name for the items of a list.
    return rows.select(schema.names).cast(schema)
