"""Who mates and who lives on.

Source: Hupkes 2016, section 5.3; facts of the original, section 5.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import Selection
from schema.robot.genome import Genome
from schema.robot.ids import BirthId

Couple = tuple["Individual", "Individual"]


@dataclass(frozen=True, slots=True)
class Individual:
    """One of a population.

    Attributes:
        birth: its name.
        genome: what it hands down.
        fitness: always maximised; 0 where its evaluation failed.
        rank: 1 without parents, else 1 + the greatest of theirs (thesis eq. 6.1).
        generation: number of its brood; founders are 0; None on-line.
        has_failed: its evaluation ended without a judgement.
    """

    birth: BirthId
    genome: Genome
    fitness: float
    rank: int
    generation: int | None
    has_failed: bool = False


def fittest_first(individuals: Sequence[Individual]) -> list[Individual]:
    """Return individuals by falling fitness; of equals the elder comes first."""
    return sorted(individuals, key=_order)


def _order(individual: Individual) -> tuple[float, BirthId]:
    return -individual.fitness, individual.birth


def select_parents(
    population: Sequence[Individual], draws: BufferedRng, selection: Selection
) -> Couple:
    """Return two different parents, the one that gives its root first.

    Args:
        population: those who may mate, in an order that repeats.
        draws: where chance comes from.
        selection: ``tournament``: each is the fittest of a few drawn without
            replacement, the second from those that the first leaves; otherwise
            both are uniform.
    """
    if selection.parents != "tournament":
        first, second = draws.sample(population, 2)
        return first, second
    first = _win(population, draws, selection.tournament_size)
    rest = [one for one in population if one is not first]
    return first, _win(rest, draws, selection.tournament_size)


def _win(candidates: Sequence[Individual], draws: BufferedRng, size: int) -> Individual:
    return min(draws.sample(candidates, size), key=_order)


def select_survivors(
    parents: Sequence[Individual],
    children: Sequence[Individual],
    draws: BufferedRng,
    selection: Selection,
) -> tuple[Individual, ...]:
    """Return the next population in birth order.

    Args:
        parents: the population that was.
        children: those born since.
        draws: where chance comes from.
        selection: size of the population; ``best`` or ``random``; whether parents
            compete with their children. A brood cut short by the end of the run
            always competes with its parents, or the population would shrink.
    """
    size = selection.population
    pool = list(children)
    if selection.keep_parents or len(pool) < size:
        pool = [*parents, *pool]
    if len(pool) <= size:
        chosen = pool
    elif selection.survivors == "best":
        chosen = fittest_first(pool)[:size]
    else:
        chosen = draws.sample(pool, size)
    return tuple(sorted(chosen, key=lambda one: one.birth))
