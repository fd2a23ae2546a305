"""Whole runs of off-line islands with re-evaluation and culling."""

from collections import Counter, deque
from collections.abc import Iterator
from itertools import cycle
from math import inf
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.islands.events import (
    Answered,
    Evaluated,
    EvaluationFailed,
    Record,
    Started,
)
from coordinator.islands.island import Island
from schema.errors import UnexpectedEvent
from schema.experiment.document import (
    Culling,
    Experiment,
    Reevaluation,
    SelectionSection,
    Simulation,
)
from schema.experiment.file import read_experiment
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.wire.messages import Breed, Evaluate
from tests.coordinator.breeding import bred
from tests.coordinator.island_run import live, records, rows

BRIDGE = Experiment(
    name="test",
    births=40,
    selection=SelectionSection(
        population=6,
        children=2,
        reevaluation=Reevaluation(interval=4, share=0.5),
        culling=Culling(population_limit=12, population_floor=5),
    ),
    simulation=Simulation(evaluation_s=(12.0, 30.0)),
)


def answer(command: Evaluate) -> Answered:
    """Evaluate by birth, trial and duration; every eleventh trial fails."""
    birth = command.birth
    if (birth.number + 3 * command.trial) % 11 == 10:
        return EvaluationFailed(birth, "diverged", Provenance(), command.trial)
    fitness = (birth.number * 0.618 + command.trial * 0.37 + command.steps / 1e4) % 1.0
    evaluation = Evaluation(fitness, 0.1, 0.1, command.steps * 0.005)
    return Evaluated(birth, evaluation, Provenance(), command.trial)


def lived(experiment: Experiment = BRIDGE, turns: Iterator[int] | None = None) -> Any:  # noqa: ANN401 - commands
    return live(Island(experiment, 7, 0), answer, turns)


@pytest.mark.parametrize(("share", "sizes"), [(0.7, 3), (0.1, 5)])
def test_population_rows_are_the_survivors_of_the_culling_rule(
    share: float, sizes: int
) -> None:
    """Oracle: apply the rule to the tables alone."""
    culling = Culling(
        population_limit=12, population_floor=5, survive_share_of_mean=share
    )
    selection = replace(BRIDGE.selection, culling=culling)
    commands = lived(replace(BRIDGE, selection=selection))
    fitness: dict[int, float] = {}
    alive: set[int] = set()
    stands: dict[int, set[int]] = {}
    expected: dict[int, set[int]] = {}
    for one in commands:
        match one:
            case Record(table="births", row=row):
                alive.add(row["birth"])
            case Record(table="evaluations", row=row):
                fitness[row["birth"]] = row["fitness"] or 0.0
            case Record(table="population", row=row):
                births = row["births"]
                if births not in stands:
                    alive = survivors(alive, fitness, share, births)
                    expected[births] = set(alive)
                stands.setdefault(births, set()).add(row["birth"])
                assert (row["fitness"] or 0.0) == fitness[row["birth"]]
    assert stands == expected
    assert len({len(found) for found in stands.values()}) >= sizes


def survivors(
    alive: set[int], fitness: dict[int, float], share: float, births: int
) -> set[int]:
    """Return the survivors after some births: 6 founders, a cull after each brood."""
    if births == 6:
        return alive
    limit = share * sum(fitness[one] for one in alive) / len(alive)
    ranked = sorted(alive, key=lambda one: (-fitness[one], one))
    weak = [one for one in ranked if fitness[one] < limit]
    gone = len(weak) or (8 if len(alive) == 12 else 0)
    return set(ranked[: max(min(5, len(alive)), len(alive) - gone)])


@settings(max_examples=12, deadline=None)
@given(st.lists(st.integers(0, 12), min_size=1, max_size=50))
def test_the_order_of_answers_changes_no_record(turns: list[int]) -> None:
    assert records(lived(BRIDGE, cycle(turns))) == records(lived())


