"""Selection of parents and survivors, and culling."""

from collections import Counter
from typing import Any

import msgspec
import numpy as np
import pytest

from coordinator.evolution.breeding import Individual
from coordinator.evolution.members import Relatives
from coordinator.evolution.rules import (
    Rule,
    rule_of,
    select_survivors,
)
from coordinator.evolution.selection import (
    cull_population,
    fittest_first,
    select_culled,
)
from schema.experiment.document import (
    ArenaSection,
    Culling,
    Experiment,
    SelectionSection,
)
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.genome_bytes import encode_genome

RELATIVES = Relatives(Robot)
CORE = encode_genome(Node("Core", -1, 0, (0.5, 0.5, 0.5)))
N = 4000


def individuals(*fitnesses: float, first: int = 0) -> list[Individual]:
    return [
        Individual(BirthId(0, number), CORE, fitness, rank=1, generation=0)
        for number, fitness in enumerate(fitnesses, start=first)
    ]


def numbers(chosen: Any) -> list[int]:  # noqa: ANN401 - any individuals
    return [one.birth.number for one in chosen]


def rule(selection: SelectionSection, name: str) -> Rule:
    return rule_of(Experiment("test", selection=selection), name, RELATIVES)


def couples(population: list[Individual], **settings: Any) -> list[list[int]]:  # noqa: ANN401 - any setting
    selection = SelectionSection(**settings)
    rng, tournament = np.random.default_rng(2), rule(selection, "parents")
    couples = (tournament.places(2, population, rng) for _ in range(N))
    return [numbers([population[at] for at in couple]) for couple in couples]


def test_of_equals_the_elder_comes_first() -> None:
    assert numbers(fittest_first(individuals(1.0, 3.0, 2.0, 3.0))) == [1, 3, 2, 0]


def test_the_best_wins_a_tournament_of_all_candidates() -> None:
    population = individuals(0.1, 0.5, 0.3, 0.2, 0.4)
    found = Counter(map(tuple, couples(population)))
    # The first tournament leaves one of five out: the best with chance 1/5. The
    # second is among the four that are left, and so the best of them always wins.
    assert sorted(found) == [(1, 4), (4, 1)]
    assert found[4, 1] == pytest.approx(N / 5, abs=5 * (N * 0.16) ** 0.5)


def test_tournament_wins_follow_combinatorics() -> None:
    population = individuals(*(k / 15 for k in range(15)))
    found = Counter(first for first, _ in couples(population))
    # The k-th of 15 wins if it and three less fit are drawn: C(k, 3) / C(15, 4).
    for k in range(15):
        share = k * (k - 1) * (k - 2) / 6 / 1365
        assert abs(found[k] - N * share) <= 5 * (N * share + 1) ** 0.5


def test_ties_in_a_tournament_break_on_the_birth() -> None:
    found = {tuple(couple) for couple in couples(individuals(*[0.7] * 5))}
    assert found == {(0, 1), (1, 0)}


def test_random_parents_are_uniform_whatever_their_fitness() -> None:
    found = Counter(map(tuple, couples(individuals(9.0, 1.0, 0.0), parents="random")))
    assert len(found) == 6
    assert all(abs(n - N / 6) < 5 * (N / 6) ** 0.5 for n in found.values())


def survivors(
    parents: list[Individual],
    children: list[Individual],
    seed: int = 0,
    **settings: Any,  # noqa: ANN401 - any setting
) -> list[int]:
    rng, selection = np.random.default_rng(seed), SelectionSection(**settings)
    chosen = select_survivors(
        parents, children, rng, selection, rule(selection, "survivors")
    )
    return numbers(chosen)


OLD = individuals(0.5, 0.1, 0.3)
NEW = individuals(0.4, 0.0, 0.3, first=3)


def test_the_best_of_parents_and_children_survive_in_birth_order() -> None:
    assert survivors(OLD, NEW, population=3) == [0, 2, 3]


def test_only_children_survive_without_keep_parents() -> None:
    more = individuals(0.4, 0.0, 0.3, 0.2, first=3)
    assert survivors(OLD, more, population=3, keep_parents=False) == [3, 5, 6]


def test_a_brood_cut_short_does_not_shrink_the_population() -> None:
    assert survivors(OLD, NEW[:1], population=3, keep_parents=False) == [0, 2, 3]


def test_random_survivors_are_uniform_among_all() -> None:
    found = Counter(
        number
        for seed in range(N)
        for number in survivors(OLD, NEW, seed, population=3, survivors="random")
    )
    assert sorted(found) == list(range(6))
    assert all(abs(n - N / 2) < 5 * (N / 4) ** 0.5 for n in found.values())


