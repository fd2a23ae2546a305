"""The section on migration: who neighbours whom, and who moves between islands.

Words follow pagmo's archipelago where they fit: a topology connects the islands,
handling says whether a migrant is preserved on its island or evicted from it.
Source: own; Biscani and Izzo 2020, on pagmo, for the words.
"""

from typing import Annotated, Literal

from msgspec import Meta

from schema.experiment.section import AtLeastOne, Count, Positive, Probability, Section

Topology = Literal[
    "unconnected",
    "ring",
    "fully-connected",
    "star",
    "grid",
    "random-regular",
    "small-world",
    "edges",
]


class Migration(Section, frozen=True):
    """Which islands are neighbours, and what they exchange.

    At the end of an epoch (so many births, or in an arena so many simulated seconds
    if those are over first) an island sends migrants to each of its neighbours, and
    goes on when those of its neighbours' epoch have come.

    Attributes:
        topology: ``grid`` is as square as the number of islands allows; of a
            ``star`` island 0 is the middle.
        degree: neighbours of each island, ``random-regular`` and ``small-world``.
        p_rewire: share of connections that a ``small-world`` sets anew.
        edges: pairs (from, to) of islands, for ``edges``; all other topologies
            connect both ways.
        epoch: births between exchanges; an island's own.
        epoch_s: simulated seconds between exchanges, arenas only.
        migrants: how many leave for each neighbour, or what share of the population.
        emigrants: who leaves; a tournament is as large as the one for parents.
        handling: ``preserve`` sends copies, the same to each neighbour; ``evict``
            moves, to one neighbour each.
        replaced: who makes room, where nobody has left; ``none`` where the number
            of the living varies.
        judge_anew: evaluate immigrants again. So it is always where the islands
            judge in different ways, and in an arena.
    """

    topology: Topology = "unconnected"
    degree: AtLeastOne = 4
    p_rewire: Probability = 0.1
    edges: tuple[tuple[Count, Count], ...] = ()
    epoch: AtLeastOne = 15
    epoch_s: Positive | None = None
    migrants: AtLeastOne | Annotated[float, Meta(gt=0, le=1)] = 1
    emigrants: Literal["best", "tournament", "random"] = "best"
    handling: Literal["preserve", "evict"] = "preserve"
    replaced: Literal["worst", "random", "none"] = "worst"
    judge_anew: bool = False


def migrant_count(migration: Migration, population: int) -> int:
    """Return how many leave a population of so many for each neighbour."""
    if isinstance(migration.migrants, int):
        return min(migration.migrants, population)
    return round(migration.migrants * population)
