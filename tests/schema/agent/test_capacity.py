"""Number of arenas that a process keeps."""

import os
from pathlib import Path

import pytest

from schema.agent.capacity import (
    MOST_SHARDS,
    SHARD_BYTES,
    memory_bytes,
    shards_that_fit,
)


@pytest.mark.parametrize(
    ("memory", "processes", "shards"),
    [
        (80 * SHARD_BYTES, 2, 20),
        (80 * SHARD_BYTES, 1, 40),
        (SHARD_BYTES, 1, 1),
        (0, 9, 1),
        (10**18, 1, MOST_SHARDS),
    ],
)
def test_half_of_the_memory_is_shared(memory: int, processes: int, shards: int) -> None:
    assert shards_that_fit(memory, processes) == shards


def test_memory_is_that_of_the_machine_or_of_its_container(tmp_path: Path) -> None:
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit = tmp_path / "memory.max"
    assert memory_bytes(limit) == machine
    for text, expected in (("max\n", machine), ("1000000\n", 10**6)):
        limit.write_text(text)
        assert memory_bytes(limit) == expected
