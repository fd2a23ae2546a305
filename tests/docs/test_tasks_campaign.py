"""Checks of the table of docs/tasks.md and of its rows."""

import numpy as np
import pytest

from docs.tasks_campaign import (
    BIRTHS,
    PAGE,
    SEARCHED,
    SEARCHES,
    SEEDS,
    TASKS,
    difference,
    rows,
    table,
)
from schema.experiment.file import shipped_experiments


def row(search: str, seed: int, best: float) -> dict[str, str]:
    return {
        "task": "turning",
        "search": search,
        "seed": str(seed),
        "best": repr(best),
    }


def test_difference_of_medians_by_hand() -> None:
    change, low, high = difference(np.array([3.0, 5.0, 9.0]), np.array([1.0, 1.0, 1.0]))
    assert change == 4.0
    # A resample's median is below 5 in 7 of 27 cases, and above in as many.
    assert (low, high) == (2.0, 8.0)
    change, low, high = difference(np.array([2.0]), np.array([5.0]))
    assert (change, low, high) == (-3.0, -3.0, -3.0)


def test_only_seeds_of_both_searches_count() -> None:
    kept = [
        row("evolution", 1, 0.5),
        row("evolution", 2, 0.7),
        row("evolution", 3, 100.0),
        row("random", 1, 0.1),
        row("random", 2, 0.3),
    ]
    (_, _, line) = table(kept)
    assert line == (
        "| turning | 2 | 0.600 rad/s | 0.200 rad/s | +0.400 rad/s | too few seeds |"
    )
    kept += [row("random", 3, 0.3)]
    (_, _, line) = table(kept)
    start = "| turning | 3 | 0.700 rad/s | 0.300 rad/s | +0.400 rad/s | +0.200 to "
    assert line.startswith(start)


def test_each_task_is_a_shipped_experiment_and_has_a_section() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for task, (shipped, _) in TASKS.items():
        assert shipped in shipped_experiments()
        assert f"(#{task})" in text or f"(#{task}s)" in text
        assert f"(pictures/tasks/{task}.png)" in text


def test_kept_rows_are_of_the_campaign_and_in_the_table() -> None:
    kept = rows()
    if not kept:
        pytest.skip("no rows")
    keys = [(each["task"], each["search"], int(each["seed"])) for each in kept]
    assert len(set(keys)) == len(keys)
    for task, search, seed in keys:
        assert task in SEARCHED
        assert search in SEARCHES
        assert seed in SEEDS
    assert {int(each["births"]) for each in kept} == {BIRTHS}
    assert "\n".join(table(kept)) in PAGE.read_text(encoding="utf-8")
