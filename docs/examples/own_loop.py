"""Hill climbing of one's own over four workers, one of which is killed on the way."""

import os
import signal
from pathlib import Path

import numpy as np

import revolve as rv

experiment = rv.Experiment.read("scenario1", simulation={"window_steps": 800})
rng = np.random.default_rng(4)


def children(process: int) -> list[int]:
    """Return the processes that a process has started (on Linux)."""
    listing = Path(f"/proc/{process}/task/{process}/children").read_text()
    return list(map(int, listing.split()))


parents = [rv.Genome.random(rng, experiment) for _ in range(10)]
with rv.Fleet(workers=4) as fleet:
    for step in range(6):
        pairs = rng.integers(len(parents), size=(30, 2)).tolist()
        made = [parents[a].mate(parents[b], rng) for a, b in pairs]
        genomes = parents + [genome for genome in made if genome is not None]
        results = fleet.evaluate(genome.develop() for genome in genomes)
        scored: list[tuple[float, rv.Genome]] = []
        for genome, result in zip(genomes, results, strict=True):
            if not scored and step == 2:
                (command,) = children(os.getpid())
                os.kill(children(command)[-1], signal.SIGKILL)
            scored.append((result.fitness or 0.0, genome))
        scored.sort(key=lambda pair: -pair[0])
        parents = [genome for _, genome in scored[:10]]
        print(f"step {step}: {len(scored)} results, best fitness {scored[0][0]:.4f}")
