"""Program that flips random bits in the tables of runs and reads them again.

Arguments: a number of flips, a seed and run folders. Each read is a fork of this
process, so that a crash is counted. Prints one line of JSON: how many reads gave the
rows that were there before ("same"), named the damage ("named"), gave anything else
without a word ("silent") or died ("crashed"), and what was flipped in the last two
cases.
"""

import json
import logging
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

from schema.errors import RunFolderError
from schema.tables.checksums import sound_messages, sums_path, sums_size
from schema.tables.columns import TABLES
from schema.tables.files import read_table

RESULTS = ("same", "named", "silent")
SUFFIXES = (".arrows", ".sums", ".parquet")


class _Words(logging.Handler):
    """Counter of warnings."""

    count = 0

    def emit(self, record: logging.LogRecord) -> None:
        self.count += record.levelno >= logging.WARNING


def truth_of(folder: Path) -> dict[str, pa.Table]:
    """Return all tables of a run."""
    return {name: read_table(folder, name) for name in TABLES}


def read_all(folder: Path, truth: dict[str, pa.Table]) -> str:
    """Read all tables of a run in every way; return a name of ``RESULTS``."""
    words = _Words()
    logging.getLogger().addHandler(words)
    is_silent = is_named = False
    for name, expected in truth.items():
        before = words.count
        found = _reading(folder, name)
        if found is not None:
            is_equal = found.equals(expected)
            # Rows before the damage may be shown, if it is named.
            is_part = found.equals(expected.slice(0, found.num_rows))
            is_told = words.count > before
            is_silent |= not (is_equal or (is_part and is_told))
        is_named |= found is None or words.count > before
    return "silent" if is_silent else "named" if is_named else "same"


def _reading(folder: Path, name: str) -> pa.Table | None:
    """Return a table; None if the reader refuses it."""
    try:
        return read_table(folder, name)
    except RunFolderError:
        return None


def read_apart(folder: Path, truth: dict[str, pa.Table]) -> str:
    """Do ``read_all`` in a child process; return a name of ``RESULTS`` or "crashed"."""
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        code = 99
        try:
            code = RESULTS.index(read_all(folder, truth))
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    return RESULTS[code] if 0 <= code < len(RESULTS) else "crashed"


def table_files(folder: Path) -> list[Path]:
    """Return all files of a run's tables that have bytes that count."""
    found = (path for path in sorted(folder.rglob("*")) if path.suffix in SUFFIXES)
    return [path for path in found if size_of(path)]


def size_of(path: Path) -> int:
    """Return how many bytes of an undamaged file count.

    What is behind them is a write that a kill cut: no reader looks at it.
    """
    if path.suffix == ".parquet":
        return path.stat().st_size
    segment = path.with_suffix(".arrows")
    ends = [end for end, _ in sound_messages(segment, sums_path(segment).read_bytes())]
    if path.suffix == ".sums":
        return min(sums_size(len(ends)), path.stat().st_size)
    return ends[-1] if ends else 0


def flip(path: Path, bit: int) -> None:
    """Flip a bit of a file."""
    with path.open("r+b") as file:
        file.seek(bit // 8)
        (byte,) = file.read(1)
        file.seek(bit // 8)
        file.write(bytes([byte ^ 1 << bit % 8]))


def flips(folders: list[Path], count: int, seed: int) -> Iterator[tuple[Path, int]]:
    """Yield random files of random runs, and a random bit of each."""
    rng = np.random.default_rng(seed)
    files = [table_files(folder) for folder in folders]
    for number in range(count):
        own = files[number % len(folders)]
        path = own[rng.integers(len(own))]
        yield path, int(rng.integers(8 * size_of(path)))


def main(count: int, seed: int, folders: list[Path]) -> None:
    """Flip bits and print the results."""
    pa.set_cpu_count(1)
    pa.set_io_thread_count(1)
    truths = {folder: truth_of(folder) for folder in folders}
    results = dict.fromkeys((*RESULTS, "crashed"), 0)
    bad = []
    for path, bit in flips(folders, count, seed):
        (folder,) = [each for each in folders if path.is_relative_to(each)]
        flip(path, bit)
        result = read_apart(folder, truths[folder])
        flip(path, bit)
        results[result] += 1
        if result in ("silent", "crashed"):
            bad.append(f"{result}: {path} bit {bit}")
    sys.stdout.write(json.dumps({**results, "bad": bad}) + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), [Path(word) for word in sys.argv[3:]])
