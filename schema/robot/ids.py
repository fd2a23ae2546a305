"""The name of an individual."""

from typing import NamedTuple


class BirthId(NamedTuple):
    """Names an individual for ever: its island and its number there, from 0."""

    island: int
    number: int
