"""Rules of an arena as a plug-in: what they see at a decision, and what they decide."""

from collections.abc import Mapping
from typing import Annotated, Any, Protocol

import numpy as np
import numpy.typing as npt
from msgspec import Meta, Struct

from schema.limits import MOST_PATCHES
from schema.robot.ids import BirthId

LONGEST_CAUSE = 40
"""Characters of a reason of a death."""
Place = tuple[float, float]
"""A point of the ground plane, world frame [m]."""
Stores = Mapping[str, float]
"""Numbers that rules keep for each robot, by name."""
_NOTHING: Stores = {}


class Resident(Struct, frozen=True):
    """Living robot of an arena, as rules see it.

    Attributes:
        birth: its id.
        parents: ids of its parents; empty for a founder.
        age_s: simulated time since it was inserted [s].
        place: of its core's centre [m].
        track: (S, 2) where it was at the S samples of poses since the last decision, or
            since it was born [m]; the last one may be earlier than now.
        work_j: work of its motors since the last decision [J].
        fitness: of its last window; None while it is immature.
        measures: of that window, by name.
        parts: number of parts of its body.
        is_infant: it learns, with a brain that changes.
        stores: its stores, by name.
    """

    birth: BirthId
    parents: tuple[BirthId, ...]
    age_s: float
    place: Place
    track: npt.NDArray[np.float32]
    work_j: float
    fitness: float | None
    measures: Mapping[str, float]
    parts: int
    is_infant: bool
    stores: Stores


class Meeting(Struct, frozen=True):
    """Two robots that were near each other since the last decision.

    Attributes:
        first, second: their ids, the lesser first.
        duration_s: samples of poses at which they were within ``meeting_distance_m``,
            times the interval of samples [s].
        nearest_m: least distance of their cores in the ground plane at these [m].
    """

    first: BirthId
    second: BirthId
    duration_s: float
    nearest_m: float


class ArenaView(Struct, frozen=True):
    """State of an arena at a decision.

    Attributes:
        time_s: simulated time [s].
        interval_s: simulated time since the last decision [s].
        births: number of births so far.
        room: robots that may be born before the arena is full, not below 0.
        births_are_due, deaths_are_due: the time is a multiple of ``birth_interval_s``,
            of ``cull_interval_s``.
        robots: all living, by birth.
        meetings: since the last decision, by pair.
        born: what became of the last decision's ``births``, in order: the id of the
            child, or None if no body was viable or the arena was full.
        parameters: of the rules, with the present values of ``[[changes]]``; None if no
            change names one of them.
    """

    time_s: float
    interval_s: float
    births: int
    room: int
    births_are_due: bool
    deaths_are_due: bool
    robots: tuple[Resident, ...]
    meetings: tuple[Meeting, ...]
    born: tuple[BirthId | None, ...]
    parameters: Any = None


class Conception(Struct, frozen=True):
    """Child to be born.

    Up to ``selection.max_mating_attempts`` bodies of the same parents are vetted; the
    child may therefore come to nothing.

    Attributes:
        parents: two, or one that is copied and mutated. Empty: ``selection.parents``
            selects among the mature, that is with a fitness.
        near: it is born at a random place within ``radius_m`` of this one, away from
            others as ``birth_distance_m`` says; None is the origin.
        radius_m: None is ``birth_radius_m`` [m].
        stores: initial values that differ from ``ArenaRules.stores``.
    """

    parents: Annotated[tuple[BirthId, ...], Meta(max_length=2)] = ()
    near: Place | None = None
    radius_m: Annotated[float, Meta(ge=0)] | None = None
    stores: Stores = _NOTHING


class Death(Struct, frozen=True):
    """Robot to be removed.

    Attributes:
        birth: its id.
        reason: for the table ``deaths``, a few words.
    """

    birth: BirthId
    reason: Annotated[str, Meta(min_length=1, max_length=LONGEST_CAUSE)]


class Patch(Struct, frozen=True):
    """Place that rules keep, such as one with food; it is shown and recorded.

    With ``arena.patch_light_m``, light sensors see it while it holds more than 1e-9.

    Attributes:
        x, y: its centre, world frame [m].
        radius_m: its radius [m].
        content: what it holds.
    """

    x: float
    y: float
    radius_m: Annotated[float, Meta(ge=0)]
    content: float


class Decisions(Struct, frozen=True):
    """What rules decide: deaths, then births, one after the other.

    Attributes:
        births: children to be born. Those for which there is no room are not.
        deaths: robots to be removed; they may be parents of these births.
        stores: new values of stores, by robot; others stay.
        patches: places as they are from now on.
        is_extinct: no robot can be born any more, so the run ends.
    """

    births: tuple[Conception, ...] = ()
    deaths: tuple[Death, ...] = ()
    stores: Mapping[BirthId, Stores] = {}
    patches: Annotated[tuple[Patch, ...], Meta(max_length=MOST_PATCHES)] = ()
    is_extinct: bool = False


class ArenaRules(Protocol):
    """Rules of an arena, ``arena.rules``; run in the coordinator.

    The experiment names a class. It is called once for each arena of a run, as
    ``Class(experiment, parameters)``: the settings of the arena, and an instance of the
    msgspec Struct that the class has as its attribute ``Parameters``, read from the
    table ``[arena.parameters]``; None without it. Nothing else decides which robots
    live, but orders of operators, migration, and physics that diverges.

    The object may keep a memory in ``self``, which ``decide`` changes. A run that is
    resumed repeats all decisions, so ``decide`` must depend on nothing but its
    arguments and that memory: no clock, file, or state of a module. A run ends
    if no robot is left in its arena, and none is to be born.
    """

    @property
    def stores(self) -> Stores:
        """Names and initial values of the stores of a robot."""

    @property
    def meeting_distance_m(self) -> float | None:
        """Distance of two cores up to which robots meet [m].

        None: neither meetings, nor work, nor tracks are needed, and are empty.
        """

    def decide(self, view: ArenaView, rng: np.random.Generator) -> Decisions:
        """Return what happens now.

        ``rng`` belongs to this decision of this arena alone. Draw from nothing else.
        """
