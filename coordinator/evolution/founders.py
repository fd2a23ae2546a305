"""Given founders of an island: genomes of robot files or of another run."""

from collections.abc import Mapping
from itertools import cycle, islice

from schema.errors import ExperimentError
from schema.experiment.document import Experiment, FounderGenome
from schema.tables.description import KeptFounder

Founder = tuple[FounderGenome, KeptFounder]
"""Given founder: what the experiment and what the run folder hold of it."""


def founders_of(
    experiment: Experiment, kept: Mapping[str, KeptFounder]
) -> tuple[Founder, ...]:
    """Return the given founders of an island, by number of birth.

    ``kept``: those of the run, by digest; ``ExperimentError`` if one is not there.
    """
    founders = experiment.founders
    if founders is None:
        return ()
    for digest in (each.digest for each in founders.genomes):
        if digest not in kept:
            what = f"the genome of digest {digest[:12]} is missing"
            raise ExperimentError(f"founders: {what}: restore a copy of run.json")
    given = [(each, kept[each.digest]) for each in founders.genomes]
    repeated = cycle(given) if founders.repeat else given
    return tuple(islice(repeated, experiment.selection.population))
