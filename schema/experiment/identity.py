"""Identity of an evaluation, which determines its draws; group of an archipelago."""

from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta, Struct

from schema.experiment.section import AtLeastOne, Count, Section
from schema.robot.ids import NOBODY, BirthId


class Origin(Section, frozen=True):
    """A run and the island that requests an evaluation.

    Attributes:
        seed: of the run.
        run: number of the repeat, from 0.
        island: number of the island, from 0.
    """

    seed: Annotated[int, Meta(ge=0)] = 0
    run: Count = 0
    island: Count = 0


class Identity(Struct, frozen=True):
    """Identity of an evaluation.

    Attributes:
        origin: run and island that request it.
        birth: of the robot.
        trial: number among the robot's evaluations, from 0.
    """

    origin: Origin
    birth: BirthId
    trial: int


NO_ORIGIN = Origin()
NO_IDENTITY = Identity(NO_ORIGIN, NOBODY, 0)
"""Identity outside of a run: of a robot file or a benchmark."""


class Group(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Group of islands that one coordinator runs: those with number = i modulo ``of``.

    Attributes:
        number: of the group, from 0.
        of: number of groups of the archipelago.
    """

    number: Count = 0
    of: AtLeastOne = 1

    def __str__(self) -> str:
        """Return NUMBER/OF, as the flag ``--group`` has it."""
        return f"{self.number}/{self.of}"

    def islands(self, count: int) -> Sequence[int]:
        """Return the numbers of the islands of the group, given how many there are."""
        return range(self.number, count, self.of)


WHOLE = Group()
"""Group of a run that has all islands of its experiment."""
