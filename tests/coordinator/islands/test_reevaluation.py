"""Random durations of evaluation; re-evaluation, its robots and its effect."""

from typing import Any

import numpy as np
import pytest

from coordinator.evolution.breeding import Individual
from coordinator.islands.events import Evaluated, EvaluationFailed
from coordinator.islands.reevaluation import Reevaluations, with_durations
from schema.errors import UnexpectedEvent
from schema.experiment.document import (
    Experiment,
    Reevaluation,
    SelectionSection,
    Simulation,
    body_space,
)
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.wire.genome_bytes import encode_genome
from schema.wire.messages import Evaluate

CORE = Node("Core", -1, 0, ())
SPACE = body_space(Experiment(name="test").space)
ROBOT = develop(CORE, SPACE)
GENOME = encode_genome(CORE)


def reevaluations(**rules: Any) -> Reevaluations:  # noqa: ANN401 - any setting
    """Return re-evaluations that are due every 5 births after 4 founders."""
    wanted = Reevaluation(**{"interval": 5, "share": 0.5, **rules})
    selection = SelectionSection(population=4, reevaluation=wanted)
    experiment = Experiment(name="test", selection=selection)
    return Reevaluations(experiment, 0)


def steps(
    birth: int,
    trial: int = 0,
    *,
    range_s: tuple[float, float] = (12.0, 30.0),
    seed: int = 1,
    run: int = 0,
) -> int:
    """Return the drawn duration of an evaluation in steps of 0.005 s."""
    command = Evaluate(BirthId(0, birth), ROBOT, trial)
    clock = Simulation(evaluation_s=range_s)
    (timed,) = with_durations([command], clock, seed, run)
    assert isinstance(timed, Evaluate)
    return timed.steps


def one(number: int, fitness: float = 0.5, island: int = 0) -> Individual:
    return Individual(BirthId(island, number), GENOME, fitness, 1, 0)


def judged(number: int, trial: int, fitness: float) -> Evaluated:
    evaluation = Evaluation(fitness, 0.1, 0.1, 12.0)
    return Evaluated(BirthId(0, number), evaluation, Provenance(), trial)


def names(asked: list[Evaluate]) -> list[tuple[int, int]]:
    return [(command.birth.number, command.trial) for command in asked]


def repeat(
    found: Reevaluations, births: int, numbers: list[int]
) -> list[tuple[int, int]]:
    """Run the re-evaluations that are due; return their births and trials."""
    population = tuple(one(number) for number in numbers)
    asked = found.start(births, population)
    for command in asked:
        found.take(judged(command.birth.number, command.trial, 0.5))
    found.conclude(population)
    return names(asked)


def test_durations_are_uniform_in_their_range_and_hit_both_ends() -> None:
    # 0.01 s is two steps of 0.005 s: 12.00, 12.005 and 12.01 s are three durations.
    found = [steps(birth, range_s=(12.0, 12.01)) for birth in range(3000)]
    values, counts = np.unique(found, return_counts=True)
    assert values.tolist() == [2400, 2401, 2402]
    assert counts.tolist() == pytest.approx([1000] * 3, rel=0.1)


def test_a_duration_depends_on_seed_run_birth_and_trial_only() -> None:
    assert steps(3, 1) == steps(3, 1)
    others = [steps(3, 0), steps(4, 1), steps(3, 1, seed=2), steps(3, 1, run=1)]
    assert len({steps(3, 1), *others}) == 5


def test_re_evaluations_are_due_every_five_births_after_the_founders() -> None:
    found = reevaluations(share=0.01)
    when = [births for births in range(4, 26) if repeat(found, births, [0, 1, 2])]
    assert when == [9, 14, 19, 24]


def test_a_brood_that_ends_several_intervals_is_re_evaluated_once() -> None:
    found = reevaluations(share=0.01)
    when = [births for births in range(4, 60, 13) if repeat(found, births, [0, 1])]
    assert when == [17, 30, 43, 56]


