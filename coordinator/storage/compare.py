"""Comparison of two runs or campaigns in all repeatable columns."""

from operator import itemgetter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute

from coordinator.storage.campaign import is_campaign, read_campaign
from coordinator.storage.folder import read_details
from schema.errors import ExperimentError, RunFolderError, counted
from schema.experiment.file import experiment_from_text, experiment_text
from schema.tables.columns import TABLES, repeatable
from schema.tables.description import read_state
from schema.tables.files import read_table

LONGEST = 60
"""Characters of a value that a message shows."""


def compare(first: Path, second: Path) -> list[str]:
    """Return the differences of two runs or campaigns in their repeatable columns.

    There is one line for each run without births, or shorter and not finished; for each
    table whose number of rows differs; and for its first differing row and column.
    Others name the last brood of a shorter run, which has no counterpart, and different
    platforms, as equality is only guaranteed on one. Of campaigns, such lines of each
    run, named first; a last line names the runs that differ.

    Raises:
        RunFolderError: a folder holds no run, or a table cannot be read.
    """
    if is_campaign(first) and is_campaign(second):
        return _of_campaigns(first, second)
    for folder in (first, second):
        read_details(folder)
    lines: list[str] = []
    platforms: list[set[str]] = [set(), set()]
    for name, schema in TABLES.items():
        if not repeatable(schema):
            continue
        tables = [_read(folder, name) for folder in (first, second)]
        lines += _unequal_rows(name, tables)
        if name == "population":
            lines += _drop_early_ends(tables, (first, second))
        lines += _difference(name, tables, repeatable(schema))
        if name == "births":
            lines += _unfinished((first, second), tables)
        if "platform" in schema.names:
            for found, table in zip(platforms, tables, strict=True):
                found.update(pa.compute.unique(table["platform"]).to_pylist())
    # Arenas do not record their platform before they end.
    if lines and all(platforms) and platforms[0] != platforms[1]:
        ours, theirs = (", ".join(sorted(each)) for each in platforms)
        lines.append(
            f"platforms differ: {ours} against {theirs}; only runs on the same "
            "platform are guaranteed to be equal"
        )
    return lines


def _of_campaigns(*folders: Path) -> list[str]:
    runs = [path.name for each in folders for path, _ in read_campaign(each).runs(each)]
    differences: dict[str, list[str]] = {}
    for name in dict.fromkeys(runs):
        pair = [folder / name for folder in folders]
        if lost := [each for each in pair if not each.exists()]:
            differences[name] = [f"{lost[0]}: no such folder"]
            continue
        try:
            differences[name] = compare(*pair)
        except RunFolderError as error:
            differences[name] = [str(error)]
    differing = [name for name, found in differences.items() if found]
    lines = [f"{name}: {line}" for name in differing for line in differences[name]]
    total = counted(len(differences), "run")
    last = f"{len(differing)} of {total} differ: {', '.join(differing)}"
    return [*lines, last] if lines else []


def _read(folder: Path, name: str) -> pa.Table:
    """Return the columns of a table that are compared, and its platforms.

    Experiment documents of older versions get all defaults.
    """
    platform = [each for each in TABLES[name].names if each == "platform"]
    table = read_table(folder, name, repeatable(TABLES[name]) + platform)
    if name != "runs":
        return table
    index = table.schema.get_field_index("document")
    documents = [_with_defaults(text) for text in table["document"].to_pylist()]
    return table.set_column(
        index, table.schema.field(index), pa.array(documents, pa.string())
    )


def _with_defaults(document: str) -> str:
    try:
        return experiment_text(experiment_from_text(document))
    except ExperimentError:
        return document


def _unfinished(folders: tuple[Path, Path], births: list[pa.Table]) -> list[str]:
    """Return a line for each run without births, and for a shorter, unfinished one."""
    most = max(table.num_rows for table in births)
    lines = []
    for folder, table in zip(folders, births, strict=True):
        if not table.num_rows:
            lines.append(f"{folder}: has no births yet, so there is nothing to compare")
        elif table.num_rows < most and read_state(folder) != "finished":
            lines.append(f"{folder}: is not finished, so it has fewer rows")
    return lines


