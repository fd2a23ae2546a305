"""Checks of the campaign's rows: missing, damaged and unexpected files."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from docs.studies.thesis.data import (
    BENCHMARKS,
    NAMES,
    PARTS,
    TABLES,
    Part,
    benchmark_path,
    path_of,
    read_rows,
    stem,
    tables_of,
)
from schema.experiment.file import experiment_from_text, experiment_text

_TO_THE_END = {"outcomes", "populations", "runs"}


_OTHER_STUDIES = {"diversity", "ecosystem", "learning", "suite", "windows"}
"""Folders of the rows of other studies."""


def problems_of(data: Path, part: Part, name: str) -> Iterator[str]:
    """Yield the problems of a repeat's files."""
    for table in tables_of(part):
        path = path_of(data, table, name)
        place = f"{table}/{path.name}"
        try:
            rows = read_rows(data, table, name)
        except FileNotFoundError:
            yield f"{place}: missing"
        except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
            yield f"{place}: cannot be read: {error}"
        else:
            if why := _problem(rows, table, part, name):
                yield f"{place}: {why}"


def _problem(rows: pa.Table, table: str, part: Part, name: str) -> str:
    """Return the problem of readable rows, "" if there is none."""
    if rows.schema != TABLES[table]:
        found = ", ".join(f"{field.name} {field.type}" for field in rows.schema)
        return f"unexpected columns: {found}"
    names = set(zip(*(rows[key].to_pylist() for key, _ in NAMES), strict=True))
    if {stem(*each) for each in names} != {name}:
        return f"must have rows of {name} only, got {sorted(names)}"
    if table in _TO_THE_END and pc.max(rows["births"]).as_py() != part.births:
        return f"does not reach {part.births} births"
    if table == "runs" and (
        rows.num_rows != 1 or rows["state"][0].as_py() != "finished"
    ):
        return "must have one row, of a finished run"
    return ""


def _kept_repeats(data: Path, part: Part, experiment: str) -> list[int]:
    """Return the repeats that have at least one file."""
    there = {path.stem for path in data.glob("*/*.parquet")}
    return [each for each in range(part.repeats) if stem(experiment, each) in there]


def check(data: Path, parts: Sequence[Part] = PARTS) -> int:
    """Print kept, missing and damaged files.

    Args:
        data: folder of the rows.
        parts: parts of the campaign.

    Returns:
        0, or 1 if a file is damaged or unexpected, if a repeat is incomplete, if a run
        has several platforms, or if the runs of one experiment differ in settings.
        Repeats without any file are no error.
    """
    problems = []
    details: list[dict[str, str]] = []
    expected: set[Path] = set()
    for part in parts:
        for experiment in part.names:
            kept = _kept_repeats(data, part, experiment)
            for name in (stem(experiment, number) for number in kept):
                found = list(problems_of(data, part, name))
                problems += found
                expected |= {path_of(data, table, name) for table in tables_of(part)}
                if not found:
                    details += read_rows(data, "runs", name).to_pylist()
            missing = [each for each in range(part.repeats) if each not in kept]
            lack = f", missing: {_ranges(missing)}" if missing else ""
            print(f"{experiment}: {len(kept)} of {part.repeats} repeats{lack}")
    expected |= {benchmark_path(data, kind) for kind in BENCHMARKS}
    tables = (table for table in data.glob("*/") if table.name not in _OTHER_STUDIES)
    there = {path for table in tables for path in table.iterdir()}
    strays = sorted(there - expected)
    problems += [f"{path.relative_to(data)}: unexpected file" for path in strays]
    size = sum(path.stat().st_size for path in there)
    print(f"{len(there)} files, {size / 1e6:.1f} MB")
    for column in ("platform", "versions", "commit"):
        counts = Counter(str(row[column]) for row in details)
        for value, count in sorted(counts.items()):
            print(f"{column}: {value} ({count} runs)")
    problems += _differences(details)
    for problem in problems:
        print(f"damaged: {problem}")
    return 1 if problems else 0


def _differences(details: Sequence[dict[str, str]]) -> Iterator[str]:
    """Yield differences that runs must not have."""
    for row in details:
        if (count := len(row["platform"].split())) != 1:
            name = stem(row["experiment"], int(row["run"]))
            yield f"runs/{name}.parquet: must have one platform, got {count}"
    for experiment in sorted({row["experiment"] for row in details}):
        mine = [row for row in details if row["experiment"] == experiment]
        if len({_with_defaults(row["document"]) for row in mine}) > 1:
            yield f"runs: settings of {experiment} differ"


def _with_defaults(document: str) -> str:
    """Return an experiment with the defaults of settings that are newer than it."""
    return experiment_text(experiment_from_text(document))


def _ranges(numbers: Sequence[int]) -> str:
    """Return ascending numbers as text, such as ``0-3, 7``."""
    found: list[list[int]] = []
    for number in numbers:
        if found and found[-1][-1] == number - 1:
            found[-1].append(number)
        else:
            found.append([number])
    ends = (dict.fromkeys((each[0], each[-1])) for each in found)
    return ", ".join("-".join(map(str, each)) for each in ends)
