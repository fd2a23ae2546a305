"""Those who live in an arena."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from coordinator.arena.place import Place
from coordinator.evolution.selection import Individual
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Judgement


@dataclass(slots=True)
class LivingRobot:
    """One of an arena's living.

    Attributes:
        individual: who it is; its fitness is the last that was told.
        robot: what it is now.
        place: where it was inserted [m].
        judgement: the last; None until an advance has been.
    """

    individual: Individual
    robot: Robot
    place: Place
    judgement: Judgement | None = None

    @property
    def birth(self) -> BirthId:
        """Its name."""
        return self.individual.birth

    @property
    def is_mature(self) -> bool:
        """It may mate, and may be culled."""
        return self.judgement is not None and self.judgement.is_mature

    @property
    def last_place(self) -> Place:
        """Where it was when last seen [m]."""
        return self.place if self.judgement is None else self.judgement.place[:2]


class LivingRobots:
    """The living of an arena, always in the order of their names."""

    def __init__(self) -> None:
        """Begin with nobody."""
        self._living: dict[BirthId, LivingRobot] = {}

    def __len__(self) -> int:
        return len(self._living)

    def __iter__(self) -> Iterator[LivingRobot]:
        return (self._living[birth] for birth in sorted(self._living))

    def get(self, birth: BirthId) -> LivingRobot | None:
        """Return who has a name, None if nobody living has."""
        return self._living.get(birth)

    def add(self, resident: LivingRobot) -> None:
        """Let somebody in."""
        self._living[resident.birth] = resident

    def remove(self, birth: BirthId) -> LivingRobot:
        """Let somebody go who lives, and return who it was."""
        return self._living.pop(birth)

    def judge(self, judgements: Iterable[Judgement]) -> None:
        """Take what was last seen of all who live."""
        for judgement in judgements:
            resident = self._living[judgement.birth]
            resident.judgement = judgement
            resident.individual = replace(
                resident.individual, fitness=judgement.fitness
            )

    def mature(self) -> tuple[Individual, ...]:
        """Return those who may mate."""
        return tuple(one.individual for one in self if one.is_mature)
