"""Decoders under random and mutated messages: one documented error, little memory."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

MOST_GROWTH_MB = 100.0
MOST_S = 5.0
"""CPU time of a message of at most some megabytes [s]."""


def decode(seed: int, messages: int) -> dict[str, Any]:
    """Decode messages in another process; return its report."""
    words = ("--seed", str(seed), "--messages", str(messages))
    done = subprocess.run(
        [sys.executable, "-m", "tests.hostile.decode", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-2000:]}"
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def check(report: dict[str, Any]) -> None:
    assert report["faults"] == []
    assert report["growth_mb"] <= MOST_GROWTH_MB
    assert report["slowest_s"][0] <= MOST_S, report["slowest_s"]
    # Most messages are refused, and some pass: both ways are tested.
    sent, refused = sum(report["sent"].values()), sum(report["refused"].values())
    assert 0.5 * sent < refused < sent == report["messages"]


@pytest.mark.slow
def test_20_000_messages_raise_only_documented_errors() -> None:
    check(decode(1, 20_000))


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_a_million_messages_raise_only_documented_errors() -> None:
    with ThreadPoolExecutor(2) as pool:
        for report in pool.map(decode, (11, 12), (500_000, 500_000)):
            sys.stdout.write(f"{json.dumps(report)}\n")
            check(report)
