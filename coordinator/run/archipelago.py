"""Islands of an experiment, each with its settings and its neighbours."""

from coordinator.arena.arena import Arena
from coordinator.islands.island import Island
from coordinator.islands.migration import MigrationEpochs, Neighbours
from coordinator.islands.topology import connections
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
    links = _links(experiment, owns, seed, run)
    islands: dict[int, Island | Arena] = {}
    for number, own in enumerate(owns):
        epochs = None
        if own.migration is not None and links[number].neighbours:
            epochs = MigrationEpochs(
                own.migration,
                number,
                links[number],
                tournament_size=own.selection.tournament_size,
                seed=seed,
                run=run,
            )
        machine = Island if own.arena is None else Arena
        islands[number] = machine(own, seed, run, number, epochs=epochs)
    return islands


def _links(
    experiment: Experiment, owns: list[Experiment], seed: int, run: int
) -> list[Neighbours]:
    """Return the neighbours of each island."""
    edges: tuple[tuple[int, int], ...] = ()
    if experiment.migration is not None:
        edges = connections(experiment.migration, len(owns), seed, run)
    links = []
    for number, own in enumerate(owns):
        sources = tuple(source for source, to in edges if to == number)
        links.append(
            Neighbours(
                targets=tuple(to for source, to in edges if source == number),
                sources=sources,
                differing=tuple(each for each in sources if _differs(own, owns[each])),
            )
        )
    return links


def _differs(own: Experiment, other: Experiment) -> bool:
    """Return whether another island evaluates robots differently."""
    if (own.arena is None) != (other.arena is None):
        return True
    return evaluation_settings(own) != evaluation_settings(other)
