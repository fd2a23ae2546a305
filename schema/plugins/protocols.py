"""Protocols of plug-ins: what each kind gets and returns."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from schema.robot.ids import BirthId


class Selectable(Protocol):
    """Individual of a population, as selection sees it; nothing of it can be changed.

    Further attributes are no part of this protocol.
    """

    @property
    def birth(self) -> BirthId:
        """Birth id: island and number."""
        ...

    @property
    def parents(self) -> tuple[BirthId, ...]:
        """Birth ids of its parents, dead or alive; empty for a random robot."""
        ...

    @property
    def fitness(self) -> float:
        """Fitness, always maximised; 0 where its evaluation failed."""
        ...

    @property
    def size(self) -> int:
        """Number of parts of its body."""
        ...

    @property
    def rank(self) -> int:
        """1 without parents, else 1 + the greatest rank of its parents."""
        ...

    @property
    def measures(self) -> Mapping[str, float]:
        """Measures of its evaluation by name; those that the experiment records."""
        ...


class ParentSelection(Protocol):
    """Selection of two parents, ``selection.parents``; runs in the coordinator.

    A pure function of its arguments: no clock, file or global random state, and nothing
    is kept from one call to the next. Draw from ``rng`` alone; then births do not
    depend on the number of workers.

    Own parameters: annotate the last argument with a msgspec ``Struct``; it is read
    from the table ``[selection.parents_parameters]``. Without such an annotation the
    argument is None and the table must be empty.
    """

    def __call__(
        self,
        population: Sequence[Selectable],
        rng: np.random.Generator,
        parameters: Any,  # noqa: ANN401 - the plug-in's own Struct, or None
        /,
    ) -> tuple[int, int]:
        """Return the places of two parents.

        Args:
            population: candidates in birth order, at least two; on-line, the robots
                whose fitness covers a whole window.
            rng: stream of this birth and attempt.
            parameters: its own.

        Returns:
            Two different places in ``population``, from 0; the child gets its root part
            from the first.
        """
        ...


class SurvivorSelection(Protocol):
    """Selection of the survivors of a brood, ``selection.survivors``; off-line only.

    It runs in the coordinator; else as ``ParentSelection``, with the table
    ``[selection.survivors_parameters]``. It is not called while the population is not
    larger than ``count``.
    """

    def __call__(
        self,
        population: Sequence[Selectable],
        count: int,
        rng: np.random.Generator,
        parameters: Any,  # noqa: ANN401 - the plug-in's own Struct, or None
        /,
    ) -> Sequence[int]:
        """Return the places of the survivors.

        Args:
            population: the parents, if ``selection.keep_parents``, then their children,
                each in birth order; more than ``count``.
            count: number of survivors, ``selection.population``.
            rng: stream of this brood.
            parameters: its own.

        Returns:
            ``count`` different places in ``population``, from 0, in any order.
        """
        ...
