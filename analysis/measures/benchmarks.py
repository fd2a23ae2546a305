"""Reads the files of `revolve bench arena|spider --out FILE`."""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from analysis.measures.load import LeftOut

_NAME = b"arena-benchmark"
_COLUMNS = pa.schema(
    {"benchmark": pa.string(), "population": pa.int32(), "factor": pa.float64()}
)
_RUNS = "experiment="
"""Prefix of folders that contain tables of runs."""


def read_benchmarks(roots: Iterable[Path]) -> tuple[pa.Table, list[LeftOut]]:
    """Return the benchmarks in some files and folders, and files that are left out.

    Each row is a repetition: ``benchmark`` ("arena" or "spider"), ``population``,
    ``factor`` (simulated by wall-clock time). Files below a folder that are no
    benchmarks are ignored; a file that is given itself is reported.
    """
    pieces = [_COLUMNS.empty_table()]
    left_out = []
    for path, is_named in _files(roots).items():
        try:
            metadata = pq.read_schema(path).metadata or {}
            if metadata.get(b"revolve.schema") == _NAME:
                table = pq.read_table(path, columns=_COLUMNS.names)
                pieces.append(table.replace_schema_metadata().cast(_COLUMNS))
            elif is_named:
                left_out.append(LeftOut(str(path), "benchmark", "not a benchmark file"))
        except (OSError, pa.ArrowException, ValueError) as error:
            left_out.append(LeftOut(str(path), "benchmark", str(error)))
    return pa.concat_tables(pieces), left_out


def _files(roots: Iterable[Path]) -> dict[Path, bool]:
    files: dict[Path, bool] = {}
    for root in roots:
        if root.is_file():
            files[root] = True
        for path in sorted(root.glob("**/*.parquet")):
            if not any(part.startswith(_RUNS) for part in path.parts):
                files.setdefault(path, False)
    return files
