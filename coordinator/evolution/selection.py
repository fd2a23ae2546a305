"""Individuals, their order by fitness, tournaments, and culling.

Source: Hupkes 2016, sections 5.3 and 8.2; the code of the original.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import fsum

from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import Arena, Culling
from schema.robot.ids import BirthId
from schema.robot.robot import Robot

Couple = tuple["Individual", "Individual"]


@dataclass(frozen=True, slots=True)
class Individual:
    """Member of a population.

    Attributes:
        birth: its id.
        genome: what its children inherit, of the type that the encoding uses.
        fitness: always maximised; 0 where its evaluation failed.
        rank: 1 without parents, else 1 + the greatest of theirs (thesis eq. 6.1).
        generation: number of its brood; founders are 0; None on-line.
        has_failed: its evaluation ended without a fitness.
        parents: birth ids of its parents; empty for a random robot.
        size: number of parts of its body.
        measures: of its evaluation, by name.
        learnt: the robot with the brain that it learnt, if it did and its genome has
            another one.
    """

    birth: BirthId
    genome: object
    fitness: float
    rank: int
    generation: int | None
    has_failed: bool = False
    parents: tuple[BirthId, ...] = ()
    size: int = 0
    measures: Mapping[str, float] = field(default_factory=dict, hash=False)
    learnt: Robot | None = None

    def evaluated(
        self, fitness: float | None, measures: Mapping[str, float] | None = None
    ) -> "Individual":
        """Return the individual with the results of an evaluation.

        Args:
            fitness: None where its evaluation failed.
            measures: of the evaluation; None keeps those of an earlier one.
        """
        value = 0.0 if fitness is None else fitness
        return replace(
            self,
            fitness=value,
            has_failed=fitness is None,
            measures=self.measures if measures is None else measures,
        )

    @property
    def known_fitness(self) -> float | None:
        """Its fitness; None where its evaluation failed."""
        return None if self.has_failed else self.fitness


def fittest_first(individuals: Sequence[Individual]) -> list[Individual]:
    """Return individuals by descending fitness; of equals the elder comes first."""
    return sorted(individuals, key=lambda one: (-one.fitness, one.birth))


def tournament(
    candidates: Sequence[Individual], draws: BufferedRng, size: int
) -> Individual:
    """Return the fittest of ``size`` candidates drawn without replacement."""
    return fittest_first(draws.sample(candidates, size))[0]


def cull_population(
    parents: Sequence[Individual],
    children: Sequence[Individual],
    founders: int,
    rules: Culling,
) -> tuple[Individual, ...]:
    """Return the next population of varying size, in birth order.

    The rule is that of an arena, with births as its clock. A full arena waits for its
    next cull; a full off-line population is culled at once, or no brood would follow.

    Args:
        parents: the population before.
        children: the brood, in birth order.
        founders: number of births before the first interval begins.
        rules: interval between culls, limits and shares.
    """
    living = sorted([*parents, *children], key=lambda one: one.birth)
    births = children[-1].birth.number + 1 - founders
    before = max(0, births - len(children))
    is_due = births // rules.interval > before // rules.interval
    if not is_due and len(living) < rules.population_limit:
        return tuple(living)
    _, culled = select_culled(living, rules)
    return tuple(one for one in living if one not in culled)


def select_culled(
    mature: Sequence[Individual], rules: Arena | Culling
) -> tuple[str, list[Individual]]:
    """Return the robots to cull and the reason, the least fit first.

    Robots below a share of the mean fitness are culled ("selection"). If there are
    none, and the mature alone reach the population limit, a share of the limit is
    culled ("cull"). At least ``population_floor`` of the mature remain. The original
    did not sort the list first.

    Args:
        mature: the robots that were evaluated over a whole window.
        rules: those of an arena or of an off-line island.
    """
    weakest = fittest_first(mature)[::-1]
    spare = max(0, len(weakest) - rules.population_floor)
    if not weakest:
        return "selection", []
    mean = fsum(one.fitness for one in weakest) / len(weakest)
    limit = rules.survive_share_of_mean * mean
    below = [one for one in weakest if one.fitness < limit]
    if below or len(weakest) < rules.population_limit:
        return "selection", below[:spare]
    count = round(rules.full_cull_share * rules.population_limit)
    return "cull", weakest[: min(count, spare)]
