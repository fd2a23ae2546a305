"""Runs the campaign of docs/results.md, keeps its rows in docs/data, checks them.

    python docs/campaign.py run runs/results
    python docs/campaign.py collect runs/results
    python docs/campaign.py check

``docs/data/README.md`` describes the rows.
"""

import argparse
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.outcomes import outcome
from analysis.measures.load import Run, read_runs
from analysis.measures.study import measure_run, reach
from docs.campaign_data import (
    DATA,
    PARTS,
    TABLES,
    Part,
    check,
    parquet,
    path_of,
    replace,
    stem,
    troubles_of,
)
from schema.errors import RevolveError, RunFolderError
from schema.tables.files import read_table

ROOT = Path(__file__).resolve().parents[1]
COMMIT = "commit"
"""File of a campaign's folder: the commit of the code that began it."""

MARKS = (600,)
"""Births at which outcomes are kept besides the last."""
SPACING = 15
"""Births between the populations that are kept: the brood of the thesis."""

_PLATFORMS = (
    ("runs", "platform"),
    ("evaluations", "platform"),
    ("drifts", "before"),
    ("drifts", "after"),
)
"""Where the tables of a run say which platform computed."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the three commands.

    Returns:
        0 if done; 1 if something could not be collected or is damaged; else what
        ``revolve`` returned.
    """
    options = _parser().parse_args(arguments)
    if options.command == "run":
        parts = [part for part in PARTS if options.only in {None, part.option}]
        return run(options.folder, parts, options.workers)
    if options.command == "collect":
        return collect(options.folder, options.data, options.commit)
    return check(options.data)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run", help="make or resume the campaign")
    collecting = commands.add_parser("collect", help="keep rows of finished repeats")
    checking = commands.add_parser(
        "check", help="show what is kept and what is damaged"
    )
    for command in (running, collecting):
        command.add_argument("folder", type=Path, help="of the campaign")
    for command in (collecting, checking):
        command.add_argument(
            "--data", type=Path, default=DATA, help="default: docs/data"
        )
    running.add_argument("--only", choices=[part.option for part in PARTS])
    running.add_argument("--workers", type=int, help="default: one per core")
    collecting.add_argument(
        "--commit", help="of the code that made the runs, if FOLDER does not say"
    )
    return parser


def run(folder: Path, parts: Sequence[Part], workers: int | None) -> int:
    """Make or resume parts of the campaign with ``revolve run`` and ``revolve resume``.

    Args:
        folder: of the campaign.
        parts: one after the other.
        workers: processes; None is one per core.

    Returns:
        0 if all runs are finished, else the code of the first command that failed.
    """
    _note_commit(folder)
    for part in parts:
        out = folder.resolve() / "runs" / part.folder
        if (out / "campaign.toml").exists():
            words = ["resume", str(out)]
        else:
            words = ["run", *part.experiments, "--seed", str(part.seed)]
            words += ["--repeats", str(part.repeats), "--births", str(part.births)]
            words += ["--out", str(out)]
        if workers is not None:
            words += ["--workers", str(workers)]
        print(f"revolve {' '.join(words)}", flush=True)
        if code := _revolve(words):
            return code
    return 0


def _revolve(words: Sequence[str]) -> int:
    """Run the command of this clone to its end, and return its exit code."""
    process = subprocess.Popen([sys.executable, "-m", "revolve", *words], cwd=ROOT)
    before = signal.signal(signal.SIGTERM, lambda *_: process.terminate())
    try:
        while True:
            try:
                return process.wait()
            except KeyboardInterrupt:  # the command was told, too, and ends by itself
                continue
    finally:
        signal.signal(signal.SIGTERM, before)


