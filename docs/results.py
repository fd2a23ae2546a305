"""Writes the generated parts and pictures of the results pages from docs/data.

    python -m docs.results            # write them
    python -m docs.results --check    # fail if they differ from what would be written

The pages are docs/results.md and docs/findings.md. A generated part is between two
comments of its page that name it. A picture holds the
digest of the rows that it was drawn from, so that it can be checked without drawing.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa

from analysis.comparison.findings import WithBenchmark, findings
from analysis.comparison.progression import progression
from analysis.measures.benchmarks import read_benchmarks
from docs.campaign_data import DATA, KeptOutcomes, kept
from docs.page_parts import with_parts
from docs.results_parts import parts_of
from schema.errors import RevolveError

DOCS = Path(__file__).resolve().parent
_TABLES = ("outcomes", "populations", "runs", "family")


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page and its pictures, or check them.

    Returns:
        0; with ``--check`` 1 if the page or a picture is not up to date.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; compare")
    options = parser.parse_args(arguments)
    tables = tables_of(DATA)
    pages = pages_of(tables)
    if options.check:
        stale = stale_files(pages, tables)
        for name in stale:
            print(f"{name}: not up to date, run python -m docs.results")
        return 1 if stale else 0
    for path, page in pages.items():
        path.write_text(page, encoding="utf-8")
        print(path.name)
    from docs.results_pictures import draw  # noqa: PLC0415 - draws robots

    try:
        for name in draw(tables):
            print(name, flush=True)
    except RevolveError as error:
        print(error)
        return 1
    return 0


def tables_of(data: Path) -> dict[str, pa.Table]:
    """Return the kept tables, and those computed from them.

    Args:
        data: folder of the rows.
    """
    tables = {name: kept(data, name) for name in _TABLES}
    tables["benchmark"], _ = read_benchmarks([data / "bench"])
    tables["progression"] = progression(tables["populations"])
    outcomes = KeptOutcomes(tables["outcomes"])
    tables["findings"] = findings(WithBenchmark(outcomes, tables["benchmark"]))
    return tables


def pages_of(tables: Mapping[str, pa.Table]) -> dict[Path, str]:
    """Return the pages with the generated parts of some tables.

    Args:
        tables: as ``tables_of`` returns them.
    """
    return {
        DOCS / name: with_parts(
            (DOCS / name).read_text("utf-8"),
            {part: [text] for part, text in parts.items()},
        )
        for name, parts in parts_of(tables).items()
    }


def stale_files(pages: Mapping[Path, str], tables: Mapping[str, pa.Table]) -> list[str]:
    """Return the names of the pages and pictures that differ from the rows.

    Args:
        pages: the pages as they should be.
        tables: as ``tables_of`` returns them.
    """
    from docs.results_pictures import digest_in, digests  # noqa: PLC0415 - slow import

    stale = [
        path.name for path, page in pages.items() if path.read_text("utf-8") != page
    ]
    for path, digest in digests(tables).items():
        if digest_in(path) != digest:
            stale.append(path.name)
    return stale


if __name__ == "__main__":
    sys.exit(main())
