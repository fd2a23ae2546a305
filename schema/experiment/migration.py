"""The section ``[migration]``: topology, and exchange of individuals.

The terms follow pagmo: a topology connects islands, and handling tells whether a
migrant is preserved on its island or evicted from it.
Source: own; Biscani and Izzo 2020, on pagmo, for the terms.
"""

from typing import Annotated, Literal

from msgspec import Meta, field

from schema.experiment.section import (
    AtLeastOne,
    Parameters,
    PluginSection,
    Positive,
    Probability,
)
from schema.limits import MOST_ISLANDS

_Island = Annotated[int, Meta(ge=0, le=MOST_ISLANDS)]
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
EMIGRANTS = ("best", "tournament", "random")
"""Built-in selections of migrants."""


class Migration(PluginSection, frozen=True):
    """Topology of the islands, and their exchange of migrants.

    At the end of an epoch an island sends migrants to each of its neighbours. It
    continues when the migrants of its neighbours' epoch have arrived.

    Attributes:
        topology: ``grid`` is as square as the number of islands allows; island 0 is
            the centre of a ``star``.
        degree: neighbours of each island, for ``random-regular`` and ``small-world``.
        p_rewire: share of connections that a ``small-world`` rewires.
        edges: pairs (from, to) of islands, for ``edges``; all other topologies
            connect both ways.
        epoch: births per epoch, on the island itself.
        epoch_s: simulated time per epoch [s], arenas only; the earlier end counts.
        migrants: number for each neighbour, or share of the population.
        emigrants: selection of migrants: the ``best``, winners of a ``tournament`` of
            the size of those for parents, ``random`` ones, or ``module:attribute``.
        emigrants_parameters: parameters of an own selection of migrants.
        handling: ``preserve`` copies the same migrants to each neighbour; ``evict``
            moves each migrant to one neighbour.
        replaced: individuals that make room for immigrants; ``none`` requires a
            population of varying size. With ``rule`` the island's selection of
            survivors decides among natives and immigrants, off-line only.
        judge_anew: re-evaluate immigrants; always the case in an arena, and between
            islands that evaluate in different ways.
    """

    topology: Topology = "unconnected"
    degree: Annotated[int, Meta(ge=1, le=MOST_ISLANDS)] = 4
    p_rewire: Probability = 0.1
    edges: tuple[tuple[_Island, _Island], ...] = ()
    epoch: AtLeastOne = 15
    epoch_s: Positive | None = None
    migrants: AtLeastOne | Annotated[float, Meta(gt=0, le=1)] = 1
    emigrants: str = "best"
    emigrants_parameters: Parameters = field(default_factory=dict)
    handling: Literal["preserve", "evict"] = "preserve"
    replaced: Literal["worst", "random", "none", "rule"] = "worst"
    judge_anew: bool = False


def migrant_count(migration: Migration, population: int) -> int:
    """Return the number of migrants for each neighbour, given a population size."""
    if isinstance(migration.migrants, int):
        return min(migration.migrants, population)
    return round(migration.migrants * population)
