"""Members of a population as own rules of selection see them.

Robots, distances of bodies and ancestors are computed when a rule asks for them.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from schema.errors import ExperimentError
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trees import Integers

_MOST_DISTANCES = 250_000
"""Number of distances that are kept at most, some 50 MB."""


class Relatives:
    """What the individuals of an island know of each other.

    Attributes:
        parents: birth ids of the parents of each individual that lived on the island.
        distances: of bodies, by pairs of birth ids in order.
    """

    def __init__(self, develop: Callable[[Any], Robot]) -> None:
        self.develop = develop
        self.parents: dict[BirthId, tuple[BirthId, ...]] = {}
        self.distances: dict[tuple[BirthId, BirthId], int] = {}

    def members(self, individuals: Iterable[Any]) -> list["Member"]:
        """Return individuals as rules see them; their parents are noted."""
        members = [Member(one, self) for one in individuals]
        self.parents.update((one.birth, one.parents) for one in members)
        return members


class Member:
    """Member of a population; it has all attributes of ``Individual``, too."""

    __slots__ = ("_individual", "_relatives", "_robot")

    def __init__(self, individual: Any, relatives: Relatives) -> None:  # noqa: ANN401 - ``Individual`` needs this module
        self._individual = individual
        self._relatives = relatives
        self._robot: Robot | None = None

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute
        if name.startswith("_"):  # of a copy that is being made
            raise AttributeError(name)
        return getattr(self._individual, name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Member) and self.birth == other.birth

    def __hash__(self) -> int:
        return hash(self.birth)

    @property
    def robot(self) -> Robot:
        """Its body and brain; the brain that it has learnt, if it has learnt one."""
        if self._robot is None:
            one = self._individual
            self._robot = one.learnt or self._relatives.develop(one.genome)
        return self._robot

    def distances(self, others: Sequence["Member"]) -> Integers:
        """Return the distances of its body to those of others, (N,)."""
        try:
            # Numba takes 110 MB, and is an extra.
            from schema.robot import body_distance  # noqa: PLC0415
        except ImportError as error:
            needs = f"distances of bodies need {error.name}"
            install = "pip install 'revolve-islands[analysis]'"
            raise ExperimentError(f"{needs}: {install}") from None
        known = self._relatives.distances
        if len(known) > _MOST_DISTANCES:
            known.clear()
        births = [other.birth for other in others]
        pairs = [(min(self.birth, to), max(self.birth, to)) for to in births]
        new = {at: to for at, to in zip(pairs, others, strict=True) if at not in known}
        if new:
            robots = [other.robot for other in new.values()]
            found = body_distance.body_distances(self.robot, robots).tolist()
            known.update(zip(new, found, strict=True))
        return np.array([known[pair] for pair in pairs], np.int64)

    def ancestors(self, generations: int | None = None) -> frozenset[BirthId]:
        """Return its ancestors' birth ids, up to some generations back if given."""
        ancestors, line = set[BirthId](), set(self._individual.parents)
        while line and (generations is None or generations > 0):
            ancestors |= line
            parents = (self._relatives.parents.get(birth, ()) for birth in line)
            line = set[BirthId]().union(*parents) - ancestors
            generations = generations and generations - 1
        return frozenset(ancestors)
