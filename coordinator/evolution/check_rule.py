"""Check of a rule of selection before the first birth, on small populations.

The rule must depend on its arguments alone or, if it is a class, on the broods that
``update`` took, too: an archive in a module is shared by all islands of a process.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from types import MappingProxyType

import numpy as np
from msgspec import Struct

from coordinator.evolution.breeding import Individual, failed_last
from coordinator.evolution.rules import Rule
from schema.errors import ExperimentError
from schema.plugins.contract import broken, repeated
from schema.plugins.origin import where_defined
from schema.plugins.state import own_modules, unchanged
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot

Labels = tuple[str, ...] | None
"""Measures that an experiment records; None: every one that a rule may ask for."""
Answers = dict[tuple[int, int], list[int]]
"""Places by number of the brood and of the population."""

_CHILDREN = 15
_BROODS = 2
_FAILED = 4
"""One of so many robots of a population has failed."""
_ASKED = {
    "selection.parents": (2, 2),
    "selection.survivors": (_CHILDREN + 1, _CHILDREN),
    "migration.emigrants": (2, 1),
}
"""Least size of a population for a rule, and number of places."""


def example_robot(genome: object) -> Robot:
    """Return a chain of as many parts as the genome of an example says."""
    assert isinstance(genome, int)
    links = (
        Part(("ActiveHinge", "FixedBrick")[number % 2], number, number and 1, 0, 0, ())
        for number in range(genome - 1)
    )
    return Robot((Part("Core", -1, -1, -1, 0, ()), *links))


def _example(number: int, fitness: float, labels: Labels, island: int) -> Individual:
    parents = (BirthId(island, number // 2), BirthId(island, number // 3))
    measures: Mapping[str, float] = defaultdict(lambda: number / 7)
    if labels is not None:
        measures = dict.fromkeys(labels, number / 7)
    return Individual(
        BirthId(island, number),
        genome=3 + number % 5,
        fitness=fitness,
        rank=1 + number // 4,
        generation=0,
        parents=parents if number else (),
        size=3 + number % 5,
        measures=MappingProxyType(measures),
    )


def _populations(least: int, labels: Labels, island: int) -> Iterator[list[Individual]]:
    """Yield populations: small, of equals, varied, in part without fitness."""
    step = 7 + 4 * island
    for count, fitness in (
        (least, float),
        (30, lambda _: 0.0),
        (30, lambda number: (number * step % 30) / 10),
        (30, lambda number: float(number) if number % 3 else -1.0),
    ):
        yield [
            _example(number, fitness(number), labels, island) for number in range(count)
        ]


class _Island(Struct):
    """A rule and what it is asked.

    Attributes:
        rule: of the island.
        populations: to select from.
        count: number of places.
        modules: names of users' modules, which must not change; None if that has been
            checked.
        answers: those so far.
    """

    rule: Rule
    populations: list[list[Individual]]
    count: int
    modules: list[str] | None
    answers: Answers

    def update(self, number: int) -> None:
        """Update the memory with a brood."""
        first = number * _CHILDREN
        brood = self.populations[2][first : first + _CHILDREN]
        with self._unchanged("keep its memory in its object, as islands share others"):
            self.rule.update(brood)

    def select(self, brood: int, number: int) -> None:
        """Select from a population, at first twice; note the answer."""
        places = partial(self.rule.places, self.count, self.populations[number])
        must = "not write in select, as update alone changes the memory"
        if self.rule.memory is None:
            must = "keep nothing from one call to the next (a class may, in update)"
        with self._unchanged(must, self.rule.memory):
            answer = places(np.random.default_rng(brood))
        if self.modules is not None and not brood:
            answer = repeated("", lambda: places(np.random.default_rng(brood)))
        self.answers[brood, number] = answer

    def _unchanged(
        self, must: str, plugin: object = None
    ) -> AbstractContextManager[None]:
        if self.modules is None:
            return nullcontext()
        return unchanged(must, self.modules, plugin)


def _live(islands: Sequence[_Island], *, is_backward: bool = False) -> list[Answers]:
    """Return the answers of rules that take turns."""
    for brood in range(_BROODS):
        for island in islands:
            island.update(brood)
        numbers = range(len(islands[0].populations))
        for number in reversed(numbers) if is_backward else numbers:
            for island in islands:
                island.select(brood, number)
    return [island.answers for island in islands]


def check_rule(make: Callable[[], Rule], labels: Labels = None) -> str:
    """Raise unless a rule of selection keeps its contract on simple populations.

    Two islands are alone, then take turns; one of them selects in another order, too.

    Args:
        make: returns a new rule.
        labels: measures of the experiment.

    Returns:
        A warning: what it raises for a population with failed robots, which is no
        error, as a run in which no robot fails goes on; or an empty text.

    Raises:
        ExperimentError: it raises, returns other than as many different places as it
            must, or different ones for the same population, stream and memory; or it
            changes a module, or its object in ``select``.
    """
    # The first call imports its module.
    least, count = _ASKED[make().key]
    modules = own_modules()

    def island(number: int, watched: list[str] | None = None) -> _Island:
        populations = list(_populations(least, labels, number))
        return _Island(make(), populations, count, watched, {})

    alone = [_live([island(number, modules)])[0] for number in range(2)]
    if _live([island(0), island(1)]) != alone:
        must = "select on an island as if there were no other"
        raise broken("", must, came="other places when two islands take turns")
    if _live([island(0)], is_backward=True)[0] != alone[0]:
        must = "select the same whatever was selected before"
        raise broken("", must, came="other places in another order")
    last = island(0)
    failed = failed_last(
        individual if number % _FAILED else individual.evaluated(None, ())
        for number, individual in enumerate(last.populations[-1])
    )
    try:
        last.rule.update(failed)
        last.rule.places(last.count, failed, np.random.default_rng(1))
    except ExperimentError as error:
        defined = where_defined(last.rule.plugin)
        why = str(error).removeprefix(f"{last.rule.key}: {defined}: ")
        return f"of a population with failed robots (fitness 0, no measures): {why}"
    return ""
