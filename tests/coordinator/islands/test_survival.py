"""Who lives on in an off-line population that varies in size: worked by hand."""

from coordinator.evolution.breeding import Breeder
from coordinator.evolution.selection import Individual
from coordinator.islands.survival import SurvivorSelection
from schema.experiment.document import Culling, Experiment, Selection
from schema.robot.genome import Node
from schema.robot.ids import BirthId

CORE = Node("Core", -1, 0, ())


def individuals(*fitness: float, first: int = 0) -> list[Individual]:
    return [
        Individual(BirthId(0, first + index), CORE, each, 1, 0)
        for index, each in enumerate(fitness)
    ]


def numbers(found: list[Individual]) -> list[int]:
    return [one.birth.number for one in found]


def survivor_selection(
    rules: Culling | None, founders: int = 15, children: int = 1
) -> SurvivorSelection:
    selection = Selection(population=founders, children=children, culling=rules)
    experiment = Experiment(name="test", births=40, selection=selection)
    return SurvivorSelection(experiment, Breeder(experiment, 1, 0))


def survivors(
    made: SurvivorSelection,
    parents: list[Individual],
    *children: Individual,
    births: int,
) -> list[int]:
    found = made.survivors(parents, children, BirthId(0, births - 1))
    return [one.birth.number for one in found]


def test_between_two_culls_everybody_lives() -> None:
    made = survivor_selection(Culling())
    living = individuals(*([1.0] * 15), 0.0)
    assert survivors(made, living, births=16) == list(range(16))
    # The second birth after the founders: 0.0 < 0.7 * 16 / 17.
    (child,) = individuals(1.0, first=16)
    assert survivors(made, living, child, births=17) == [*range(15), 16]


def test_so_many_always_stay() -> None:
    living = individuals(*([0.0] * 5), *([1.0] * 6))
    # Five are below 0.7 * 6 / 11; eight stay; of equals the youngest go.
    kept = survivors(survivor_selection(Culling(interval=1), 10), living, births=11)
    assert kept == [0, 1, *range(5, 11)]


def test_a_full_population_of_equals_is_culled_at_once() -> None:
    made = survivor_selection(Culling(interval=100))
    assert len(survivors(made, individuals(*([1.0] * 29)), births=29)) == 29
    living = individuals(*([1.0] * 30))
    # 21 of 30 go, the youngest.
    assert survivors(made, living, births=30) == list(range(9))


def test_one_weak_robot_spares_a_full_population() -> None:
    living = individuals(*([1.0] * 29), 0.1)
    made = survivor_selection(Culling(interval=100))
    assert survivors(made, living, births=30) == list(range(29))


def test_no_brood_is_born_beyond_the_limit_or_the_end() -> None:
    made = survivor_selection(Culling(population_limit=10), 5, children=4)
    assert [made.brood_end(20, living) for living in (5, 8, 9, 10, 12)] == [
        *(24, 22, 21, 21, 21)
    ]
    assert made.brood_end(38, 5) == 40
    assert survivor_selection(None, children=4).brood_end(20, 15) == 24


def test_survivors_stand_in_birth_order() -> None:
    parents, children = individuals(0.9, 0.8, first=7), individuals(0.7, 0.6)
    found = survivors(survivor_selection(Culling(), 3), parents, *children, births=4)
    assert found == [0, 1, 7, 8]


def test_without_the_rule_the_best_stay() -> None:
    parents, children = individuals(0.9, 0.1, 0.5), individuals(0.6, first=3)
    found = survivors(survivor_selection(None, 3), parents, *children, births=4)
    assert found == [0, 2, 3]
