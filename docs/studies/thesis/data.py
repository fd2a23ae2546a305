"""Tables of the campaign in docs/data: columns, files and reading.

A table is a folder with one file per repeat. Rows of a finished repeat never change.
"""

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from analysis.comparison.comparison import Outcomes, RunOutcomes
from analysis.comparison.outcomes import of_courses
from analysis.measures.outputs import BODY, schema
from analysis.measures.winners import LATER
from docs.studies.pages import DOCS, csv_rows
from schema.robot.results import later_fitness, sustained

DATA = DOCS / "data"
BENCHMARKS = ("arena", "spider")
"""Kinds of ``revolve bench`` whose files are in the folder ``bench``."""
SPACING = 15
"""Births between the populations that are kept: the brood size of the thesis."""
LEVEL = 19
"""Compression level of zstd: files are written once and stay in the Git history."""


@dataclass(frozen=True, slots=True)
class Part:
    """Part of the campaign: experiments of equal repeats, births and seed.

    Attributes:
        option: value of ``--only``.
        folder: folder below ``runs``.
        experiments: names of shipped experiments, or paths.
        repeats: repeats of each experiment.
        births: births of each run.
        seed: seed of all runs.
        batch: repeats that share a campaign; the runs of arenas take turns, and a
            batch of many would finish its first one late.
    """

    option: str
    folder: str
    experiments: tuple[str, ...]
    repeats: int
    births: int = 3000
    seed: int = 1
    batch: int = 10

    @property
    def names(self) -> list[str]:
        """Names of the experiments."""
        return [Path(experiment).stem for experiment in self.experiments]


PARTS = (
    Part(
        "off-line",
        "thesis",
        ("scenario1", "scenario2", "no-selection", "no-reproduction"),
        repeats=30,
    ),
    Part("arena", "thesis-arena", ("scenario3",), repeats=10, batch=2),
    Part(
        "touches",
        "thesis-touches",
        ("docs/data/scenario3-touches.toml",),
        repeats=10,
        births=150,
    ),
)

NAMES = [("experiment", pa.string()), ("run", pa.int32())]


COURSES = ("late_rise", "early_diversity")
"""Outcomes that are not in the files: computed from the kept ``populations``."""
WINDOWS = Path("windows") / "robots.csv"
"""Fitness of best robots in five windows, which outcomes of later windows follow from:
all start as in scenario 1."""
SELECTED = "window 0 to 12 s"
LATER_COLUMNS = tuple(
    f"window {start} to {start + 12} s" for start in range(12, 60, 12)
)


def _of_analysis(table: str) -> pa.Schema:
    """Return the columns of ``revolve analyze``, but the repeat for the folder."""
    names = {"experiment", "folder", *COURSES, *LATER}
    fields = [(one.name, one.type) for one in schema(table) if one.name not in names]
    return pa.schema([*NAMES, *fields])


_RUNS = {
    "seed": pa.uint64(),
    "births": pa.int64(),
    "state": pa.string(),
    "platform": pa.string(),
    "versions": pa.string(),
    "commit": pa.string(),
    "document": pa.string(),
}
_FINAL = {
    "birth": pa.int64(),
    "parents": pa.list_(pa.int64()),
    "fitness": pa.float64(),
    **dict.fromkeys(("rank", "ancestors", *BODY), pa.int64()),
    "genome": pa.binary(),
}
_FAMILY = {
    "birth": pa.int64(),
    "level": pa.int64(),
    "parents": pa.list_(pa.int64()),
    "rank": pa.int64(),
    "fitness": pa.float64(),
    "genome": pa.binary(),
}
_MEASURES = ("outcomes", "populations", "extremities", "variability")
TABLES = {
    **{name: _of_analysis(name) for name in _MEASURES},
    "final": pa.schema([*NAMES, *_FINAL.items()]),
    "family": pa.schema([*NAMES, *_FAMILY.items()]),
    "runs": pa.schema([*NAMES, *_RUNS.items()]),
}
"""Columns of the tables, by the name of the folder in ``docs/data``.

``runs`` is written last: if it exists, the others exist.
"""

_ONLY_OF_ARENAS = {"variability"}
_ARENAS = {"arena", "touches"}


def parquet(table: pa.Table) -> bytes:
    """Return a table as compressed Parquet; equal tables give equal bytes."""
    counts = {"birth", "births", "rank", "ancestors"}
    splits = {"fitness", "fitness_range", "population_range"}
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    encodings = {}
    for field in table.schema:
        if field.name in counts and pa.types.is_integer(field.type):
            encodings[field.name] = "DELTA_BINARY_PACKED"
        elif field.name in splits:
            encodings[field.name] = "BYTE_STREAM_SPLIT"
    sink = pa.BufferOutputStream()
    pq.write_table(
        table,
        sink,
        compression="zstd",
        compression_level=LEVEL,
        use_dictionary=texts,
        column_encoding=encodings,
        write_statistics=False,
        store_schema=False,
        write_page_checksum=True,
    )
    found: bytes = sink.getvalue().to_pybytes()
    return found


def replace(path: Path, content: bytes) -> None:
    """Write a file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{path.name}.new")
    with new.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)


def stem(experiment: str, number: int) -> str:
    """Return the name of a repeat's files without the ending."""
    return f"{experiment}-{number:02}"


