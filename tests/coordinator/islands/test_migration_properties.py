"""Properties of every archipelago, with answers in any order."""

import random
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.islands.events import Evaluated, EvaluationFailed
from coordinator.run.requests import requester_of
from schema.errors import ExperimentError
from schema.experiment.check import check_experiment
from schema.experiment.document import ArenaSection as Rules
from schema.experiment.document import Experiment, Islands, SelectionSection
from schema.experiment.learning import Learning
from schema.experiment.migration import Migration
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from tests.coordinator.archipelago_run import ARENA, ArchipelagoRun

fixed = settings(max_examples=20, derandomize=True, database=None, deadline=None)

OFF_LINE = Islands(count=2, births=14)
ON_LINE = replace(ARENA, births=9, arena=Rules(population_limit=9, population_floor=4))
INFANTS = replace(ON_LINE, learning=Learning(learner="(1+1)-es", budget=2))
SELECTION = SelectionSection(population=5, children=3, tournament_size=2)


def document(*islands: Islands, **migration: Any) -> Experiment:  # noqa: ANN401
    wanted = {"topology": "fully-connected", "epoch": 6, **migration}
    return Experiment(
        name="test", selection=SELECTION, islands=islands, migration=Migration(**wanted)
    )


def shuffled(seed: int) -> Iterator[int]:
    rng = random.Random(seed)  # noqa: S311 - an order, no secret
    while True:
        yield rng.randrange(1000)


@pytest.mark.parametrize(
    "islands",
    [(OFF_LINE, OFF_LINE), (ON_LINE, ON_LINE), (OFF_LINE, ON_LINE), (ON_LINE, INFANTS)],
)
@pytest.mark.parametrize("handling", ["preserve", "evict"])
def test_the_order_of_answers_changes_no_row(
    islands: tuple[Islands, ...], handling: str
) -> None:
    wanted = document(*islands, handling=handling, emigrants="tournament", migrants=2)
    outcome = ArchipelagoRun(wanted).live().outcome
    for seed in range(4):
        assert ArchipelagoRun(wanted, order=shuffled(seed)).live().outcome == outcome


@fixed
@given(
    order=st.integers(0, 2**32),
    topology=st.sampled_from(["ring", "fully-connected", "star", "grid"]),
    emigrants=st.sampled_from(["best", "tournament", "random"]),
    handling=st.sampled_from(["preserve", "evict"]),
    replaced=st.sampled_from(["worst", "random"]),
    epochs=st.tuples(st.integers(1, 8), st.integers(1, 8), st.integers(1, 8)),
    migrants=st.one_of(st.integers(1, 4), st.sampled_from([0.2, 0.6, 1.0])),
    judge_anew=st.booleans(),
    kinds=st.tuples(st.booleans(), st.booleans(), st.booleans()),
)
def test_every_archipelago_ends_and_repeats(
    order: int,
    epochs: tuple[int, ...],
    kinds: tuple[bool, ...],
    **migration: Any,  # noqa: ANN401 - any setting
) -> None:
    islands = tuple(
        replace(
            ON_LINE if is_arena else Islands(),
            births=births,
            migration=Migration(**{**migration, "epoch": epoch}),
        )
        for births, epoch, is_arena in zip((9, 12, 15), epochs, kinds, strict=True)
    )
    wanted = document(*islands, **migration)
    try:
        check_experiment(wanted, "test")
    except ExperimentError:
        return
    straight = ArchipelagoRun(wanted).live()
    assert all(island.is_finished for island in straight.islands.values())
    assert (
        ArchipelagoRun(wanted, order=shuffled(order)).live().outcome == straight.outcome
    )
    for number, island in straight.islands.items():
        names = Counter(one.birth for one in island.population)
        assert all(count == 1 for count in names.values()), number
        births = [row for row in straight.rows("births") if row["island"] == number]
        assert len(births) == island.births
        if isinstance(island, Arena):
            continue
        # A moved robot leaves a gap until the next immigrant or birth.
        least = 3 if migration["handling"] == "evict" else SELECTION.population
        assert least <= len(island.population) <= SELECTION.population


@pytest.mark.parametrize("requester", [None, 0, 3])
def test_an_evaluation_is_for_its_requester(requester: int | None) -> None:
    birth, signed = BirthId(2, 7), Provenance("worker-1", "x86", 0.5)
    done = Evaluated(birth, Evaluation(0.5, 0.1, 0.2, 12.0), signed, 4, requester)
    failed = EvaluationFailed(birth, "diverged", signed, 4, requester)
    for event in (done, failed):
        assert requester_of(event) == (2 if requester is None else requester)
