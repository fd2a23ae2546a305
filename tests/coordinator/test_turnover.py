"""Who lives on in an off-line population that varies in size: worked by hand."""

from coordinator.selection import Individual
from coordinator.turnover import Turnover
from schema.birth import BirthId
from schema.experiment import Culling
from schema.genome import Node

CORE = Node("Core", -1, 0, ())


def individuals(*fitness: float, first: int = 0) -> list[Individual]:
    return [
        Individual(BirthId(0, first + index), CORE, each, 1, 0)
        for index, each in enumerate(fitness)
    ]


def numbers(found: list[Individual]) -> list[int]:
    return [one.birth.number for one in found]


def test_between_two_culls_everybody_lives() -> None:
    turnover = Turnover(Culling(), 15)
    living = individuals(*([1.0] * 15), 0.0)
    assert numbers(turnover.survivors(living, 16)) == list(range(16))
    # The second birth after the founders: 0.0 < 0.7 * 16 / 17.
    living += individuals(1.0, first=16)
    assert numbers(turnover.survivors(living, 17)) == [*range(15), 16]


def test_so_many_always_stay() -> None:
    turnover = Turnover(Culling(interval=1), 10)
    living = individuals(*([0.0] * 5), *([1.0] * 6))
    # Five are below 0.7 * 6 / 11; eight stay; of equals the youngest go.
    assert numbers(turnover.survivors(living, 11)) == [0, 1, *range(5, 11)]


def test_a_full_population_of_equals_is_culled_at_once() -> None:
    turnover = Turnover(Culling(interval=100), 15)
    assert len(turnover.survivors(individuals(*([1.0] * 29)), 29)) == 29
    found = turnover.survivors(individuals(*([1.0] * 30)), 30)
    assert numbers(found) == list(range(9))  # 21 of 30 go, the youngest


def test_one_weak_robot_spares_a_full_population() -> None:
    turnover = Turnover(Culling(interval=100), 15)
    found = turnover.survivors(individuals(*([1.0] * 29), 0.1), 30)
    assert numbers(found) == list(range(29))


def test_nobody_is_born_beyond_the_limit() -> None:
    turnover = Turnover(Culling(population_limit=10), 5)
    assert [turnover.room(living) for living in (5, 9, 10, 12)] == [5, 1, 1, 1]


def test_survivors_stand_in_birth_order() -> None:
    turnover = Turnover(Culling(), 3)
    living = individuals(0.9, 0.8, first=7) + individuals(0.7, 0.6)
    assert numbers(turnover.survivors(living, 4)) == [0, 1, 7, 8]