def _unequal_rows(name: str, tables: list[pa.Table]) -> list[str]:
    """Return a line if two tables of one name have different numbers of rows.

    Tables with as many rows are compared island by island.
    """
    for place, rows in [("", tables), *_by_island(tables)]:
        ours, theirs = (table.num_rows for table in rows)
        if ours != theirs:
            return [f"{name}: {ours} rows{place} against {theirs}"]
    return []


def _by_island(tables: list[pa.Table]) -> list[tuple[str, list[pa.Table]]]:
    """Return the rows of each island in two tables, and where that is, for messages.

    Tables that name at most one island are returned whole, with an empty text.
    """
    islands: set[int] = set()
    if "island" in tables[0].column_names:
        for table in tables:
            islands.update(pa.compute.unique(table["island"]).to_pylist())
    if len(islands) <= 1:
        return [("", tables)]
    return [
        (
            f" of island {island}",
            [each.filter(pa.compute.equal(each["island"], island)) for each in tables],
        )
        for island in sorted(islands)
    ]


def _drop_early_ends(tables: list[pa.Table], folders: tuple[Path, Path]) -> list[str]:
    """Drop last populations that the longer run does not have; return what they are.

    The last brood of a run ends at its number of births, and the brood of a longer run
    goes on there. ``tables`` are the populations of both runs, and change.
    """
    lines = []
    ends = [_last_births(table) for table in tables]
    for one, other in ((0, 1), (1, 0)):
        for island, births in sorted(ends[one].items()):
            there = pa.compute.any(_is_at(tables[other], island, births))
            if births >= ends[other].get(island, 0) or there.as_py():
                continue
            rows = _is_at(tables[one], island, births)
            tables[one] = tables[one].filter(pa.compute.invert(rows))
            lines.append(
                f"population: not compared at {births} births of island {island}, "
                f"where the last brood of {folders[one]} ends and that of the longer "
                "run goes on"
            )
    return lines


def _last_births(population: pa.Table) -> dict[int, int]:
    found = population.group_by("island").aggregate([("births", "max")])
    names = ("island", "births_max")
    return dict(zip(*(found[name].to_pylist() for name in names), strict=True))


def _is_at(population: pa.Table, island: int, births: int) -> pa.ChunkedArray:
    is_there = pa.compute.equal(population["island"], island)
    is_then = pa.compute.equal(population["births"], births)
    return pa.compute.and_(is_there, is_then)


def _difference(name: str, tables: list[pa.Table], columns: list[str]) -> list[str]:
    """Return a line on the first difference of two tables of one name, if any.

    Tables are sorted by island, and each island is compared by itself: where one has
    fewer rows, the rows of the next island have other record numbers.
    """
    for place, rows in _by_island(tables):
        found = [
            (row, column)
            for column in columns
            if column != "record"
            and (row := _first_difference(*(table[column] for table in rows)))
            is not None
        ]
        if found:
            row, column = min(found, key=itemgetter(0))
            one, other = (table[column][row].as_py() for table in rows)
            values = f"{_short(one)} against {_short(other)}"
            return [f"{name}: first at record {row}{place}, column {column}: {values}"]
    return []


def _first_difference(ours: pa.ChunkedArray, theirs: pa.ChunkedArray) -> int | None:
    """Return the row of the first difference in the common rows; None if equal.

    Values are equal if their representations are: a NaN equals itself.
    """
    common = min(len(ours), len(theirs))
    ours, theirs = ours[:common], theirs[:common]
    if ours.equals(theirs):
        return None
    pairs = zip(ours, theirs, strict=True)
    rows = (
        row for row, (a, b) in enumerate(pairs) if repr(a.as_py()) != repr(b.as_py())
    )
    return next(rows, None)


def _short(value: Any) -> str:  # noqa: ANN401 - any value of any column
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
