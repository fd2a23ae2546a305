"""Identifier of an individual."""

from typing import Annotated, NamedTuple

from msgspec import Meta

IslandNumber = Annotated[int, Meta(ge=0, le=2**32 - 1)]
BirthNumber = Annotated[int, Meta(ge=0)]


class BirthId(NamedTuple):
    """Identifies an individual: its island of birth and its number there, from 0."""

    island: IslandNumber
    number: BirthNumber

    @property
    def name(self) -> str:
        """ISLAND:NUMBER, as commands and pictures name an individual."""
        return f"{self.island}:{self.number}"


NOBODY = BirthId(0, 0)
"""Id of a robot that was born in no run."""
