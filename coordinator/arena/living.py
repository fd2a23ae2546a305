"""Living robots of an arena, their places, and the changes that await an advance.

Their table rows are made here, too, besides those of migrations.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import repeat
from math import cos, dist, hypot, isfinite, sin, tau
from types import MappingProxyType
from typing import NamedTuple

from msgspec.structs import replace

from coordinator.evolution.breeding import Candidate, Individual
from coordinator.evolution.encodings import IslandEncoding
from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.islands.events import Record
from coordinator.islands.rows import (
    birth_record,
    named,
    named_measures,
    population_records,
)
from schema.experiment.document import ArenaSection
from schema.plugins.arena_rules import Conception, Meeting, Place, Stores
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import (
    Advance,
    BrainChange,
    Casualty,
    Changes,
    Insertion,
    Judgement,
    Touch,
)

NO_WISH = Conception()
_OFF_WALL_M = 0.5
"""Distance of places of birth from the wall [m], unless founders are born nearer."""


class Moment(NamedTuple):
    """State of an arena that its rows refer to.

    Attributes:
        island: number of the arena.
        births: number of births.
        sim_time_s: simulated time [s].
    """

    island: int
    births: int
    sim_time_s: float


@dataclass(slots=True)
class LivingRobot:
    """Living robot of an arena.

    Attributes:
        individual: the individual; its fitness is the last one reported.
        robot: its current body and brain.
        inserted_at: place where it was inserted [m].
        judgement: the last report; None before the first advance.
        is_infant: it learns, and does not count as mature.
        has_matured: rules of selection know that it is mature.
        stores: what the rules of the arena keep for it, by name.
        work_j: work of its motors so far [J], if the rules need it.
    """

    individual: Individual
    robot: Robot
    inserted_at: Place
    judgement: Judgement | None = None
    is_infant: bool = False
    has_matured: bool = False
    stores: Stores = field(default_factory=dict)
    work_j: float = 0.0

    @property
    def birth(self) -> BirthId:
        """Its birth id."""
        return self.individual.birth

    @property
    def is_mature(self) -> bool:
        """It may mate, and may be culled."""
        judgement = self.judgement
        return judgement is not None and judgement.is_mature and not self.is_infant

    @property
    def known_fitness(self) -> float | None:
        """Its fitness; None while it is immature."""
        return self.individual.fitness if self.is_mature else None

    @property
    def position(self) -> tuple[float, float, float | None]:
        """Its last known position [m]; z is None before the first advance."""
        return self.judgement.place if self.judgement else (*self.inserted_at, None)


class LivingRobots:
    """Living robots in the order of their birth ids, and the changes to their world.

    Insertions, removals and new brains take effect here at once, and in the world
    with the next advance, which takes them by ``take_changes``.
    """

    def __init__(
        self,
        rules: ArenaSection,
        labels: Sequence[str],
        *,
        seed: int,
        run: int,
        stores: Stores = MappingProxyType({}),
        has_work: bool = False,
    ) -> None:
        """Initialise without robots.

        ``stores`` are those of a robot that comes; its work is known if ``has_work``.
        """
        self._rules = rules
        self._stores, self._has_work = stores, has_work
        self._labels = labels
        self._stream = partial(stream, seed, run)
        self._living: dict[BirthId, LivingRobot] = {}
        self._removals: list[BirthId] = []
        self._insertions: dict[BirthId, Insertion] = {}
        self._brains: dict[BirthId, BrainChange] = {}

    def __len__(self) -> int:
        return len(self._living)

    def __iter__(self) -> Iterator[LivingRobot]:
        return (self._living[birth] for birth in sorted(self._living))

    @property
    def room(self) -> int:
        """Number of robots below the limit of the population."""
        return max(0, self._rules.population_limit - len(self._living))

    def get(self, birth: BirthId) -> LivingRobot | None:
        """Return the robot with a birth id, or None if no such robot is alive."""
        return self._living.get(birth)

    def mature(self) -> tuple[Individual, ...]:
        """Return the individuals that may mate."""
        return tuple(one.individual for one in self if one.is_mature)

    def take_matured(self, island: int) -> list[Individual]:
        """Return the mature that were born on an island, each at one call only."""
        matured = [
            one
            for one in self
            if one.is_mature and not one.has_matured and one.birth.island == island
        ]
        for one in matured:
            one.has_matured = True
        return [one.individual for one in matured]

    def random_place(
        self, name: BirthId, purpose: Purpose, wish: Conception = NO_WISH
    ) -> Place:
        """Return a random place away from the living; the name is that of a stream."""
        draws = BufferedRng(self._stream(name, 0, purpose))
        others = [one.position[:2] for one in self]
        return draw_place(draws, others, self._rules, wish)

    def add_newborn(
        self,
        candidate: Candidate,
        encoding: IslandEncoding,
        moment: Moment,
        place: Place | None,
        wish: Conception = NO_WISH,
    ) -> list[Record]:
        """Insert a newborn; return the rows of its birth and of the population.

        The moment counts its birth; the place is random, as wished, if None.
        """
        individual = candidate.individual(generation=None)
        place = place or self.random_place(candidate.birth, Purpose.PLACE, wish)
        self.insert(individual, candidate.robot, place, wish.stores)
        now_s = moment.sim_time_s
        born = birth_record(
            candidate, individual, encoding, sim_time_s=now_s, place=place
        )
        fitness = [(one.birth, one.known_fitness) for one in self]
        return [born, *population_records(moment.island, moment.births, fitness)]

    def insert(
        self,
        individual: Individual,
        robot: Robot,
        place: Place,
        stores: Stores = MappingProxyType({}),
    ) -> None:
        """Insert a robot; its stores may differ from those of others."""
        living = LivingRobot(individual, robot, place)
        living.stores = {**self._stores, **stores}
        self._living[individual.birth] = living
        self._insertions[individual.birth] = Insertion(individual.birth, robot, place)

    def store(self, birth: BirthId, stores: Stores) -> None:
        """Replace values of a living robot's stores."""
        robot = self._living[birth]
        robot.stores = {**robot.stores, **stores}

    def remove(self, birth: BirthId) -> LivingRobot:
        """Remove a living robot, and return it."""
        removed = self._living.pop(birth)
        self._brains.pop(birth, None)
        # A robot that was not inserted yet need not be removed.
        if self._insertions.pop(birth, None) is None:
            self._removals.append(birth)
        return removed

    def replace_brain(
        self, robot: LivingRobot, changed: Robot, *, restarts_window: bool = False
    ) -> None:
        """Replace the brain of a living robot by that of ``changed``.

        If it restarts its window of fitness, the robot is immature.
        """
        robot.robot, birth = changed, robot.birth
        inserted = self._insertions.get(birth)
        if inserted is not None:
            self._insertions[birth] = replace(inserted, robot=changed)
            return
        if restarts_window and robot.judgement is not None:
            robot.judgement = replace(robot.judgement, is_mature=False)
        if (before := self._brains.get(birth)) is not None:
            restarts_window = restarts_window or before.restarts_window
        self._brains[birth] = BrainChange(birth, changed.brain, restarts_window)

    def mismatch(self, advance: Advance) -> str:
        """Return why an advance cannot be one of these robots; "" if it can."""
        reported = [one.birth for one in advance.judgements]
        reported += [one.birth for one in advance.casualties]
        if sorted(reported) != sorted(self._living):
            return "it must report each living robot once"
        if not all(isfinite(one.fitness) for one in advance.judgements):
            return "fitness must be finite"
        return ""

    def update(self, advance: Advance) -> None:
        """Store the reports of an advance, and drop the robots that diverged."""
        for casualty in advance.casualties:
            del self._living[casualty.birth]
        works = advance.work_j or repeat(0.0)
        for judgement, work_j in zip(advance.judgements, works, strict=False):
            robot = self._living[judgement.birth]
            robot.judgement = judgement
            robot.work_j += work_j
            robot.individual = replace(
                robot.individual,
                fitness=judgement.fitness,
                measures=dict(zip(self._labels, judgement.measures, strict=False)),
            )

    def sample(self, moment: Moment) -> list[Record]:
        """Return the fitness rows of all living robots with a report."""
        return [
            Record(
                "fitness",
                {
                    **named(one.birth, moment.island),
                    "sim_time_s": moment.sim_time_s,
                    "births": moment.births,
                    "age_s": one.judgement.age_s,
                    "path_velocity": one.judgement.path_velocity,
                    "straight_velocity": one.judgement.straight_velocity,
                    "fitness": one.judgement.fitness,
                    "is_mature": one.is_mature,
                    "measures": named_measures(self._labels, one.judgement.measures),
                    "stores": list(one.stores.items()) or None,
                    "work_j": one.work_j if self._has_work else None,
                },
            )
            for one in self
            if one.judgement is not None
        ]

    def take_changes(self) -> Changes:
        """Return all changes since the last call."""
        changes = Changes(
            tuple(self._removals),
            tuple(self._insertions.values()),
            tuple(self._brains.values()),
        )
        self._removals, self._insertions, self._brains = [], {}, {}
        return changes


