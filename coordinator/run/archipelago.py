"""Islands of an experiment, each with its settings and its neighbours."""

from collections.abc import Mapping

from coordinator.arena.arena import Arena
from coordinator.evolution.founders import founders_of
from coordinator.islands.island import Island
from coordinator.islands.migration import MigrationEpochs, Neighbours
from coordinator.islands.topology import Edge, connections
from schema.experiment.document import Experiment, island_experiments
from schema.experiment.identity import WHOLE, Group
from schema.experiment.settings import evaluation_settings
from schema.tables.description import KeptFounder


def archipelago(
    experiment: Experiment,
    seed: int,
    run: int,
    founders: Mapping[str, KeptFounder] | None = None,
    group: Group = WHOLE,
) -> dict[int, Island | Arena]:
    """Return the islands of a group by number, before their first event.

    ``founders``: the given ones that the experiment names, by digest.

    Raises:
        ExperimentError: no graph meets the topology, or a founder is missing.
    """
    owns = island_experiments(experiment)
    edges: tuple[Edge, ...] = ()
    if experiment.migration is not None:
        edges = connections(experiment.migration, len(owns), seed, run)
    # Islands that differ in these evaluate robots differently.
    worlds = [(own.arena is None, evaluation_settings(own)) for own in owns]
    islands: dict[int, Island | Arena] = {}
    for number in group.islands(len(owns)):
        own = owns[number]
        links, epochs = _neighbours(number, worlds, edges), None
        if own.migration is not None and links.neighbours:
            epochs = MigrationEpochs(own, number, links, seed, run)
        machine = Island if own.arena is None else Arena
        given = founders_of(own, founders or {})
        islands[number] = machine(own, seed, run, number, epochs=epochs, given=given)
    return islands


def _neighbours(
    number: int, worlds: list[tuple[bool, bytes]], edges: tuple[Edge, ...]
) -> Neighbours:
    """Return the neighbours of an island.

    ``worlds``: settings of all islands that determine their evaluations.
    """
    sources = tuple(source for source, to in edges if to == number)
    return Neighbours(
        targets=tuple(to for source, to in edges if source == number),
        sources=sources,
        differing=tuple(each for each in sources if worlds[each] != worlds[number]),
    )
