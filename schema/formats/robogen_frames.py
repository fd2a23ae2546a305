"""Conversion of RoboGen's slots and quarter turns into Revolve's.

Source: RoboGen's published sources of 2018.
"""

from functools import lru_cache

import numpy as np

from schema.parts import BUILT_IN, MINUS_X, MINUS_Y, Slot, X, Y, Z
from schema.robot.frames import attach
from schema.robot.robot import ORIENTATIONS

SQUARE = ("Core", "FixedBrick")
"""Parts whose slots RoboGen numbers left, right, front, back."""

_OUR_SLOTS = (3, 2, 0, 1)


def our_slot(kind: str, slot: int) -> int:
    """Return Revolve's number of a slot, given RoboGen's."""
    return _OUR_SLOTS[slot] if kind in SQUARE else slot


@lru_cache(maxsize=256)
def our_orientation(parent: str, slot: int, child: str, quarter: int) -> int:
    """Return the orientation [degrees] that matches RoboGen's quarter turns.

    The types are Revolve's, the slot of the parent is RoboGen's; the child is attached
    by its first slot.
    """
    # RoboGen turns the child about its own normal, we turn the tangent: opposite.
    turn = (-90 * quarter) % 360
    wanted, _ = attach(_their_slot(parent, slot), _their_slot(child, 0), turn)
    ours = (
        _our_slot(parent, our_slot(parent, slot)),
        _our_slot(child, our_slot(child, 0)),
    )
    for orientation in ORIENTATIONS:
        rotation, _ = attach(*ours, orientation)
        if np.allclose(rotation, wanted, atol=1e-9):
            return orientation
    raise AssertionError("one of four quarter turns must match")


def _their_slot(kind: str, slot: int) -> Slot:
    """Return RoboGen's slot at the origin, without tilt."""
    if kind in SQUARE:
        normal = (MINUS_X, X, MINUS_Y, Y)[slot]
        return Slot((0.0, 0.0, 0.0), normal, (Y, Y, Z, Z)[slot])
    return Slot((0.0, 0.0, 0.0), X if slot else MINUS_X, Y)


def _our_slot(kind: str, slot: int) -> Slot:
    """Return Revolve's slot, without tilt."""
    part_type = BUILT_IN[kind]
    values = tuple(parameter.default for parameter in part_type.parameters)
    return part_type.shape(values).slots[slot]
