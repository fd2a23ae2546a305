"""Runs the campaign of docs/results.md; collects its rows in docs/data; checks them.

    python -m docs.studies.thesis.campaign run runs/results
    python -m docs.studies.thesis.campaign collect runs/results
    python -m docs.studies.thesis.campaign check

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

from analysis.measures.load import LoadedRun, read_runs
from docs.studies.pages import ROOT
from docs.studies.thesis.check import check, problems_of
from docs.studies.thesis.data import (
    DATA,
    PARTS,
    Part,
    parquet,
    path_of,
    replace,
    stem,
)
from docs.studies.thesis.rows import measured_rows
from schema.errors import RevolveError

COMMIT = "commit"
"""File in a campaign's folder with the commit of the code that started it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the three commands.

    Returns:
        0; 1 if a repeat could not be collected or a file is damaged; or the exit code
        of ``revolve``.
    """
    options = _parser().parse_args(arguments)
    if options.command == "run":
        parts = [part for part in PARTS if options.only in {None, part.option}]
        return run(options.folder, parts, options.workers, options.data)
    if options.command == "collect":
        return collect(options.folder, options.data, options.commit)
    return check(options.data)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run", help="start or resume the campaign")
    collecting = commands.add_parser("collect", help="write rows of finished repeats")
    checking = commands.add_parser("check", help="list kept, missing and damaged files")
    for command in (running, collecting):
        command.add_argument("folder", type=Path, help="folder of the campaign")
    for command in (running, collecting, checking):
        command.add_argument(
            "--data",
            type=Path,
            default=DATA,
            help="rows (default: docs/data)",
        )
    running.add_argument("--only", choices=[part.option for part in PARTS])
    running.add_argument("--workers", type=int, help="processes (default: cores)")
    collecting.add_argument(
        "--commit", help="commit of the runs, if the folder does not name it"
    )
    return parser


def run(
    folder: Path, parts: Sequence[Part], workers: int | None, data: Path = DATA
) -> int:
    """Start or resume parts of the campaign with ``revolve run`` or ``resume``.

    Repeats are made in batches, one after the other, each in a folder of its own. A
    new batch begins with its first repeat that has no rows.

    Args:
        folder: folder of the campaign.
        parts: parts of the campaign; their experiments are run one after the other.
        workers: number of processes; None is one per core.
        data: folder of the rows that are kept.

    Returns:
        0 if all runs are finished, else the exit code of the command that failed.
    """
    _note_commit(folder)
    wanted = [(part, each) for part in parts for each in part.experiments]
    for part, experiment in wanted:
        for start in range(0, part.repeats, part.batch):
            words = _batch(folder, data, part, experiment, start)
            if words is None:
                continue
            if workers is not None:
                words += ["--workers", str(workers)]
            print(f"revolve {' '.join(words)}", flush=True)
            if code := _revolve(words):
                return code
    return 0


def _batch(
    folder: Path, data: Path, part: Part, experiment: str, start: int
) -> list[str] | None:
    """Return the command that starts or resumes a batch; None if all rows are kept."""
    name = Path(experiment).stem
    first, end = start, min(start + part.batch, part.repeats)
    while not any(problems_of(data, part, stem(name, first))):
        first += 1
        if first == end:
            return None
    out = folder.resolve() / "runs" / part.folder / stem(name, start)
    if (out / "campaign.toml").exists():
        return ["resume", str(out)]
    words = ["run", experiment, "--seed", str(part.seed), "--births", str(part.births)]
    words += ["--first-repeat", str(first)] if first else []
    return [*words, "--repeats", str(end - first), "--out", str(out)]


def _revolve(words: Sequence[str]) -> int:
    """Run the command of this clone, and return its exit code."""
    process = subprocess.Popen([sys.executable, "-m", "revolve", *words], cwd=ROOT)
    before = signal.signal(signal.SIGTERM, lambda *_: process.terminate())
    try:
        while True:
            try:
                return process.wait()
            except KeyboardInterrupt:  # the command received it, too, and ends
                continue
    finally:
        signal.signal(signal.SIGTERM, before)


def _note_commit(folder: Path) -> None:
    """Write the commit that starts a campaign; warn if another one resumes it."""
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
        print(f"{folder}: started at commit {known}, resumed at {ours}")


def _commit_of(folder: Path) -> str | None:
    """Return the commit that started a campaign; None if it is unknown."""
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
        folder: folder of the campaign, which is only read.
        data: folder of the rows.
        commit: commit of the runs; None reads it from the folder.
        parts: parts of the campaign.

    Returns:
        0, or 1 if a finished repeat could not be measured in full.
    """
    commit = commit or _commit_of(folder)
    new = failed = 0
    for part in parts:
        for one in _finished(folder / "runs" / part.folder, part):
            name = stem(one.experiment, one.number)
            if not list(problems_of(data, part, name)):
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
    hint = "; commit unknown, set it with --commit" if new and not commit else ""
    print(f"{new} repeats collected, {failed} failed{hint}")
    return 1 if failed else 0


def _finished(root: Path, part: Part) -> list[LoadedRun]:
    """Return the finished runs of a part of the campaign; print unexpected runs."""
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
            print(f"{one.folder}: not a run of the campaign")
        elif one.is_finished:
            found.append(one)
    return found


if __name__ == "__main__":
    sys.exit(main())
