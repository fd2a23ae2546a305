"""Hand-made rows of tables, and what writes and checks them."""

from pathlib import Path
from typing import Any

import pyarrow as pa

from coordinator.islands.events import Record
from coordinator.islands.rows import origin_columns
from coordinator.storage.folder import RunFolder
from coordinator.storage.recorder import Recorder
from schema.tables.columns import TABLES
from schema.tables.description import RunDetails
from schema.tables.files import read_table

DETAILS = RunDetails("a/b c", 2, 1, "{}")

PART = {
    "idx": 0,
    "parent": -1,
    "parent_slot": -1,
    "child_slot": -1,
    "kind": "Core",
    "rot": 0,
    "params": [0.5, 0.25, 1 / 3],
    "gene": 2**64 - 1,
}


def birth_row(number: int) -> dict[str, Any]:
    """Return a births row; founders up to 3, then two parents each."""
    parents = [] if number < 3 else [number - 3, number - 2]
    counts = ("parts", "joints", "motors", "extremities", "inputs", "outputs")
    return {
        "island": 0,
        "birth": number,
        "parents": [{"island": 0, "birth": parent} for parent in parents],
        "generation": None if number % 5 == 4 else number // 3,
        "rank": 1 + number // 3,
        "attempts": 1,
        "genome": bytes([number % 256]) * (number % 7),
        "body": [{**PART, "idx": index} for index in range(1 + number % 4)],
        **dict.fromkeys(counts, number % 4),
        "hidden": 0,
        "connections": 3,
        **dict.fromkeys(("sim_time_s", "x", "y", "robot")),
        **origin_columns(None),
    }


def evaluation_row(number: int, worker: str, platform: str) -> dict[str, Any]:
    """Return an evaluations row; every seventh failed."""
    is_failed = number % 7 == 6
    value = None if is_failed else number / 3
    return {
        "island": 0,
        "birth_island": None,
        "birth": number,
        "trial": 0,
        "status": "failed" if is_failed else "ok",
        "reason": "diverged" if is_failed else "",
        "fitness": value,
        "path_velocity": value,
        "straight_velocity": value,
        "simulated_s": 12.0,
        "wall_s": 0.5,
        "worker": worker,
        "platform": platform,
        "measures": None if is_failed else [("height", value), ("turning", 0.5)],
        "point": None,
    }


def make_records(
    count: int, worker: str = "worker-1", platform: str = "linux-x86"
) -> list[Record]:
    """Return the rows of ``count`` births with a population after every third."""
    rows: list[Record] = []
    for number in range(count):
        rows.append(Record("births", birth_row(number)))
        rows.append(Record("evaluations", evaluation_row(number, worker, platform)))
        if number % 3 == 2:
            level = {"island": 0, "births": number + 1, "birth_island": None}
            rows.extend(
                Record("population", {**level, "birth": birth, "fitness": 0.5})
                for birth in range(number - 2, number + 1)
            )
    return rows


def write_run(
    path: Path,
    rows: list[Record],
    details: RunDetails = DETAILS,
    *,
    is_finished: bool = True,
) -> Path:
    """Write the folder of a run; return it."""
    with RunFolder(path, details) as held:
        recorder = Recorder(path, details, seal=held.seal)
        for record in rows:
            recorder.write(record)
        if is_finished:
            recorder.finish()
            held.set_state("finished")
        else:
            recorder.flush()
            recorder.close()
    return path


def feed_rows(folder: Path, rows: list[Record], every: int = 10) -> Recorder:
    """Return a recorder after it has recorded rows, with regular flushes."""
    recorder = Recorder(folder, DETAILS)
    for index, record in enumerate(rows, start=1):
        recorder.write(record)
        if index % every == 0:
            recorder.flush()
    return recorder


def expected(rows: list[Record], table: str) -> pa.Table:
    """Return the expected content of a table."""
    own = [record.row for record in rows if record.table == table]
    numbered = [{"record": index, **row} for index, row in enumerate(own)]
    return pa.Table.from_pylist(numbered, TABLES[table])


def check_complete(folder: Path, rows: list[Record]) -> None:
    """Fail unless every table holds exactly these rows."""
    for name in TABLES:
        found = read_table(folder, name)
        assert found.equals(expected(rows, name), check_metadata=True), name