def test_the_robots_evaluated_longest_ago_are_chosen() -> None:
    found = reevaluations()
    numbers = [0, 1, 2, 3]
    assert repeat(found, 9, numbers) == [(0, 1), (1, 1)]
    # 0 and 1 were judged when 9 had been born, 2 and 3 at their birth.
    assert repeat(found, 14, numbers) == [(2, 1), (3, 1)]
    # Of equals the elder; 11 was judged when 12 had been born, after 0 and 1.
    assert repeat(found, 19, [0, 1, 3, 11]) == [(0, 2), (1, 2)]
    assert repeat(found, 24, [0, 1, 3, 11]) == [(3, 2), (11, 1)]


def test_a_share_is_rounded_and_at_least_one_robot_is_chosen() -> None:
    counts = [
        len(repeat(reevaluations(share=share), 9, list(range(10))))
        for share in (0.01, 0.24, 0.26, 1.0)
    ]
    assert counts == [1, 2, 3, 10]


def test_immigrants_are_not_re_evaluated() -> None:
    found = reevaluations(share=1.0)
    asked = found.start(9, (one(3), one(1, island=1)))
    assert names(asked) == [(3, 1)]


@pytest.mark.parametrize(
    ("rule", "values"), [("replace", [0.2, 0.9]), ("mean", [0.35, 0.5333333333])]
)
def test_the_new_fitness_replaces_the_old_or_joins_the_mean(
    rule: str, values: list[float]
) -> None:
    found = reevaluations(fitness=rule)
    population: tuple[Individual, ...] = (one(0, 0.5), one(5, 0.7))
    for births, trial, fitness, value in zip(
        (9, 19), (1, 2), (0.2, 0.9), values, strict=True
    ):
        assert names(found.start(births, population)) == [(0, trial)]
        found.take(judged(0, trial, fitness))
        assert not found.is_open
        population, records = found.conclude(population)
        assert [each.fitness for each in population] == pytest.approx([value, 0.7])
        (record,) = records
        assert record.table == "evaluations"
        assert (record.row["birth"], record.row["trial"]) == (0, trial)
        assert record.row["fitness"] == fitness
        repeat(found, births + 5, [5])  # takes the turn between


@pytest.mark.parametrize(
    ("rule", "before", "value", "has_failed"),
    [
        ("replace", 0.5, 0.0, True),
        ("mean", 0.5, 0.25, False),
        # Not above the fitness of the trial that succeeded.
        ("mean", -0.5, -0.5, False),
    ],
)
def test_a_failed_trial_counts_as_zero_or_as_the_least_below(
    rule: str, before: float, value: float, *, has_failed: bool
) -> None:
    found = reevaluations(fitness=rule)
    population = (one(0, before), one(5, 0.7))
    found.start(9, population)
    found.take(EvaluationFailed(BirthId(0, 0), "diverged", Provenance(), 1))
    (first, second), (record,) = found.conclude(population)
    assert (first.fitness, first.has_failed) == (value, has_failed)
    assert second is population[1]
    assert (record.row["status"], record.row["fitness"]) == ("failed", None)
    assert (record.row["reason"], record.row["trial"]) == ("diverged", 1)


def test_a_robot_that_failed_at_birth_may_succeed_later() -> None:
    found = reevaluations(fitness="mean")
    population = (Individual(BirthId(0, 0), GENOME, 0.0, 1, 0, has_failed=True),)
    found.start(9, population)
    found.take(judged(0, 1, 0.6))
    ((first,), _) = found.conclude(population)
    assert (first.fitness, first.has_failed) == (0.3, False)


def test_duplicate_outcomes_are_ignored_and_unrequested_ones_raise() -> None:
    found = reevaluations(share=1.0)
    population = (one(0), one(1))
    found.start(9, population)
    assert found.start(9, population) == []
    with pytest.raises(UnexpectedEvent, match="got Evaluated"):
        found.take(judged(2, 1, 0.1))
    with pytest.raises(UnexpectedEvent, match="got Evaluated"):
        found.take(judged(0, 2, 0.1))
    found.take(judged(1, 1, 0.1))
    found.take(judged(1, 1, 0.2))
    assert found.is_open
    found.take(judged(0, 1, 0.3))
    judged_anew, _ = found.conclude(population)
    assert [each.fitness for each in judged_anew] == [0.3, 0.1]
    found.take(judged(1, 1, 0.1))