def draw_place(
    draws: BufferedRng,
    others: Sequence[Place],
    arena: ArenaSection,
    wish: Conception = NO_WISH,
) -> Place:
    """Return a random place away from all others, or the last one tried.

    Places are uniform in radius, so denser in the centre (as in the
    code of the original).
    The angle is drawn first. The others are last known places of the living [m]. The
    centre and the radius are those of the wish, if it has some; places beyond a wall
    are drawn towards the origin.
    """
    place = (0.0, 0.0)
    x, y = wish.near or (0.0, 0.0)
    most_m = arena.birth_radius_m if wish.radius_m is None else wish.radius_m
    for _ in range(arena.birth_place_tries):
        angle = tau * draws.number()
        radius = most_m * draws.number()
        place = _within_wall(x + radius * cos(angle), y + radius * sin(angle), arena)
        if all(dist(place, other) >= arena.birth_distance_m for other in others):
            break
    return place


def _within_wall(x: float, y: float, arena: ArenaSection) -> Place:
    """Return the nearest place as far from the wall as births from robots [m]."""
    if not arena.wall_diameter_m:
        return x, y
    most_m = max(arena.birth_radius_m, arena.wall_diameter_m / 2 - _OFF_WALL_M)
    share = min(1.0, most_m / max(hypot(x, y), most_m))
    return x * share, y * share


def death_record(dead: LivingRobot | Casualty, reason: str, moment: Moment) -> Record:
    """Return the deaths row of a robot that is removed or has diverged."""
    x, y, z = dead.place if isinstance(dead, Casualty) else dead.position
    row = {
        **named(dead.birth, moment.island),
        "sim_time_s": moment.sim_time_s,
        "births": moment.births,
        "reason": reason,
        "detail": dead.reason if isinstance(dead, Casualty) else "",
        "x": x,
        "y": y,
        "z": z,
    }
    return Record("deaths", row)


def pair_records(
    table: str, pairs: Iterable[Touch | Meeting], moment: Moment, over_s: float
) -> list[Record]:
    """Return the rows of touches, or meetings, in a time that lasted ``over_s``."""
    records = []
    for pair in pairs:
        row = {
            **named(pair.first, moment.island),
            "other_island": pair.second.island,
            "other_birth": pair.second.number,
            "sim_time_s": moment.sim_time_s,
            "over_s": over_s,
            "duration_s": pair.duration_s,
        }
        nearest = {"nearest_m": pair.nearest_m} if isinstance(pair, Meeting) else {}
        records.append(Record(table, row | nearest))
    return records
