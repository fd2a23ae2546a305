"""Who mates and who lives on."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.selection import (
    Individual,
    fittest_first,
    select_parents,
    select_survivors,
)
from schema.experiment.document import Selection
from schema.robot.genome import Node
from schema.robot.ids import BirthId

CORE = Node("Core", -1, 0, (0.5, 0.5, 0.5))
N = 4000


def individuals(*fitnesses: float, first: int = 0) -> list[Individual]:
    return [
        Individual(BirthId(0, number), CORE, fitness, rank=1, generation=0)
        for number, fitness in enumerate(fitnesses, start=first)
    ]


def numbers(chosen: Any) -> list[int]:  # noqa: ANN401 - any individuals
    return [one.birth.number for one in chosen]


def couples(population: list[Individual], **settings: Any) -> list[list[int]]:  # noqa: ANN401 - any setting
    selection = Selection(**settings)
    draws = BufferedRng(np.random.default_rng(2))
    return [numbers(select_parents(population, draws, selection)) for _ in range(N)]


def test_of_equals_the_elder_comes_first() -> None:
    assert numbers(fittest_first(individuals(1.0, 3.0, 2.0, 3.0))) == [1, 3, 2, 0]


def test_a_tournament_of_the_whole_rest_is_won_by_the_best_of_it() -> None:
    population = individuals(0.1, 0.5, 0.3, 0.2, 0.4)
    found = Counter(map(tuple, couples(population)))
    # The first tournament leaves one of five out: the best with chance 1/5. The
    # second is among the four that are left, and so the best of them always wins.
    assert sorted(found) == [(1, 4), (4, 1)]
    assert found[4, 1] == pytest.approx(N / 5, abs=5 * (N * 0.16) ** 0.5)


def test_tournament_wins_fall_off_as_combinatorics_say() -> None:
    population = individuals(*(k / 15 for k in range(15)))
    found = Counter(first for first, _ in couples(population))
    # The k-th of 15 wins if it and three less fit are drawn: C(k, 3) / C(15, 4).
    for k in range(15):
        share = k * (k - 1) * (k - 2) / 6 / 1365
        assert abs(found[k] - N * share) <= 5 * (N * share + 1) ** 0.5


def test_ties_in_a_tournament_break_on_the_birth() -> None:
    found = {tuple(couple) for couple in couples(individuals(*[0.7] * 5))}
    assert found == {(0, 1), (1, 0)}


@pytest.mark.parametrize("parents", ["tournament", "random"])
def test_nobody_mates_with_itself(parents: str) -> None:
    found = couples(individuals(*range(6)), parents=parents)
    assert all(first != second for first, second in found)


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
    draws = BufferedRng(np.random.default_rng(seed))
    selection = Selection(**settings)
    return numbers(select_survivors(parents, children, draws, selection))


OLD = individuals(0.5, 0.1, 0.3)
NEW = individuals(0.4, 0.0, 0.3, first=3)


def test_the_best_of_parents_and_children_live_on_in_birth_order() -> None:
    assert survivors(OLD, NEW, population=3) == [0, 2, 3]


def test_where_parents_are_not_kept_only_children_live_on() -> None:
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


def test_founders_all_live_on() -> None:
    assert survivors([], OLD, population=3) == [0, 1, 2]
    assert survivors([], OLD, population=3, survivors="random") == [0, 1, 2]