def test_a_brood_waits_for_all_re_evaluations() -> None:
    selection = replace(BRIDGE.selection, culling=None, children=1)
    island = Island(replace(BRIDGE, selection=selection), 7, 0)
    waiting = deque(island.handle(Started()))
    late: list[Evaluate] = []
    while waiting:
        command = waiting.popleft()
        if isinstance(command, Evaluate) and command.trial:
            late.append(command)
        elif isinstance(command, Breed):
            waiting.extend(island.handle(bred(island, command)))
        elif isinstance(command, Evaluate):
            waiting.extend(island.handle(answer(command)))
    assert island.births == 10
    assert [one.trial for one in late] == [1, 1, 1]
    first, second, third = late
    for fitness, trial, why in ((0.0, 2, "1 trials"), (inf, 1, "must be finite")):
        evaluation = Evaluation(fitness, 0, 0, 12)
        with pytest.raises(UnexpectedEvent, match=why):
            island.handle(Evaluated(first.birth, evaluation, Provenance(), trial))
    assert island.handle(answer(third)) == []
    assert island.handle(answer(first)) == []
    found = island.handle(answer(second))
    tables = [one.table for one in found if isinstance(one, Record)]
    assert tables == ["evaluations"] * 3 + ["population"] * 6
    assert isinstance(found[-1], Breed)


def test_no_brood_exceeds_the_population_limit_or_the_births() -> None:
    culling = Culling(population_limit=10, population_floor=5, interval=1000)
    selection = replace(
        BRIDGE.selection, population=5, children=4, reevaluation=None, culling=culling
    )
    commands = lived(replace(BRIDGE, births=20, selection=selection))
    sizes = Counter(row["births"] for row in rows(commands, "population"))
    # 5 + 4 births; then one child makes the population full, and 3 weak are culled.
    assert list(sizes.items())[:3] == [(5, 5), (9, 9), (10, 7)]
    assert max(sizes) == 20
    assert max(sizes.values()) < 10


def test_a_full_population_that_must_not_shrink_has_one_child_at_a_time() -> None:
    culling = Culling(population_limit=6, population_floor=6)
    selection = replace(BRIDGE.selection, reevaluation=None, culling=culling)
    born = rows(lived(replace(BRIDGE, births=9, selection=selection)), "births")
    assert [row["generation"] for row in born] == [0] * 6 + [1, 2, 3]


def test_robots_are_evaluated_once_without_re_evaluation() -> None:
    selection = replace(BRIDGE.selection, reevaluation=None)
    plain = replace(BRIDGE, selection=selection, simulation=Simulation())
    late = Evaluated(BirthId(0, 0), Evaluation(0, 0, 0, 12), Provenance(), 1)
    with pytest.raises(UnexpectedEvent, match="re-evaluates no robot"):
        Island(plain, 7, 0).handle(late)
    asked = [one for one in lived(plain) if isinstance(one, Evaluate)]
    assert [(one.trial, one.steps) for one in asked] == [(0, 0)] * 40


def test_the_shipped_bridge_has_durations_re_evaluation_and_culling() -> None:
    bridge = read_experiment("bridge")
    assert bridge.name == "bridge"
    assert (bridge.births, bridge.arena) == (3000, None)
    selection = bridge.selection
    assert (selection.population, selection.children, bridge.window) == (15, 1, 1)
    assert selection.culling == Culling()
    assert selection.reevaluation == Reevaluation()
    assert bridge.simulation == Simulation(evaluation_s=(12.0, 30.0))
    commands = lived(replace(bridge, births=200))
    steps = [one.steps for one in commands if isinstance(one, Evaluate)]
    assert all(2400 <= count <= 6000 for count in steps)
    assert len({*steps}) > 0.9 * len(steps)
    sizes = Counter(row["births"] for row in rows(commands, "population"))
    assert set(sizes) == set(range(15, 201))
    assert 8 <= min(sizes.values()) <= 10
    assert 15 < max(sizes.values()) <= 30
