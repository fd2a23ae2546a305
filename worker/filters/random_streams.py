"""Random streams of a worker: counter-based, without state to save.

A draw depends only on the purpose, the origin (seed, run, island), the birth, the trial
and the block.
"""

from enum import IntEnum
from functools import lru_cache

import numpy as np

from schema.experiment.identity import Origin
from schema.robot.ids import BirthId


class DrawPurpose(IntEnum):
    """Purposes; they differ from those of ``coordinator.evolution.random_streams``."""

    NOISE = 11
    PUSHES = 12
    DISTURBANCES = 13


def stream(
    purpose: DrawPurpose, origin: Origin, birth: BirthId, trial: int, block: int = 0
) -> np.random.Generator:
    """Return the stream of a block of one robot's draws for a purpose.

    The origin is the key of a counter-based generator. Birth, trial and block are the
    start of its counter; the counter's lowest word belongs to the draws.

    Source: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, 2011.
    """
    start = np.array(
        [0, block, birth.number, birth.island << 32 | trial], dtype=np.uint64
    )
    key = _key(purpose, origin)
    return np.random.Generator(np.random.Philox(key=key, counter=start))


@lru_cache(maxsize=64)
def _key(purpose: DrawPurpose, origin: Origin) -> int:
    """Return the key of a purpose and an origin, of 128 bits."""
    name = (origin.run, origin.island, 0, 0, int(purpose))
    words = np.random.SeedSequence(origin.seed, spawn_key=name)
    low, high = map(int, words.generate_state(2, np.uint64))
    return low | high << 64
