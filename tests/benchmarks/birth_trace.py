"""Count the source files that are executed for every birth, over all processes.

Run as ``python tests/benchmarks/birth_trace.py [--json] [--pairs] [--tree FOLDER]``; it
takes about a minute. Two small runs are traced, one off-line and one on-line, each with
a coordinator, an analyzer and one worker. The figures of each run:

- **files**: source files of the project with a function that is called at every birth;
- **pairs**: (calling file, called file), two different files of the project, where the
  first calls a function of the second at every birth.

**Files** are Python files below ``schema``, ``coordinator``, ``worker``, ``analyzer``,
``analysis`` or ``revolve``, except generated Protobuf code (``*_pb2.py``) and tests.

**Calls** enter a Python function, method, property or generator. Bodies of modules and
classes do not count, so imports are excluded. The calling file is the innermost project
file on the stack: frames of libraries in between are skipped. A message between two
processes is not a call. A network callback and the entry of a thread have no caller:
the called file counts, without a pair. A result from a cache enters no function.

**A birth** is the time from its parent selection to the next one. This span contains
one complete path: mating, vetting, evaluation or insertion and advances, journal, rows.
Off-line a brood has one child (15+1), so one birth is in flight and every birth
includes survivor selection. On-line the span contains three advances and three fitness
samples; the intervals are those of scenario 3 divided by five. The key of a random
stream identifies the birth: the ``spawn_key`` (run, island, birth, attempt, purpose) of
NumPy's ``SeedSequence``. These numbers are part of the meaning of a seed and cannot
change.

**Every birth** means at least 90 % of the births 40 to 64, each of which must have a
row in the births table. This excludes rarer events: rare mutations, a cull every second
birth, snapshots, rows that are written later. Two measures make the figures independent
of the machine's speed. First, the coordinator's wall clock (``time.monotonic``, as read
by the project) runs a thousand times slower after the first mating, so periodic tasks
(progress, maintenance, status) do not run during these births. Second, a span includes
the calls of other processes in the 5 ms after its end, because an agent still cleans up
after it has sent its answer. All work in each turn of the coordinator's main loop
counts.

The trace uses no module or function name of the project, only the command line and the
tables. The figures of two trees are therefore comparable for any layout of their files.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pyarrow.parquet import ParquetFile

HERE = Path(__file__).resolve()
PROBE = HERE.with_name("birth_probe.py")
SEED = 1
BIRTHS = 70
FIRST = 40
COUNTED = 25
SHARE = 0.9
AFTER_US = 5_000
PROCESSES = 3
PATIENCE_S = 900.0

OFF_LINE = f"""
name = "off-line"
births = {BIRTHS}
[selection]
children = 1
[simulation]
window_steps = 480
"""
ON_LINE = f"""
name = "on-line"
births = {BIRTHS}
[simulation]
warmup_steps = 120
window_steps = 480
[arena]
founder_interval_s = 1.0
birth_interval_s = 3.0
cull_interval_s = 6.0
sample_interval_s = 1.0
snapshot_interval_s = 20.0
population_limit = 30
population_floor = 8
"""
DOCUMENTS = {"off-line": OFF_LINE, "on-line": ON_LINE}

Call = tuple[str, str]
"""Calling and called file; the first is empty if no project file calls."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Records of one process.

    Attributes:
        files: file names by number.
        marks: island, birth and time [us] of each parent selection.
        times: time of each call, ascending within a thread [us].
        calls: number of the calling file times 2^bits plus number of the called file.
        bits: width of a file number.
    """

    files: list[str]
    marks: list[tuple[int, int, int]]
    times: npt.NDArray[np.uint64]
    calls: npt.NDArray[np.uint64]
    bits: int

    @classmethod
    def read(cls, path: Path) -> "Trace":
        """Read a file that ``birth_probe.py`` wrote."""
        head, _, records = path.read_bytes().partition(b"\n")
        entries = json.loads(head)
        bits = entries["bits"]
        numbers = np.frombuffer(records, np.uint64)
        calls = numbers & np.uint64((1 << 2 * bits) - 1)
        times = numbers >> np.uint64(2 * bits)
        return cls(entries["files"], entries["marks"], times, calls, bits)

    def between(self, begin_us: int, end_us: int) -> set[Call]:
        """Return the distinct calls of a time span."""
        inside = (self.times >= np.uint64(begin_us)) & (self.times < np.uint64(end_us))
        found = np.unique(self.calls[inside]).tolist()
        return {
            (self.files[call >> self.bits], self.files[call & ((1 << self.bits) - 1)])
            for call in found
        }


@dataclass(frozen=True, slots=True)
class BirthPath:
    """Files and calls of every birth of a run.

    Attributes:
        births: number of counted births.
        files: source files, sorted.
        pairs: calling and called files, sorted.
        rare: number of births of each pair that does not occur at every birth.
    """

    births: int
    files: list[str]
    pairs: list[Call]
    rare: dict[Call, int]


def trace(name: str, tree: Path, folder: Path) -> tuple[list[Trace], set[int]]:
    """Run an experiment; return the traces and the births of its table.

    Args:
        name: key of ``DOCUMENTS``.
        tree: root of the code to run.
        folder: empty folder.
    """
    hook, notes = folder / "hook", folder / "notes"
    hook.mkdir()
    notes.mkdir()
    shutil.copy(PROBE, hook / "sitecustomize.py")
    (folder / "experiment.toml").write_text(DOCUMENTS[name])
    words = ("experiment.toml", "--seed", str(SEED), "--out", "run", "--quiet")
    flags = ("--workers", "1", "--threads", "1")
    done = subprocess.run(
        [sys.executable, "-m", "revolve", "run", *words, *flags],
        cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(hook), str(tree)]),
            "BIRTH_TRACE_ROOT": str(tree),
            "BIRTH_TRACE_FOLDER": str(notes),
            "BIRTH_TRACE_BEGIN_US": str(time.monotonic_ns() // 1000),
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    if done.returncode:
        sys.exit(f"{name}: the run ended with {done.returncode}\n{done.stderr}")
    (table,) = (folder / "run" / "tables").glob("*/*/births.parquet")
    born = ParquetFile(table).read(["birth"])["birth"].to_pylist()
    return [Trace.read(path) for path in sorted(notes.glob("*.trace"))], set(born)


def spans(traces: Iterable[Trace], born: set[int]) -> list[tuple[int, int]]:
    """Return begin and end of each counted birth [us]."""
    begins: dict[int, int] = {}
    for _, birth, time_us in sorted(mark for each in traces for mark in each.marks):
        begins.setdefault(birth, time_us)
    births = sorted(begins)
    found = [
        (begins[birth], begins[following])
        for birth, following in pairwise(births)
        if FIRST <= birth < FIRST + COUNTED and birth in born
    ]
    if len(found) != COUNTED:
        sys.exit(f"expected {COUNTED} births from {FIRST} on, got {len(found)}")
    return found


def birth_path(traces: list[Trace], born: set[int]) -> BirthPath:
    """Return the files and calls of every birth."""
    at_births = Counter[Call]()
    entered = Counter[str]()
    active: set[int] = set()
    found = spans(traces, born)
    for begin_us, end_us in found:
        calls: set[Call] = set()
        for number, each in enumerate(traces):
            late_us = 0 if each.marks else AFTER_US
            inside = each.between(begin_us, end_us + late_us)
            active |= {number} if inside else set()
            calls |= inside
        entered.update({called for _, called in calls})
        at_births.update(call for call in calls if call[0] not in ("", call[1]))
    if len(active) != PROCESSES:
        sys.exit(f"expected {PROCESSES} processes, got {len(active)}")
    least = SHARE * len(found)
    return BirthPath(
        births=len(found),
        files=sorted(file for file, count in entered.items() if count >= least),
        pairs=sorted(pair for pair, count in at_births.items() if count >= least),
        rare={
            pair: count for pair, count in sorted(at_births.items()) if count < least
        },
    )


def lines(name: str, found: BirthPath, *, with_pairs: bool) -> Iterator[str]:
    """Yield the lines to print for a run."""
    yield f"{name}: {len(found.files)} files, {len(found.pairs)} pairs of files"
    if with_pairs:
        yield from (f"  {file}" for file in found.files)
        yield from (f"  {caller} -> {called}" for caller, called in found.pairs)
        yield "  not at every birth:"
        yield from (
            f"  {caller} -> {called}: {count} of {found.births}"
            for (caller, called), count in found.rare.items()
        )


def main() -> None:
    """Trace both runs and print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--pairs", action="store_true", help="print the files and pairs, too"
    )
    parser.add_argument(
        "--tree", type=Path, default=HERE.parents[2], help="root of the code to trace"
    )
    options = parser.parse_args()
    found: dict[str, BirthPath] = {}
    for name in DOCUMENTS:
        with tempfile.TemporaryDirectory() as folder:
            found[name] = birth_path(*trace(name, options.tree.resolve(), Path(folder)))
        if not options.json:
            print(*lines(name, found[name], with_pairs=options.pairs), sep="\n")
    if options.json:
        print(json.dumps({name: as_json(each) for name, each in found.items()}))


def as_json(found: BirthPath) -> dict[str, object]:
    """Return the figures and the counted files and pairs for JSON."""
    return {
        "births": found.births,
        "files": len(found.files),
        "pairs": len(found.pairs),
        "file_names": found.files,
        "pair_names": found.pairs,
        "rare_pairs": [[*pair, count] for pair, count in found.rare.items()],
    }


if __name__ == "__main__":
    main()
