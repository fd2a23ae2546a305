"""Rules with a memory in islands and arenas: when they learn of which broods."""

from collections.abc import Callable, Iterator
from itertools import chain, cycle, groupby
from pathlib import Path
from typing import Any

import msgspec
import pytest

from coordinator.arena.arena import Arena
from coordinator.evolution import rules
from schema.experiment.document import Experiment, Islands, SelectionSection
from schema.experiment.migration import Migration
from schema.plugins import permission
from schema.robot.ids import BirthId
from tests.coordinator.archipelago_run import ArchipelagoRun
from tests.coordinator.arena_world import ArenaRun, World, distinct_fitness, experiment
from tests.coordinator.breeding import reject_some

WITNESS = """
class Witness:
    def __init__(self, parameters):
        self.broods, self.asked = [], []

    def select(self, population, count, rng):
        births = [one.birth for one in population]
        self.asked.append((len(self.broods), births))
        # Depends on the memory.
        seen = sum(map(len, self.broods))
        chances = [one.fitness * seen % 1.0 for one in population]
        return sorted(range(len(population)), key=chances.__getitem__)[:count]

    def update(self, brood):
        self.broods.append([one.birth for one in brood])
"""


@pytest.fixture
def witnesses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return the list of all rules that are made."""
    file = tmp_path / "witness_of_memory.py"
    file.write_text(WITNESS)
    permission.allow([str(file)])
    made: list[Any] = []

    def rule_of(*arguments: Any) -> rules.Rule:  # noqa: ANN401
        made.append(rule := make(*arguments))
        return rule

    make: Callable[..., rules.Rule] = rules.rule_of
    monkeypatch.setattr("coordinator.evolution.breeding.rule_of", rule_of)
    return made


NAME = "witness_of_memory:Witness"
BOTH = SelectionSection(population=4, children=3, parents=NAME, survivors=NAME)


def two_islands(order: Iterator[int] | None = None, **keys: Any) -> ArchipelagoRun:  # noqa: ANN401
    document = Experiment(
        name="test",
        selection=msgspec.structs.replace(BOTH, **keys),
        islands=(Islands(births=19), Islands(births=19)),
        migration=Migration(topology="ring", epoch=7, emigrants=NAME),
    )
    return ArchipelagoRun(document, order=order, verdict=reject_some).live()


@pytest.mark.parametrize(("children", "broods"), [(3, 6), (1, 16)])
def test_each_island_remembers_its_own_broods(
    witnesses: list[Any], children: int, broods: int
) -> None:
    two_islands(children=children)
    assert len(witnesses) == 6
    assert len({id(rule.memory) for rule in witnesses}) == 6
    for number, rule in enumerate(witnesses):
        births = [BirthId(number // 3, birth) for birth in range(19)]
        sizes = [4, *[children] * (broods - 1)]
        assert [len(brood) for brood in rule.memory.broods] == sizes
        assert [*chain(*rule.memory.broods)] == births
    # Immigrants are in populations, but in no brood.
    parents, survivors, emigrants = (rule.memory for rule in witnesses[:3])
    assert {birth.island for _, asked in parents.asked for birth in asked} == {0, 1}
    # Survivors are selected before a brood is known, emigrants and couples after it.
    for known, asked in survivors.asked:
        assert asked[-1] not in chain(*survivors.broods[:known])
    assert emigrants.asked[0][0] == (2 if children == 3 else 4)
    for known, asked in groupby(parents.asked, lambda ask: ask[0]):
        populations = [births for _, births in asked]
        assert len(populations) >= children
        assert all(births == populations[0] for births in populations)
        assert known >= 1


def test_births_do_not_depend_on_the_order_of_answers(witnesses: list[Any]) -> None:
    outcomes = [
        two_islands(order).outcome
        for order in (None, cycle([3, 1, 4, 1, 5, 9, 2, 6]), cycle([7, 0, 2]))
    ]
    assert outcomes[0] == outcomes[1] == outcomes[2]
    asked = [[rule.memory.asked for rule in witnesses[at : at + 6]] for at in (0, 6)]
    assert asked[0][1:3] == asked[1][1:3]


def test_arena_remembers_the_robots_that_have_matured(witnesses: list[Any]) -> None:
    document = experiment(60)
    selection = msgspec.structs.replace(document.selection, parents=NAME)
    document = msgspec.structs.replace(document, selection=selection)

    def live(order: Iterator[int] | None = None) -> ArenaRun:
        world = World(distinct_fitness)
        return ArenaRun(Arena(document, 1, 0), world, reject_some, order=order).live()

    lived = live()
    memory = witnesses[0].memory
    born = [*chain(*memory.broods)]
    assert len(born) == len(set(born)) >= 45
    # The last founder is the first to mature.
    assert memory.broods[0] == [BirthId(0, 14)]
    assert all(brood == sorted(brood) for brood in memory.broods)
    for known, population in memory.asked:
        assert {*population} <= {*chain(*memory.broods[:known])}
    for table in ("births", "deaths", "fitness"):
        assert live(cycle([2, 0, 1])).rows(table) == lived.rows(table)
