"""Candidates of a birth, attempt by attempt, and survivors."""

from collections.abc import Sequence
from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.evolution.breeding import Breeder, Individual
from schema.errors import ExperimentError
from schema.experiment.document import Culling, Experiment, SelectionSection, Space
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation

GREY = (0.5, 0.5, 0.5)
CHILD = BirthId(0, 40)


def breeder(space: Space | None = None, **selection: Any) -> Breeder:  # noqa: ANN401 - any setting
    experiment = Experiment(
        name="test", space=space or Space(), selection=SelectionSection(**selection)
    )
    return Breeder(experiment, 1, 0)


def individuals(genomes: Sequence[bytes]) -> list[Individual]:
    return [
        Individual(BirthId(0, number), genome, number / 10, rank=1, generation=0)
        for number, genome in enumerate(genomes)
    ]


def founders(count: int = 10) -> list[Individual]:
    return individuals([b"%d" % number for number in range(count)])


def test_founders_have_no_parents_and_all_their_attempts_in_order() -> None:
    requests = [breeder().request(CHILD, attempt, ()) for attempt in (0, 3, 5, 98)]
    ranges = [(work.attempt, work.end) for work, _ in requests]
    assert ranges == [(0, 5), (3, 5), (5, 10), (98, 100)]
    assert all((work.parents, couple) == ((), None) for work, couple in requests)


def test_a_couple_is_replaced_after_max_mating_attempts() -> None:
    population, seen = founders(), set[tuple[bytes, ...]]()
    for attempt in (0, 5, 10):
        work, couple = breeder(parents="random").request(CHILD, attempt, population)
        assert couple is not None
        assert (work.attempt, work.end) == (attempt, attempt + 5)
        assert work.parents == tuple(one.genome for one in couple)
        seen.add(work.parents)
    assert len(seen) == 3


@pytest.mark.parametrize(
    ("parents", "is_founder", "limit", "what"),
    [
        ("tournament", False, 500, "100 x selection.max_mating_attempts"),
        ("none", False, 100, "generation.max_tries"),
        ("tournament", True, 100, "generation.max_tries"),
    ],
)
def test_too_many_failed_attempts_raise_an_error(
    *, parents: str, is_founder: bool, limit: int, what: str
) -> None:
    population = [] if is_founder else founders(5)
    patient = breeder(parents=parents)
    patient.request(CHILD, limit - 1, population, "too crowded")
    with pytest.raises(ExperimentError) as caught:
        patient.request(CHILD, limit, population, "too crowded")
    message = str(caught.value)
    assert "\n" not in message
    for word in (f"{what} = {limit}", "too crowded"):
        assert word in message


def test_with_culling_weak_robots_are_removed_at_the_interval() -> None:
    rules = Culling(interval=2, population_floor=1)
    living = [replace(one, fitness=1.0) for one in founders(7)]
    living[1] = replace(living[1], fitness=0.1)
    culling = breeder(population=5, culling=rules)
    assert culling.survivors(living[:5], living[5:6]) == tuple(living[:6])
    found = culling.survivors(living[:6], living[6:])
    assert [one.birth.number for one in found] == [0, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("found", [Evaluation(0.1, 0.1, 0.1, 12.0, (2.0,)), None])
def test_a_selection_function_cannot_change_measures(found: Evaluation | None) -> None:
    (founder,) = individuals([b""])
    one: Any = founder.evaluated(found, ["height"])
    assert one.measures == ({} if found is None else {"height": 2.0})
    with pytest.raises(TypeError, match="item assignment"):
        one.measures["height"] = 1.0


def judged(*fitness: float | None) -> list[Individual]:
    """Return individuals with a fitness, or with a failed evaluation for None."""
    return [
        replace(each, fitness=value or 0.0, has_failed=value is None)
        for each, value in zip(founders(len(fitness)), fitness, strict=True)
    ]


@pytest.mark.parametrize(
    ("parents", "children", "alive"),
    [
        # A failed robot is no fitter than the least fit one; of equals the elder lives.
        ([-2.0, None], [-1.0, None], [0, 2]),
        ([-2.0, None], [-1.0, -3.0], [0, 2]),
        ([None, -0.5], [0.5, -1.0], [1, 2]),
        # Without a negative fitness it counts as 0.
        ([None, 0.0], [0.0, 0.5], [0, 3]),
    ],
)
def test_a_failed_robot_is_no_fitter_than_a_negative_fitness(
    parents: list[float | None], children: list[float | None], alive: list[int]
) -> None:
    both = judged(*parents, *children)
    found = breeder(population=2, parents="random").survivors(both[:2], both[2:])
    assert [one.birth.number for one in found] == alive
