"""Reads what benchmarks of the arena left: `revolve bench arena|spider --out FILE`."""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from analysis.measures.load import LeftOut

_NAME = b"arena-benchmark"
_COLUMNS = {
    "benchmark": pa.string(),
    "population": pa.int32(),
    "factor": pa.float64(),
}
_ENDING = ".parquet"
_RUNS = "experiment="
"""How folders with tables of runs start."""


def read_benchmarks(roots: Iterable[Path]) -> tuple[pa.Table, list[LeftOut]]:
    """Return the timings of arenas in some files or below some folders.

    Args:
        roots: files or folders; tables of runs and other files are passed over, but
            not if they are named as a root.

    Returns:
        One row per repetition: ``benchmark`` ("arena" or "spider"), ``population``,
        ``factor`` (simulated over wall time); and files that cannot be read.
    """
    pieces = [pa.schema(list(_COLUMNS.items())).empty_table()]
    left_out = []
    for path, is_named in _files(roots):
        try:
            found = pq.read_schema(path)
            if (found.metadata or {}).get(b"revolve.schema") == _NAME:
                table = pq.read_table(path, columns=list(_COLUMNS))
                pieces.append(table.replace_schema_metadata().cast(pieces[0].schema))
            elif is_named:
                left_out.append(LeftOut(str(path), "benchmark", "is none"))
        except (OSError, pa.ArrowException, ValueError) as error:
            left_out.append(LeftOut(str(path), "benchmark", str(error)))
    return pa.concat_tables(pieces), left_out


def _files(roots: Iterable[Path]) -> list[tuple[Path, bool]]:
    """Return the files that may be benchmarks, each once, and which are roots."""
    found: dict[Path, bool] = {}
    for root in roots:
        if root.is_file():
            found[root] = True
        for path in sorted(root.glob(f"**/*{_ENDING}")):
            if not any(part.startswith(_RUNS) for part in path.parts):
                found.setdefault(path, False)
    return list(found.items())
