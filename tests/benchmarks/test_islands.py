"""Benchmark of the cost of a generation of a small island without evaluations."""

import time

import msgspec
import pytest

from schema.experiment.document import Experiment, Islands, SelectionSection
from schema.experiment.migration import Migration
from tests.coordinator.archipelago_run import ArchipelagoRun

pytestmark = pytest.mark.benchmark

ISLANDS = 8
BROODS = 60
BUDGET_S = 1.4e-3
"""Time of a generation of an island in pygmo, including all overhead."""


def per_generation(migration: Migration | None) -> float:
    """Return the CPU time of a generation of one child [s], the minimum of three."""
    document = Experiment(
        name="small",
        births=5 + BROODS,
        selection=SelectionSection(population=5, children=1),
        islands=(Islands(count=ISLANDS),),
        migration=migration,
    )
    times = []
    for seed in range(3):
        archipelago = ArchipelagoRun(document, seed=seed)
        archipelago.start()
        while any(island.births < 5 for island in archipelago.islands.values()):
            archipelago.turn()
        began = time.process_time()
        archipelago.live()
        times.append(time.process_time() - began)
    return min(times) / ISLANDS / BROODS


def test_generation_of_a_small_island_is_faster_than_in_pygmo() -> None:
    ring = Migration(topology="ring", epoch=1)
    isolated, with_copies = per_generation(None), per_generation(ring)
    with_moves = per_generation(msgspec.structs.replace(ring, handling="evict"))
    print(
        f"\nper generation of one child: {isolated * 1e3:.2f} ms alone, "
        f"{with_copies * 1e3:.2f} ms with copies from both neighbours, "
        f"{with_moves * 1e3:.2f} ms with moves"
    )
    assert max(with_copies, with_moves) < BUDGET_S
