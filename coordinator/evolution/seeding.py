"""Randomness by identity: every draw knows whose it is.

No draw depends on how many draws happened elsewhere or on the order in which
answers arrive, so the same seed gives the same births on any number of workers.
"""

from enum import IntEnum

import numpy as np

from schema.robot.ids import BirthId


class Purpose(IntEnum):
    """What a stream is for; the numbers are part of what a seed means.

    Of migration, the birth that names a stream is (island, epoch), of a place of
    arrival (island, how many arrived before). 11 is the workers' (``noise``).
    """

    GENERATE = 1
    PARENTS = 2
    MATE = 3
    SURVIVORS = 4
    PLACE = 5
    DURATION = 6
    TOPOLOGY = 7
    EMIGRANTS = 8
    REPLACED = 9
    IMMIGRANT_PLACE = 10


def stream(
    seed: int, run: int, birth: BirthId, attempt: int, purpose: Purpose
) -> np.random.Generator:
    """Return the stream of one purpose of one attempt at one birth.

    Args:
        seed: of the experiment's execution.
        run: number of the repeat, from 0.
        birth: island and birth number.
        attempt: from 0.
        purpose: what is drawn.
    """
    key = (run, birth.island, birth.number, attempt, int(purpose))
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))
    )
