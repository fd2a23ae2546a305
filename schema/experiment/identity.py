"""Whose chance it is: what a worker's draws depend on, beside the tick."""

from dataclasses import dataclass

from schema.experiment.section import Count, Section
from schema.robot.ids import BirthId


class Origin(Section, frozen=True):
    """Where something happens: a run, and the island that asked for it.

    Attributes:
        seed: of the experiment's execution.
        run: number of the repeat, from 0.
        island: its number in the run.
    """

    seed: Count = 0
    run: Count = 0
    island: Count = 0


@dataclass(frozen=True, slots=True)
class Identity:
    """Which evaluation it is.

    Attributes:
        origin: who asked for it.
        birth: whose it is.
        trial: which of the robot's, from 0.
    """

    origin: Origin
    birth: BirthId
    trial: int


NOBODY = Identity(Origin(), BirthId(0, 0), 0)
"""An evaluation that belongs to no run: of a robot of a file, or of a benchmark."""
