"""Identity of an evaluation: the random draws of a worker depend on it."""

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from schema.experiment.section import Count, Section
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


@dataclass(frozen=True, slots=True)
class Identity:
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