def path_of(data: Path, table: str, name: str) -> Path:
    """Return the path of the rows of a repeat, named by ``stem``."""
    return data / table / f"{name}.parquet"


def benchmark_path(data: Path, kind: str) -> Path:
    """Return the path of a file of ``revolve bench``."""
    return data / "bench" / f"{kind}.parquet"


def tables_of(part: Part) -> list[str]:
    """Return the tables that each run of a part has."""
    is_arena = part.option in _ARENAS
    return [name for name in TABLES if is_arena or name not in _ONLY_OF_ARENAS]


def read_rows(data: Path, table: str, name: str) -> pa.Table:
    """Return the rows of a repeat; raises an error for damaged pages.

    Measures that were added after the rows were written are null.

    Args:
        data: folder of the rows.
        table: a key of ``TABLES``.
        name: name of the repeat, as ``stem`` returns it.
    """
    content = path_of(data, table, name).read_bytes()
    with pq.ParquetFile(
        pa.BufferReader(content), page_checksum_verification=True
    ) as file:
        rows = file.read()
    lacking = [one for one in TABLES[table] if one.name not in rows.column_names]
    if table not in _MEASURES or not lacking:
        return rows
    for one in lacking:
        rows = rows.append_column(one, pa.nulls(rows.num_rows, one.type))
    known = TABLES[table].names
    return rows.select([*known, *(set(rows.column_names) - set(known))])


def kept(data: Path, table: str) -> pa.Table:
    """Return the rows of a table of all repeats, with the column ``folder``.

    They have the form of the tables of ``revolve analyze``, which ``progression`` and
    the figures read; ``folder`` is the name of the repeat.

    Args:
        data: folder of the rows; its files pass ``check``.
        table: a key of ``TABLES``.
    """
    pieces = []
    for name in sorted(path.stem for path in (data / table).glob("*.parquet")):
        rows = read_rows(data, table, name)
        pieces.append(rows.append_column("folder", pa.repeat(name, rows.num_rows)))
    found = pa.concat_tables(pieces)
    if table != "outcomes":
        return found
    return _with_later_windows(_with_courses(found, data), data)


def _with_courses(outcomes: pa.Table, data: Path) -> pa.Table:
    """Return the rows of ``outcomes`` with those of ``COURSES``.

    They are computed from the kept populations, of earlier and of later repeats alike.
    """
    populations = kept(data, "populations")
    found: list[dict[str, float]] = []
    columns = ("births", "fitness", "diversity")
    for folder, births in zip(
        outcomes["folder"].to_pylist(), outcomes["births"].to_pylist(), strict=True
    ):
        mine = populations.filter(pc.field("folder") == folder)
        values = {name: np.asarray(mine[name], np.float64) for name in columns}
        found.append(of_courses(values, values["births"], births, SPACING))
    for name in COURSES:
        column = pa.array([one[name] for one in found], pa.float64(), from_pandas=True)
        outcomes = outcomes.append_column(name, column)
    return outcomes


def windows(data: Path, experiment: str) -> list[list[float | None]]:
    """Return the fitness of an experiment's best robots in five windows, by repeat."""
    return [
        each for (name, _), each in sorted(_windows(data).items()) if name == experiment
    ]


def _windows(data: Path) -> dict[tuple[str, int], list[float | None]]:
    return {
        (row["experiment"], int(row["run"])): [
            float(row[key]) if row[key] else None for key in (SELECTED, *LATER_COLUMNS)
        ]
        for row in csv_rows(data / WINDOWS)
    }


def _with_later_windows(outcomes: pa.Table, data: Path) -> pa.Table:
    """Return the rows of ``outcomes`` with those of ``LATER``, at the end of runs."""
    every = _windows(data)
    ends: dict[tuple[str, int], int] = {}
    rows = outcomes.select(["experiment", "run", "births"]).to_pylist()
    for row in rows:
        key = row["experiment"], row["run"]
        ends[key] = max(row["births"], ends.get(key, 0))
    found: dict[str, list[float | None]] = {name: [] for name in LATER}
    for row in rows:
        key = row["experiment"], row["run"]
        is_known = key in every and row["births"] == ends[key]
        first, *later = every[key] if is_known else [None]
        found["later_fitness"].append(later_fitness(later) if later else None)
        found["sustained"].append(sustained(first, later) if later else None)
    for name, values in found.items():
        outcomes = outcomes.append_column(name, pa.array(values, pa.float64()))
    return outcomes


def kept_outcomes(rows: pa.Table, most: int | None = None) -> Outcomes:
    """Return the outcomes of the kept runs, which have the thesis's fitness function.

    Args:
        rows: rows of the table ``outcomes``, as ``kept`` returns them.
        most: most births at which experiments are compared; None is no limit.
    """
    at: dict[tuple[str, str], dict[int, dict[str, float]]] = {}
    for row in rows.to_pylist():
        if most is None or row["births"] <= most:
            found = {name: math.nan if value is None else value
                     for name, value in row.items()}  # fmt: skip
            names = row["experiment"], row["folder"]
            at.setdefault(names, {})[row["births"]] = found
    runs: dict[str, list[RunOutcomes]] = {}
    for (experiment, folder), mine in at.items():
        one = RunOutcomes(folder, "locomotion", tuple(mine), mine.__getitem__)
        runs.setdefault(experiment, []).append(one)
    return Outcomes(runs)
