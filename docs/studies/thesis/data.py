"""Tables of the campaign in docs/data: columns, files and reading.

A table is a folder with one file per repeat. Rows of a finished repeat never change.
"""

import math
import os
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from analysis.comparison.comparison import Outcomes, RunOutcomes, known
from analysis.comparison.outcomes import BORN_BY_COUNT, of_courses, slope
from analysis.measures.outputs import BODY, schema
from analysis.measures.population_table import Numbers
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
    Part("arena", "thesis-arena", ("scenario3",), repeats=30, batch=2),
    Part(
        "windows",
        "thesis-windows",
        tuple(
            f"{name}-{kind}"
            for kind in ("warm", "drawn", "reevaluated")
            for name in ("scenario1", "scenario2")
        ),
        repeats=10,
    ),
    Part(
        "touches",
        "thesis-touches",
        ("docs/data/scenario3-touches.toml",),
        repeats=10,
        births=150,
    ),
)

BRIDGES = tuple(
    name for part in PARTS if part.option == "windows" for name in part.names
)
"""Experiments between off-line and on-line, which are no part of the thesis."""
NAMES = [("experiment", pa.string()), ("run", pa.int32())]


COURSES = ("late_rise", "early_diversity")
"""Outcomes that are not in the files: computed from the kept ``populations``."""
WINDOWS = Path("windows") / "robots.csv"
"""Fitness of best robots in five windows, which outcomes of later windows follow from:
all start as in scenario 1."""
POPULATIONS = Path("windows") / "populations.csv"
"""Fitness of whole last populations from 36 to 60 s."""
SLOPE = "extremities_slope"
"""Outcome that is computed from the kept ``extremities``, at the end."""
_SELECTION = {"warm": (1, 2), "drawn": (None, 3), "reevaluated": (None, 3)}
"""Numbers of the window of selection, and of the first one after it, if not 0 and 1;
drawn durations have no single window."""
OF_WINDOWS = (*LATER, "kept_fitness")
SELECTED = "window 0 to 12 s"
LATER_COLUMNS = tuple(
    f"window {start} to {start + 12} s" for start in range(12, 60, 12)
)


def _of_analysis(table: str) -> pa.Schema:
    """Return the columns of ``revolve analyze``, but the repeat for the folder."""
    names = {"experiment", "folder", *COURSES, *OF_WINDOWS, SLOPE}
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
    return _with_windows(_with_courses(found, data), data)


def _with_courses(outcomes: pa.Table, data: Path) -> pa.Table:
    """Return the rows of ``outcomes`` with those of ``COURSES``.

    They are computed from the kept populations, of earlier and of later repeats alike.
    """
    columns = ["births", "fitness", "diversity"]
    populations = kept(data, "populations").select(["folder", *columns]).to_pandas()
    of_folder = dict(iter(populations.groupby("folder")))
    found: list[dict[str, float]] = []
    for folder, births in zip(
        outcomes["folder"].to_pylist(), outcomes["births"].to_pylist(), strict=True
    ):
        mine = of_folder[folder]
        values = {name: mine[name].to_numpy(np.float64) for name in columns}
        found.append(of_courses(values, values["births"], births, SPACING))
    for name in COURSES:
        column = pa.array([one[name] for one in found], pa.float64(), from_pandas=True)
        outcomes = outcomes.append_column(name, column)
    return outcomes


def windows(data: Path, experiment: str) -> Numbers:
    """Return the fitness of an experiment's best robots in five windows, (R, 5).

    Failed evaluations count 0.
    """
    columns = (SELECTED, *LATER_COLUMNS)
    rows = rows_of(data, experiment)
    return np.array([[float(row[key] or 0.0) for key in columns] for row in rows])


def rows_of(data: Path, experiment: str) -> list[dict[str, str]]:
    """Return an experiment's rows of ``WINDOWS``, by run."""
    rows = [row for row in csv_rows(data / WINDOWS) if row["experiment"] == experiment]
    return sorted(rows, key=lambda row: int(row["run"]))


def selection_of(experiment: str) -> tuple[int | None, int]:
    """Return the numbers of the window of selection, and of the first after it."""
    return _SELECTION.get(experiment.partition("-")[2], (0, 1))


def _of_windows(row: dict[str, str]) -> dict[str, float | None]:
    """Return the outcomes that follow from a row of ``WINDOWS``."""

    def value(key: str) -> float | None:
        return float(row[key]) if row[key] else None

    every = list(map(value, (SELECTED, *LATER_COLUMNS)))
    at, later = selection_of(row["experiment"])
    first, selected = every[0], None if at is None else every[at]
    groups = ("time step", "friction", "start")
    shares = [
        [each / first for key in row if key.startswith(group)
         if (each := value(key)) is not None]
        for group in groups
        if first is not None and first > 0
    ]  # fmt: skip
    kept_fitness = fmean(map(fmean, shares)) if shares else None
    after = every[later:]
    values = later_fitness(after), sustained(selected, after), kept_fitness
    return dict(zip(OF_WINDOWS, values, strict=True))


def _slopes(data: Path) -> dict[str, float | None]:
    """Return ``SLOPE`` by repeat."""
    born = kept(data, "extremities").filter(BORN_BY_COUNT).to_pandas()
    return {
        name: known(slope(*(mine[key].to_numpy(np.float64)
                            for key in ("bin", "fitness", "robots"))))
        for name, mine in born.groupby("folder")
    }  # fmt: skip


def _with_windows(outcomes: pa.Table, data: Path) -> pa.Table:
    """Return the rows of ``outcomes`` with ``OF_WINDOWS`` and ``SLOPE``, at the end."""
    rows = {(row["experiment"], int(row["run"])): _of_windows(row)
            for row in csv_rows(data / WINDOWS)}  # fmt: skip
    keys = outcomes.select(["experiment", "run", "births"]).to_pylist()
    ends: dict[tuple[str, int], int] = {}
    for row in keys:
        key = row["experiment"], row["run"]
        ends[key] = max(row["births"], ends.get(key, 0))
    found: list[dict[str, float | None]] = []
    for row in keys:
        key = row["experiment"], row["run"]
        found.append(rows.get(key, {}) if row["births"] == ends[key] else {})
    names = outcomes["folder"].to_pylist()
    slopes = _slopes(data)
    for row, each, name in zip(keys, found, names, strict=True):
        if row["births"] == ends[row["experiment"], row["run"]]:
            each[SLOPE] = slopes[name]
    for name in (*OF_WINDOWS, SLOPE):
        values = [each.get(name) for each in found]
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
