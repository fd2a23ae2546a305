"""Random bodies for the analyzer's tests, simpler than the coordinator's."""

from collections.abc import Callable

import numpy as np
import pytest

from schema.parts import BUILT_IN, BodySpace
from schema.robot.robot import ORIENTATIONS, Part, Robot

KINDS = ("FixedBrick", "ActiveHinge", "Hinge", "ParametricBarJoint", "TouchSensor")


def random_body(rng: np.random.Generator, size: int, space: BodySpace) -> Robot:
    """Return a body of at most ``size`` parts, any slot and orientation, no brain."""
    parts = [Part("Core", -1, -1, -1, 0, (0.5, 0.5, 0.5))]
    free = [(0, slot) for slot in range(4)]
    while free and len(parts) < size:
        parent, parent_slot = free.pop(int(rng.integers(len(free))))
        kind = space[KINDS[int(rng.integers(len(KINDS)))]]
        slot = int(rng.integers(kind.arity))
        turn = ORIENTATIONS[int(rng.integers(4))]
        values = tuple(
            float(rng.uniform(each.low, each.high)) for each in kind.parameters
        )
        index = len(parts)
        parts.append(Part(kind.name, parent, parent_slot, slot, turn, values))
        free += [(index, other) for other in range(kind.arity) if other != slot]
    return Robot(tuple(parts))


@pytest.fixture
def body_of() -> Callable[[int, int], Robot]:
    """Return a function (seed, size) -> random body of the built-in parts."""
    return lambda seed, size: random_body(np.random.default_rng(seed), size, BUILT_IN)