def culled(fitness: list[float], **rules: float) -> tuple[str, list[int]]:
    arena = msgspec.structs.replace(ArenaSection(), **rules)
    reason, found = select_culled(individuals(*fitness), arena)
    return reason, [one.birth.number for one in found]


FULL = [1.0] * 30
# 0.7 * 0.1 = 0.06999999999999999, but 0.1 - 0.3 * 0.1 = 0.07.
LAST_BIT = 0.7 * 0.1


@pytest.mark.parametrize(
    ("fitness", "rules", "expected"),
    [
        # Mean 1, limit 0.5: one half is enough, a little less is not.
        (
            [0.5, 0.499, 1.501, 1.5, *FULL[:8]],
            {"survive_share_of_mean": 0.5},
            ("selection", [1]),
        ),
        ([LAST_BIT, 0.2 - LAST_BIT, *([0.1] * 8)], {}, ("selection", [])),
        # Mean -1, limit -1 - 0.3 * 1: that is enough, a little less is not.
        ([-1.3, -1.3001, -0.3999, *([-1.0] * 9)], {}, ("selection", [1])),
        ([-1.0] * 29, {}, ("selection", [])),
        ([0.0] * 29, {}, ("selection", [])),
        # Down to the floor, the worst first; of equals the younger.
        ([0.03, 0.01, 0.02, *FULL[:7]], {}, ("selection", [1, 2])),
        ([0.0, 0.0, 0.0, *FULL[:7]], {}, ("selection", [2, 1])),
        ([0.0, *FULL[:7]], {}, ("selection", [])),
        ([], {}, ("selection", [])),
        # Seven tenths of a full arena of equals.
        (FULL[:29], {}, ("selection", [])),
        (FULL, {}, ("cull", [*range(29, 8, -1)])),
        (FULL, {"population_floor": 12}, ("cull", [*range(29, 11, -1)])),
        ([0.1, *FULL[:29]], {}, ("selection", [0])),
    ],
)
def test_culled_robots_by_hand(
    fitness: list[float], rules: dict[str, float], expected: tuple[str, list[int]]
) -> None:
    assert culled(fitness, **rules) == expected


@pytest.mark.parametrize("mean", [-1.0, 1.0])
def test_a_share_above_1_spares_only_what_is_better_than_the_mean(mean: float) -> None:
    few = [mean + 0.3, mean - 0.3, *([mean] * 8)]
    _, gone = culled(few, survive_share_of_mean=1.2, population_floor=1)
    assert sorted(gone) == [*range(1, 10)]


def after_culling(
    rules: Culling,
    parents: list[Individual],
    children: list[Individual],
    founders: int = 15,
) -> list[int]:
    return numbers(cull_population(parents, children, founders, rules))


def test_all_robots_live_between_two_culls() -> None:
    living = individuals(*([1.0] * 15), 0.0)
    assert after_culling(Culling(), living[:15], living[15:]) == list(range(16))
    # The second birth after the founders: 0.0 < 0.7 * 16 / 17.
    child = individuals(1.0, first=16)
    assert after_culling(Culling(), living, child) == [*range(15), 16]


def test_founders_are_not_culled() -> None:
    founders = individuals(*([1.0] * 14), 0.0)
    assert after_culling(Culling(interval=1), [], founders) == list(range(15))


def test_a_brood_that_ends_several_intervals_is_culled_once() -> None:
    rules = Culling(interval=5)
    culled = []
    for births in range(20, 60, 3):
        living = individuals(0.0, *([1.0] * (births - 1)))[-29:]
        living[0] = individuals(0.0, first=living[0].birth.number)[0]
        found = after_culling(rules, living[:-3], living[-3:])
        if len(found) < len(living):
            culled.append(births)
    # Intervals end at 20, 25, 30, ... births.
    assert culled == [20, 26, 32, 35, 41, 47, 50, 56]


def test_a_full_population_of_equals_is_culled_at_once() -> None:
    rules = Culling(interval=100)
    living = individuals(*([1.0] * 30))
    assert len(after_culling(rules, living[:28], living[28:29])) == 29
    # 21 of 30 are culled, the youngest.
    assert after_culling(rules, living[:29], living[29:]) == list(range(9))


def test_the_rest_of_a_culled_population_is_in_birth_order() -> None:
    parents, children = individuals(0.9, 0.8, first=7), individuals(0.7, 0.6)
    assert after_culling(Culling(), parents, children, 3) == [0, 1, 7, 8]
