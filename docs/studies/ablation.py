"""Writes the tables and pictures of docs/ablation.md from docs/ablation_data.

revolve ablate RUN ... --out FOLDER
python -m docs.studies.ablation keep FOLDER/ablation.parquet
python -m docs.studies.ablation changes RUN ...  # keep the changes of brains of runs
python -m docs.studies.ablation page             # write tables and pictures
python -m docs.studies.ablation page --check     # fail if the tables differ
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from analysis.comparison.ablation import (
    ALL,
    DEAD,
    HELD,
    KIND,
    MEAN,
    ONE,
    RANDOM,
    shares,
)
from analysis.comparison.robustness import Row, percent
from analysis.measures.load import read_run, read_tables
from analysis.measures.measures import brains
from analysis.measures.run_tables import RunTables
from docs.studies.pages import DOCS, Parts, command, markdown, save_small
from schema.errors import rounded

DATA = DOCS / "ablation_data"
CHANGES = DATA / "changes.parquet"
STEP = 50
"""Births of a kept row of changes."""
SPAN = 500
"""Births of a row of the table of changes."""
CARRIES = 0.1
"""Least share of the fitness that a motor carries to be counted."""
NEEDS = 0.95
"""A robot that keeps less without its sensors needs them."""
MEASURES = (
    "body_change", "brain_change", "brain_varied", "brain_new", "brain_lost",
    "recurrent", "sensed",
)  # fmt: skip


def keep(tables: Sequence[Path]) -> None:
    """Keep rows of one experiment, with the names of run folders for their paths."""
    for table in tables:
        rows = pq.read_table(table)
        folders = [Path(folder) for folder in dict.fromkeys(rows["folder"].to_pylist())]
        births = read_tables(read_run(folders[0]))[0]["births"].num_rows
        names = [Path(folder).name for folder in rows["folder"].to_pylist()]
        index = rows.schema.get_field_index("folder")
        rows = rows.set_column(index, rows.schema.field("folder"), pa.array(names))
        (experiment,) = set(rows["experiment"].to_pylist())
        pq.write_table(rows, DATA / f"{experiment}-{births}.parquet")


def keep_changes(folders: Sequence[Path]) -> None:
    """Keep the changes of brains of some runs."""
    pq.write_table(pa.concat_tables(map(changes_of, folders)), CHANGES)


def changes_of(folder: Path) -> pa.Table:
    """Return means over ``STEP`` births of a run's measures of brains."""
    run = read_run(folder)
    tables, _ = read_tables(run)
    found = brains(RunTables(tables))
    first = pc.multiply(pc.divide(found["birth"], STEP), STEP)
    grouped = found.append_column("first", first).group_by("first", use_threads=False)
    means = grouped.aggregate([(name, "mean") for name in MEASURES])
    columns = {name: means[f"{name}_mean"] for name in MEASURES}
    count = means.num_rows
    return pa.table(
        {
            "experiment": pa.repeat(run.experiment, count),
            "folder": pa.repeat(folder.name, count),
            "birth": pc.add(means["first"], STEP // 2),
            **columns,
        }
    )


def kept() -> dict[tuple[str, int], pa.Table]:
    """Return the kept tables of ablations, by experiment and births of a run."""
    found = {}
    for path in sorted(DATA.glob("*-*.parquet")):
        experiment, _, births = path.stem.rpartition("-")
        found[experiment, int(births)] = pq.read_table(path)
    return found


def draw() -> None:
    """Write the pictures of the page."""
    from analysis.figures.changes import ablation  # noqa: PLC0415 - loads pandas
    from analysis.figures.courses import changes_over_births  # noqa: PLC0415

    for (name, _), rows in kept().items():
        save_small(ablation(rows), f"ablation-{name}")
    changes = {"brains": pq.read_table(CHANGES)}
    save_small(changes_over_births(changes), "brain-changes")


def pages() -> dict[str, Parts]:
    """Return the generated parts of the page."""
    tables = {
        f"{name.replace('scenario', 'scenario ')}, {births} births": _winners(rows)
        for (name, births), rows in kept().items()
    }
    parts = {
        "summary": summary_lines(tables),
        "winners": winner_lines(tables),
        "changes": change_lines(pq.read_table(CHANGES)),
    }
    return {"ablation.md": parts}


def _winners(table: pa.Table) -> dict[str, list[Row]]:
    """Return the rows of each run's robot of the greatest fitness alone.

    In a run off-line it is the best robot. That of an arena may owe its fitness to
    others, or to its state at that time.
    """
    robots: dict[tuple[str, int, int], list[Row]] = {}
    for row in table.to_pylist():
        robots.setdefault((row["folder"], row["island"], row["birth"]), []).append(row)
    by_run: dict[str, list[list[Row]]] = {}
    for (folder, _, _), rows in robots.items():
        by_run.setdefault(folder, []).append(rows)
    return {
        folder: max(own, key=lambda rows: rows[0]["undisturbed"] or 0.0)
        for folder, own in by_run.items()
    }


Winners = Mapping[str, Sequence[Row]]


def summary_lines(tables: Mapping[str, Winners]) -> list[str]:
    """Return the table of medians over winners, a column for each experiment."""
    lines = []
    for text, group, scope, kind in (
        ("without its imu", HELD, KIND, "imu"),
        ("without its touch sensors", HELD, KIND, "touch"),
        ("without sensors", HELD, ALL, ""),
        ("with all sensors at their mean", MEAN, ALL, ""),
        ("without its most important motor", DEAD, ONE, ""),
        ("without motors", DEAD, ALL, ""),
        ("with a random brain, median of draws", RANDOM, ONE, ""),
    ):
        cells = []
        for winners in tables.values():
            known = [shares(rows, group, scope, kind) for rows in winners.values()]
            pick = min if group == DEAD else median
            cells.append(_spread([pick(each) for each in known if each]))
        lines.append([text, *cells])
    needs, motors = [], []
    for winners in tables.values():
        whole = [shares(rows, HELD, ALL) for rows in winners.values()]
        needy = sum(min(each, default=1.0) < NEEDS for each in whole)
        needs.append(f"{needy} of {len(whole)}")
        single = [shares(rows, DEAD, ONE) for rows in winners.values()]
        carrying = sum(sum(each <= 1 - CARRIES for each in own) for own in single)
        motors.append(f"{carrying} of {sum(map(len, single))}")
    lines.append([f"winners that keep < {percent(NEEDS)} without sensors", *needs])
    carry = f"motors that carry >= {percent(CARRIES)} of the fitness"
    return markdown(["the winner keeps", *tables], [*lines, [carry, *motors]])


def _spread(found: Sequence[float]) -> str:
    """Return median, least and greatest of some shares, and their number."""
    if not found:
        return "–"
    ends = f"{percent(min(found)).removesuffix(' %')} to {percent(max(found))}"
    return f"{percent(median(found))} ({ends}; {len(found)})"


def winner_lines(tables: Mapping[str, Winners]) -> list[str]:
    """Return a table with a row for each winner."""
    heads = ["run", "fitness alone", "without imu", "without touch", "sensors at mean",
             "motors that carry most", "random brains"]  # fmt: skip
    lines = []
    for folder, rows in (one for winners in tables.values() for one in winners.items()):
        motors = [
            row
            for row in rows
            if (row["group"], row["scope"]) == (DEAD, ONE) and row["share"] is not None
        ]
        first = sorted(motors, key=lambda row: (row["share"], row["channel"]))[:3]
        names = ", ".join(
            f"{row['part']}: {percent(1 - row['share'])}" for row in first
        )
        lines.append(
            [
                folder,
                rounded(rows[0]["undisturbed"]),
                _only(shares(rows, HELD, KIND, "imu")),
                _only(shares(rows, HELD, KIND, "touch")),
                _only(shares(rows, MEAN, ALL)),
                f"{names} (of {len(motors)})",
                _only(shares(rows, RANDOM, ONE)),
            ]
        )
    return markdown(heads, lines)


def _only(found: Sequence[float]) -> str:
    return percent(median(found)) if found else "–"


def change_lines(changes: pa.Table) -> list[str]:
    """Return the table of changes of bodies and brains, means over runs and births."""
    heads = ["births", "body [edits]", "brain [elements]", "varied", "new", "lost",
             "recurrent", "sensed"]  # fmt: skip
    first = pc.multiply(pc.divide(changes["birth"], SPAN), SPAN)
    grouped = changes.append_column("first", first).group_by("first", use_threads=False)
    means = grouped.aggregate([(name, "mean") for name in MEASURES]).sort_by("first")
    return markdown(
        heads,
        (
            [f"{row['first']} to {row['first'] + SPAN - 1}",
             *(f"{row[f'{name}_mean']:.2f}" for name in MEASURES)]
            for row in means.to_pylist()
        ),
    )  # fmt: skip


main = command(
    __doc__,
    pages,
    draw,
    keep=("keep the rows of revolve ablate", keep),
    changes=("keep the changes of brains of runs", keep_changes),
)

if __name__ == "__main__":
    sys.exit(main(None))
