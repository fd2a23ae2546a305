"""Count the source files that a birth passes through, over all processes.

Run as ``python tests/benchmarks/birth_trace.py [--json] [--pairs] [--tree FOLDER]``; it
takes about a minute. Two small runs are traced, one off-line and one on-line, each with
a coordinator, an analyzer and one worker. The figures of each:

- **files**: project files with a function that is called at every birth;
- **pairs**: (calling file, called file), two different project files, where the first
  calls a function of the second at every birth.

**Project file:** a Python file below ``schema``, ``coordinator``, ``worker``,
``analyzer``, ``analysis`` or ``revolve``. Code that the Protobuf compiler wrote
(``*_pb2.py``) and tests do not count. **Call:** a Python function, method,
property or generator is entered; bodies of modules and classes do not count, so imports
are left out. The calling file is the innermost project file on the stack: frames of
libraries between two project files are skipped. A message between two processes is no
call, and a callback of the network or the entry of a thread has no caller: the called
file counts, and there is no pair. A call that a cache answers enters no function.

**Birth:** the time from one birth's choice of parents to the next one's. This
span holds one whole path: mating, vetting, evaluation or insertion and advances,
journal, rows. Off-line a brood is one child (15+1), so that one birth is in flight and
the selection of survivors belongs to every birth. On-line the span goes from one
decision to mate to the next, with three advances and three samples of fitness; the
intervals are those of scenario 3 divided by five. Births are recognised by the name of
their random stream, the ``spawn_key`` (run, island, birth, attempt, purpose) that is
given to NumPy's ``SeedSequence``: these numbers are part of what a seed means and
cannot change.

**Every birth:** at least 90 % of the births from number 40 to 64, each of which
must have a row in the births table. Rarer events are left out: rare mutations, a cull
every second birth, snapshots, rows that wait for others before they are written. Two
measures keep the figures independent of the machine's speed. The coordinator's wall
clock (``time.monotonic``, as the project reads it) runs a thousand times slower once
parents mate, so what is done every so many seconds (progress, chores, status) is not
done during these births. And a span includes what other processes do in the 5 ms after
its end: an agent that has sent its answer still tidies up while the coordinator goes
on. What the coordinator does at every turn of its main loop counts.

No name of a project module or function is used, only the command line and the tables:
the figures of two trees can be compared, however their files are laid out.
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
"""Calling and called file; the first is empty where no project file calls."""


@dataclass(frozen=True, slots=True)
class Trace:
    """What one process noted.

    Attributes:
        files: names by number.
        marks: island, birth and time of each choice of parents [us].
        times: of each call, ascending but for threads [us].
        calls: number of the calling file times 2^bits, plus that of the called one.
        bits: of a file's number.
    """

    files: list[str]
    marks: list[tuple[int, int, int]]
    times: npt.NDArray[np.uint64]
    calls: npt.NDArray[np.uint64]
    bits: int

    @classmethod
    def read(cls, path: Path) -> "Trace":
        """Return what ``birth_probe.py`` wrote."""
        head, _, notes = path.read_bytes().partition(b"\n")
        entries = json.loads(head)
        bits = entries["bits"]
        numbers = np.frombuffer(notes, np.uint64)
        calls = numbers & np.uint64((1 << 2 * bits) - 1)
        times = numbers >> np.uint64(2 * bits)
        return cls(entries["files"], entries["marks"], times, calls, bits)

    def between(self, begin_us: int, end_us: int) -> set[Call]:
        """Return the distinct calls of a span of time."""
        inside = (self.times >= np.uint64(begin_us)) & (self.times < np.uint64(end_us))
        found = np.unique(self.calls[inside]).tolist()
        return {
            (self.files[call >> self.bits], self.files[call & ((1 << self.bits) - 1)])
            for call in found
        }


@dataclass(frozen=True, slots=True)
class Passage:
    """What every birth of a run passes through.

    Attributes:
        births: that were counted.
        files: source files, sorted.
        pairs: of calling and called file, sorted.
        rare: pairs that occur at some of the births only, with their number.
    """

    births: int
    files: list[str]
    pairs: list[Call]
    rare: dict[Call, int]


def trace(name: str, tree: Path, place: Path) -> tuple[list[Trace], set[int]]:
    """Run an experiment; return the traces, and the births of its table.

    Args:
        name: a key of ``DOCUMENTS``.
        tree: root of the code that runs.
        place: an empty folder.
    """
    hook, notes = place / "hook", place / "notes"
    hook.mkdir()
    notes.mkdir()
    shutil.copy(PROBE, hook / "sitecustomize.py")
    (place / "experiment.toml").write_text(DOCUMENTS[name])
    words = ("experiment.toml", "--seed", str(SEED), "--out", "run", "--quiet")
    flags = ("--workers", "1", "--threads", "1")
    done = subprocess.run(
        [sys.executable, "-m", "revolve", "run", *words, *flags],
        cwd=place,
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
    (table,) = (place / "run" / "tables").glob("*/*/births.parquet")
    born = ParquetFile(table).read(["birth"])["birth"].to_pylist()
    return [Trace.read(path) for path in sorted(notes.glob("*.trace"))], set(born)


def spans(traces: Iterable[Trace], born: set[int]) -> list[tuple[int, int]]:
    """Return begin and end of each birth that counts [us]."""
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


def passage(traces: list[Trace], born: set[int]) -> Passage:
    """Return what every birth passes through."""
    at_births = Counter[Call]()
    entered = Counter[str]()
    taking_part: set[int] = set()
    found = spans(traces, born)
    for begin_us, end_us in found:
        calls: set[Call] = set()
        for number, each in enumerate(traces):
            late_us = 0 if each.marks else AFTER_US
            inside = each.between(begin_us, end_us + late_us)
            taking_part |= {number} if inside else set()
            calls |= inside
        entered.update({called for _, called in calls})
        at_births.update(call for call in calls if call[0] not in ("", call[1]))
    if len(taking_part) != PROCESSES:
        sys.exit(f"expected {PROCESSES} processes, got {len(taking_part)}")
    least = SHARE * len(found)
    return Passage(
        births=len(found),
        files=sorted(file for file, count in entered.items() if count >= least),
        pairs=sorted(pair for pair, count in at_births.items() if count >= least),
        rare={
            pair: count for pair, count in sorted(at_births.items()) if count < least
        },
    )


def lines(name: str, found: Passage, *, with_pairs: bool) -> Iterator[str]:
    """Yield what is printed of a run."""
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
    found: dict[str, Passage] = {}
    for name in DOCUMENTS:
        with tempfile.TemporaryDirectory() as place:
            found[name] = passage(*trace(name, options.tree.resolve(), Path(place)))
        if not options.json:
            print(*lines(name, found[name], with_pairs=options.pairs), sep="\n")
    if options.json:
        print(json.dumps({name: as_json(each) for name, each in found.items()}))


def as_json(found: Passage) -> dict[str, object]:
    """Return the figures, and what was counted, for JSON."""
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
