"""Islands of an experiment, each with its settings and its neighbours."""

from coordinator.arena.arena import Arena
from coordinator.islands.island import Island
from coordinator.islands.migration import MigrationEpochs, Neighbours
from coordinator.islands.topology import Edge, connections
from schema.experiment.document import Experiment, island_count, island_experiment
from schema.experiment.settings import evaluation_settings


def archipelago(
    experiment: Experiment, seed: int, run: int
) -> dict[int, Island | Arena]:
    """Return the islands by number, before their first event.

    Args:
        experiment: the document.
        seed: of the experiment's execution.
        run: number of the repeat, from 0.

    Raises:
        ExperimentError: no graph meets the topology.
    """
    count = island_count(experiment)
    owns = [island_experiment(experiment, number) for number in range(count)]
    edges: tuple[Edge, ...] = ()
    if experiment.migration is not None:
        edges = connections(experiment.migration, count, seed, run)
    islands: dict[int, Island | Arena] = {}
    for number, own in enumerate(owns):
        links, epochs = _neighbours(number, owns, edges), None
        if own.migration is not None and links.neighbours:
            epochs = MigrationEpochs(own, number, links, seed, run)
        machine = Island if own.arena is None else Arena
        islands[number] = machine(own, seed, run, number, epochs=epochs)
    return islands


def _neighbours(
    number: int, owns: list[Experiment], edges: tuple[Edge, ...]
) -> Neighbours:
    """Return the neighbours of an island.

    Args:
        number: of the island.
        owns: settings of all islands.
        edges: along which migrants travel.
    """
    sources = tuple(source for source, to in edges if to == number)
    return Neighbours(
        targets=tuple(to for source, to in edges if source == number),
        sources=sources,
        differing=tuple(each for each in sources if _differs(owns[number], owns[each])),
    )


def _differs(own: Experiment, other: Experiment) -> bool:
    """Return whether another island evaluates robots differently."""
    if (own.arena is None) != (other.arena is None):
        return True
    return evaluation_settings(own) != evaluation_settings(other)
