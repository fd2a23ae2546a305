"""Writes the generated parts and pictures of the results pages from docs/data.

    python -m docs.studies.thesis.results page          # write them
    python -m docs.studies.thesis.results page --check  # fail if the pages differ

The pages are docs/results.md and docs/findings.md. A picture holds the digest of the
rows that it was drawn from, so that it can be checked without drawing.
"""

import sys
from functools import cache
from pathlib import Path

import pyarrow as pa

from analysis.comparison.findings import findings, with_benchmark
from analysis.comparison.progression import progression
from analysis.measures.benchmarks import read_benchmarks
from docs.studies.pages import Parts, command
from docs.studies.thesis.data import DATA, kept, kept_outcomes
from docs.studies.thesis.later import rows_of_windows
from docs.studies.thesis.parts import pages_of

_TABLES = ("outcomes", "populations", "runs", "family")


@cache
def tables_of(data: Path) -> dict[str, pa.Table]:
    """Return the kept tables, and those computed from them.

    Args:
        data: folder of the rows.
    """
    tables = {name: kept(data, name) for name in _TABLES}
    tables["windows"] = rows_of_windows(data)
    tables["benchmark"], _ = read_benchmarks([data / "bench"])
    tables["progression"] = progression(tables["populations"])
    outcomes = kept_outcomes(tables["outcomes"])
    tables["findings"] = findings(with_benchmark(outcomes, tables["benchmark"]))
    return tables


def pages() -> dict[str, Parts]:
    """Return the generated parts of the pages."""
    return pages_of(tables_of(DATA))


def draw() -> None:
    """Draw the pictures that are not up to date; print their names."""
    from docs.studies.thesis.pictures import draw as drawn  # noqa: PLC0415 - robots

    for name in drawn(tables_of(DATA)):
        print(name, flush=True)


main = command(__doc__, pages, draw)

if __name__ == "__main__":
    sys.exit(main(None))
