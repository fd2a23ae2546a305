"""MAP-Elites on bodies and brains: the best robot of each size and number of motors.

The archive is that of https://pyribs.org (pip install ribs).
"""

import numpy as np
from ribs.archives import GridArchive

import revolve as rv

BATCH, BATCHES = 24, 6
experiment = rv.Experiment.read("scenario1", simulation={"window_steps": 800})
rng = np.random.default_rng(1)
archive = GridArchive(
    solution_dim=(), dims=(10, 10), ranges=[(3, 31), (1, 11)], solution_dtype=object
)


def child() -> rv.Genome:
    """Return a child of two genomes of the archive."""
    while True:
        first, second = archive.sample_elites(2)["solution"]
        made: rv.Genome | None = first.mate(second, rng)
        if made is not None:
            return made


with rv.Fleet() as fleet:
    genomes = [rv.Genome.random(rng, experiment) for _ in range(2 * BATCH)]
    for batch in range(BATCHES):
        robots = [genome.develop() for genome in genomes]
        results = list(fleet.evaluate(robots))
        sizes = [
            (len(r.parts), sum(n.layer == "output" for n in r.brain.neurons))
            for r in robots
        ]
        fitness = [result.fitness or 0.0 for result in results]
        archive.add(np.array(genomes, dtype=object), fitness, sizes)
        print(f"batch {batch}: {len(archive)} cells, {archive.stats.obj_max:.4f}")
        genomes = [child() for _ in range(BATCH)]
