"""Last populations of runs, and what their failed robots count as."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc


def last_rows(populations: pa.Table) -> list[dict[str, Any]]:
    """Return the rows of each island's last population, by experiment and folder.

    Args:
        populations: with the columns of ``outputs``.
    """
    keys = ["experiment", "folder", "island"]
    last = populations.group_by(keys, use_threads=False).aggregate([("births", "max")])
    joined = populations.join(last, keys)
    rows = joined.filter(pc.equal(joined["births"], joined["births_max"]))
    found: list[dict[str, Any]] = rows.sort_by(
        [(key, "ascending") for key in keys]
    ).to_pylist()
    return found


def failures_as_best(tables: Mapping[str, pa.Table]) -> str:
    """Return a warning if failed evaluations may be the best of last populations.

    Args:
        tables: ``runs`` and ``populations``.

    Returns:
        A line that names the runs; empty if there is none.
    """
    runs = tables["runs"].filter(pc.field("failures") > 0)
    failures = dict(
        zip(*(runs[name].to_pylist() for name in ("folder", "failures")), strict=True)
    )
    folders = [
        row["folder"]
        for row in last_rows(tables["populations"])
        if row["fitness_best"] == 0.0 and row["folder"] in failures
    ]
    names = ", ".join(
        f"{Path(folder).name} ({failures[folder]} failed)"
        for folder in dict.fromkeys(folders)
    )
    if not names:
        return ""
    return f"a failed evaluation counts as fitness 0, which is the best of {names}"
