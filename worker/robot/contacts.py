"""Contacts of robots in the last step of a model.

The engine also reports geoms that are farther apart than their ``margin`` but within
the ``gap`` of scenery. They exert no force on each other, and do not touch.
"""

from collections.abc import Callable

import mujoco

_IN_GAP = 1
"""Why the engine excludes a contact from the forces."""
ReadContacts = Callable[[], list[list[int]]]
"""Returns the pairs of geoms in contact in the last step, as plain numbers."""


def contact_reader(model: mujoco.MjModel, data: mujoco.MjData) -> ReadContacts:
    """Return a function that returns the contacts of the last step.

    Args:
        model: a compiled model.
        data: the model's state.
    """
    contacts = data.contact

    def read_all() -> list[list[int]]:
        found: list[list[int]] = contacts.geom.tolist()
        return found

    def read_some() -> list[list[int]]:
        found: list[list[int]] = contacts.geom[contacts.exclude != _IN_GAP].tolist()
        return found

    return read_some if model.geom_gap.any() else read_all