def _note_commit(folder: Path) -> None:
    """Write which commit begins a campaign; warn if another one resumes it."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        return
    words = ["describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    done = subprocess.run(
        [git, "-C", str(ROOT), *words], capture_output=True, text=True, check=False
    )
    ours, known = done.stdout.strip(), _commit_of(folder)
    if ours and known is None and not (folder / "runs").exists():
        folder.mkdir(parents=True, exist_ok=True)
        replace(folder / COMMIT, f"{ours}\n".encode())
    elif ours and known not in {None, ours}:
        print(f"{folder}: was begun at commit {known} and is resumed at {ours}")


def _commit_of(folder: Path) -> str | None:
    """Return the commit that a campaign was begun at, None if it is unknown."""
    try:
        return (folder / COMMIT).read_text(encoding="utf-8").strip() or None
    except FileNotFoundError:
        return None


def collect(
    folder: Path,
    data: Path,
    commit: str | None = None,
    parts: Sequence[Part] = PARTS,
) -> int:
    """Write the rows of all finished repeats that are not kept yet.

    Args:
        folder: of the campaign; nothing in it is written.
        data: where rows are kept.
        commit: of the code that made the runs; None takes what the folder says.
        parts: of the campaign.

    Returns:
        0, or 1 if a finished repeat could not be measured in full.
    """
    commit = commit or _commit_of(folder)
    new = failed = 0
    for part in parts:
        for one in _finished(folder / "runs" / part.folder, part):
            name = stem(one.experiment, one.number)
            if not list(troubles_of(data, part, name)):
                continue
            begin = time.monotonic()
            try:
                tables = measured_rows(one, commit)
            except RevolveError as error:
                print(f"{name}: {error}", flush=True)
                failed += 1
                continue
            for table, rows in tables.items():
                replace(path_of(data, table, name), parquet(rows))
            size = sum(path_of(data, table, name).stat().st_size for table in tables)
            took_s = time.monotonic() - begin
            print(f"{name}: {size / 1000:.0f} kB, {took_s:.1f} s", flush=True)
            new += 1
    said = "" if commit else "; commit unknown: name it with --commit"
    print(f"{new} repeats collected, {failed} failed{said if new else ''}")
    return 1 if failed else 0


def _finished(root: Path, part: Part) -> list[Run]:
    """Return the finished runs of a part of the campaign; name those of no part."""
    try:
        runs, left_out = read_runs([root])
    except RevolveError as error:
        print(error)
        return []
    for lost in left_out:
        print(f"{lost.folder}: {lost.why}")
    found = []
    for one in runs:
        births = [island.births for island in one.islands]
        is_ours = one.experiment in part.names and one.number < part.repeats
        if not is_ours or one.seed != part.seed or births != [part.births]:
            print(f"{one.folder}: is no run of the campaign")
        elif one.is_finished:
            found.append(one)
    return found


def measured_rows(one: Run, commit: str | None) -> dict[str, pa.Table]:
    """Return the rows of a finished run by table, in the order of ``TABLES``.

    Raises:
        RunFolderError: a table of the run cannot be read or measured.
    """
    measured = measure_run(one, "parent")
    # Arenas of the thesis do not record touches.
    incomplete = [each for each in measured.left_out if each.what != "interactions"]
    if incomplete:
        raise RunFolderError(f"{incomplete[0].what}: {incomplete[0].why}")
    last = reach(measured)
    marks = sorted({last, *(births for births in MARKS if births < last)})
    outcomes = [outcome(measured.tables, births) for births in marks]
    births = read_table(one.folder, "births")
    found = {
        **measured.tables,
        "outcomes": pa.Table.from_pylist(outcomes),
        "populations": _thinned(measured.tables["populations"]),
        "final": _final(measured.tables["robots"], births),
        "runs": _details(one, commit, births.num_rows),
    }
    return {name: _kept(found[name], name, one) for name in TABLES if name in found}


def _thinned(populations: pa.Table) -> pa.Table:
    """Return every population after a multiple of ``SPACING`` births, and the last."""
    births = np.asarray(populations["births"], np.int64)
    return populations.filter(
        pa.array((births % SPACING == 0) | (births == births[-1]))
    )


def _final(robots: pa.Table, births: pa.Table) -> pa.Table:
    """Return the last population: its robots with parents and genomes."""
    rows = robots.filter(robots["is_last"])
    born = births.take(pc.index_in(rows["birth"], births["birth"].combine_chunks()))
    parents = [
        [parent["birth"] for parent in couple] for couple in born["parents"].to_pylist()
    ]
    rows = rows.append_column("parents", pa.array(parents, pa.list_(pa.int64())))
    return rows.append_column("genome", born["genome"])


def _details(one: Run, commit: str | None, births: int) -> pa.Table:
    """Return what was run, on which platform, by which code."""
    platforms: set[str] = set()
    for table, column in _PLATFORMS:
        platforms.update(read_table(one.folder, table)[column].to_pylist())
    runs = read_table(one.folder, "runs")
    if not runs.num_rows:
        raise RunFolderError(f"{one.folder}: the table runs has no row")
    row = {
        "seed": one.seed,
        "births": births,
        "state": one.state,
        "platform": " ".join(sorted(platforms)),
        "versions": runs["versions"][0].as_py(),
        "commit": commit,
        "document": one.document,
    }
    return pa.Table.from_pylist([row], TABLES["runs"])


def _kept(table: pa.Table, name: str, one: Run) -> pa.Table:
    """Return a table with the columns that are kept, NaN as null."""
    columns = {"experiment": one.experiment, "run": one.number}
    arrays = []
    for field in TABLES[name]:
        if field.name in columns:
            value = pa.scalar(columns[field.name], field.type)
            arrays.append(pa.repeat(value, table.num_rows))
            continue
        array = table[field.name].combine_chunks()
        if pa.types.is_floating(array.type):
            array = pc.if_else(pc.is_nan(array), None, array)
        arrays.append(array.cast(field.type))
    return pa.Table.from_arrays(arrays, schema=TABLES[name])


if __name__ == "__main__":
    sys.exit(main())
