"""Hand-made table rows for the tests of what is written and read back."""

from collections.abc import Callable
from typing import Any

import pytest

from coordinator.events import Record

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
    }


def evaluation_row(number: int, worker: str, platform: str) -> dict[str, Any]:
    """Return an evaluations row; every seventh failed."""
    is_failed = number % 7 == 6
    value = None if is_failed else number / 3
    return {
        "island": 0,
        "birth": number,
        "status": "failed" if is_failed else "ok",
        "reason": "diverged" if is_failed else "",
        "fitness": value,
        "path_velocity": value,
        "straight_velocity": value,
        "simulated_s": 12.0,
        "wall_s": 0.5,
        "worker": worker,
        "platform": platform,
    }


def records(
    count: int, worker: str = "worker-1", platform: str = "linux-x86"
) -> list[Record]:
    """Return the rows of ``count`` births with a population after every third."""
    rows: list[Record] = []
    for number in range(count):
        rows.append(Record("births", birth_row(number)))
        rows.append(Record("evaluations", evaluation_row(number, worker, platform)))
        if number % 3 == 2:
            rows.extend(
                Record(
                    "population",
                    {"island": 0, "births": number + 1, "birth": each, "fitness": 0.5},
                )
                for each in range(number - 2, number + 1)
            )
    return rows


@pytest.fixture
def make_records() -> Callable[..., list[Record]]:
    """Return a function (births, worker, platform) -> all rows of a run."""
    return records
