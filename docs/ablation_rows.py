"""Writes the tables and pictures of docs/ablation.md from docs/ablation_data.

revolve ablate RUN ... --out FOLDER
python -m docs.ablation_rows keep FOLDER/ablation.parquet --births 3000
python -m docs.ablation_rows changes RUN ...  # keep the changes of brains of runs
python -m docs.ablation_rows page             # write tables and pictures
python -m docs.ablation_rows page --check     # fail if the tables differ
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

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
from docs.page_parts import write_parts
from schema.errors import rounded

DOCS = Path(__file__).resolve().parent
DATA, PAGE, PICTURES = DOCS / "ablation_data", DOCS / "ablation.md", DOCS / "pictures"
CHANGES = DATA / "changes.parquet"
WIDTH, COLOURS = 1400, 64
"""Pixels across a picture, and its number of colours."""
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the commands; return 0, or 1 if a check fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    keeping = commands.add_parser("keep", help="keep the rows of revolve ablate")
    keeping.add_argument("table", type=Path, help="ablation.parquet")
    keeping.add_argument("--births", type=int, required=True, help="births of a run")
    changing = commands.add_parser("changes", help="keep the changes of brains")
    changing.add_argument("runs", type=Path, nargs="+", help="run folders")
    writing = commands.add_parser("page", help="write tables and pictures")
    writing.add_argument("--check", action="store_true", help="write nothing; compare")
    options = parser.parse_args(arguments)
    if options.command == "keep":
        keep(options.table, options.births)
    elif options.command == "changes":
        pq.write_table(pa.concat_tables(map(changes_of, options.runs)), CHANGES)
    else:
        return write_page(is_check=options.check)
    return 0


def keep(table: Path, births: int) -> None:
    """Keep rows of one experiment, with the names of run folders for their paths."""
    rows = pq.read_table(table)
    names = [Path(folder).name for folder in rows["folder"].to_pylist()]
    index = rows.schema.get_field_index("folder")
    rows = rows.set_column(index, rows.schema.field("folder"), pa.array(names))
    (experiment,) = set(rows["experiment"].to_pylist())
    pq.write_table(rows, DATA / f"{experiment}-{births}.parquet")


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


def write_page(*, is_check: bool) -> int:
    """Write the page's tables and pictures, or check the tables."""
    command = "python -m docs.ablation_rows page"
    code = write_parts(PAGE, parts(), command, is_check=is_check)
    if is_check:
        return code
    from analysis.figures.ablation import ablation  # noqa: PLC0415 - loads pandas
    from analysis.figures.brains import changes_over_births  # noqa: PLC0415

    drawn = {f"ablation-{name}": ablation(rows) for (name, _), rows in kept().items()}
    drawn["brain-changes"] = changes_over_births({"brains": pq.read_table(CHANGES)})
    for name, figure in drawn.items():
        save_small(figure, name)
    return 0


def save_small(figure: Any, name: str) -> None:  # noqa: ANN401 - plotnine has no types
    """Write a picture of few colours into the folder of pictures."""
    from PIL import Image  # noqa: PLC0415 - of an extra

    from analysis.figures.style import save  # noqa: PLC0415

    with TemporaryDirectory() as place:
        save(figure, Path(place) / name)
        with Image.open(Path(place) / f"{name}.png") as drawn:
            wide, high = WIDTH, WIDTH * drawn.height // drawn.width
            small = drawn.convert("RGB").resize((wide, high), Image.Resampling.LANCZOS)
    few = small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    few.save(PICTURES / f"{name}.png", optimize=True)
    print(f"{PICTURES.name}/{name}.png")


def parts() -> dict[str, list[str]]:
    """Return the generated parts of the page, by name."""
    tables = {
        f"{name.replace('scenario', 'scenario ')}, {births} births": _winners(rows)
        for (name, births), rows in kept().items()
    }
    return {
        "summary": list(summary_lines(tables)),
        "winners": list(winner_lines(tables)),
        "changes": list(change_lines(pq.read_table(CHANGES))),
    }


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


def summary_lines(tables: Mapping[str, Winners]) -> Iterator[str]:
    """Yield the table of medians over winners, a column for each experiment."""
    yield f"| the winner keeps | {' | '.join(tables)} |"
    yield "|---|" + "---|" * len(tables)
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
        yield f"| {text} | {' | '.join(cells)} |"
    needs, motors = [], []
    for winners in tables.values():
        whole = [shares(rows, HELD, ALL) for rows in winners.values()]
        needy = sum(min(each, default=1.0) < NEEDS for each in whole)
        needs.append(f"{needy} of {len(whole)}")
        single = [shares(rows, DEAD, ONE) for rows in winners.values()]
        carrying = sum(sum(each <= 1 - CARRIES for each in own) for own in single)
        motors.append(f"{carrying} of {sum(map(len, single))}")
    limit = percent(NEEDS)
    yield f"| winners that keep < {limit} without sensors | {' | '.join(needs)} |"
    yield (
        f"| motors that carry >= {percent(CARRIES)} of the fitness | "
        f"{' | '.join(motors)} |"
    )


def _spread(found: Sequence[float]) -> str:
    """Return median, least and greatest of some shares, and their number."""
    if not found:
        return "–"
    ends = f"{percent(min(found)).removesuffix(' %')} to {percent(max(found))}"
    return f"{percent(median(found))} ({ends}; {len(found)})"


def winner_lines(tables: Mapping[str, Winners]) -> Iterator[str]:
    """Yield a table with a row for each winner."""
    yield (
        "| run | fitness alone | without imu | without touch | sensors at mean | "
        "motors that carry most | random brains |"
    )
    yield "|---|---|---|---|---|---|---|"
    for winners in tables.values():
        for folder, rows in winners.items():
            cells = [
                _only(shares(rows, HELD, KIND, "imu")),
                _only(shares(rows, HELD, KIND, "touch")),
                _only(shares(rows, MEAN, ALL)),
            ]
            motors = [
                row
                for row in rows
                if (row["group"], row["scope"]) == (DEAD, ONE)
                and row["share"] is not None
            ]
            first = sorted(motors, key=lambda row: (row["share"], row["channel"]))[:3]
            names = ", ".join(
                f"{row['part']}: {percent(1 - row['share'])}" for row in first
            )
            cells += [f"{names} (of {len(motors)})", _only(shares(rows, RANDOM, ONE))]
            fitness = rounded(rows[0]["undisturbed"])
            yield f"| {folder} | {fitness} | {' | '.join(cells)} |"


def _only(found: Sequence[float]) -> str:
    return percent(median(found)) if found else "–"


def change_lines(changes: pa.Table) -> Iterator[str]:
    """Yield the table of changes of bodies and brains, means over runs and births."""
    yield (
        "| births | body [edits] | brain [elements] | varied | new | lost | "
        "recurrent | sensed |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    first = pc.multiply(pc.divide(changes["birth"], SPAN), SPAN)
    grouped = changes.append_column("first", first).group_by("first", use_threads=False)
    means = grouped.aggregate([(name, "mean") for name in MEASURES]).sort_by("first")
    for row in means.to_pylist():
        cells = [f"{row[f'{name}_mean']:.2f}" for name in MEASURES]
        births = f"{row['first']} to {row['first'] + SPAN - 1}"
        yield f"| {births} | {' | '.join(cells)} |"


if __name__ == "__main__":
    sys.exit(main())
