"""Kind of plug-ins that decide who lives in an arena.

Rules are checked in an arena of points, which walk at random instead of simulated
robots. They must depend on nothing but their arguments and the decisions before.
"""

from functools import partial

import numpy as np

from coordinator.arena.candidates import Mating
from coordinator.arena.decisions import ArenaDecisions, matings_of
from coordinator.arena.living import NO_WISH, LivingRobots, Moment
from coordinator.arena.rules import BUILT_IN, METHODS, WHERE, load_rules
from coordinator.evolution.breeding import Candidate
from coordinator.evolution.random_streams import Purpose
from schema.experiment.document import ArenaSection, Experiment, island_experiments
from schema.experiment.kinds import Kind, is_class
from schema.plugins.contract import broken, content_of
from schema.plugins.state import own_modules, unchanged
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.arena import Advance, Judgement

_IN_DECIDE = "keep its memory in self, as arenas share modules and classes"
_ROBOTS, _DECISIONS = 12, 40
_SAMPLES = 5
_STEP_M = 0.1
_POINT = Part("Core", -1, -1, -1, 0, ())
_PARTS = 5
_YOUNG = 3


class _PointArena:
    """Arena of points in a disc, with rules.

    Two of them with the same experiment and island decide the same.
    """

    def __init__(self, experiment: Experiment, island: int) -> None:
        assert experiment.arena is not None
        self._arena, self._island = experiment.arena, island
        self._decisions = ArenaDecisions(experiment, island, seed=0, run=0)
        self._labels = experiment.measures.labels
        stores = self._decisions.rules.stores
        self._living = LivingRobots(
            self._arena, self._labels, seed=0, run=0, stores=stores
        )
        self._rng = np.random.default_rng(island)
        self._born: list[int] = []
        self._number = 0
        for _ in range(_ROBOTS):
            self._bear(Mating(NO_WISH, ()))

    def decide(self) -> object:
        """Walk, let the rules decide, do so, and return the content of the decision."""
        self._number += 1
        self._walk()
        interval_s = self._arena.birth_interval_s
        time_s = self._number * interval_s
        moment = Moment(self._island, len(self._born), time_s)
        is_due = time_s % self._arena.cull_interval_s < interval_s
        decisions, _ = self._decisions.decide(
            self._living, moment, self._number, births=True, deaths=is_due
        )
        matings = matings_of(decisions, self._living)
        for birth, stores in decisions.stores.items():
            self._living.store(birth, stores)
        for death in decisions.deaths:
            self._living.remove(death.birth)
        for number, mating in enumerate(matings):
            # Every third body is not viable.
            is_born = number % 3 < 2 and self._living.room  # noqa: PLR2004
            child = self._bear(mating) if is_born else None
            self._decisions.end_mating(mating, child, "", moment)
        return content_of(decisions)

    def _walk(self) -> None:
        starts = np.array([one.position[:2] for one in self._living]).reshape(-1, 1, 2)
        steps = self._rng.normal(0.0, _STEP_M, (len(starts), _SAMPLES, 2))
        tracks = (starts + steps.cumsum(axis=1)).astype(np.float32)
        works = tuple(self._rng.uniform(0.0, 0.1, len(starts)).tolist())
        judged = []
        for one, track in zip(self._living, tracks, strict=True):
            number, (x, y) = one.birth.number, track[-1].tolist()
            age = self._number - self._born[number]
            age_s, fitness = age * self._arena.birth_interval_s, number * 7 % 11 / 11
            measures = (number / 7,) * len(self._labels)
            # Robots that are younger than a few decisions are immature.
            rest = fitness, age > _YOUNG, (x, y, 0.0), measures
            judged.append(Judgement(one.birth, age_s, 0.0, 0.0, *rest))
        advance = Advance(
            0, bytes(32), tuple(judged), (), (), work_j=works, tracks=tracks.tobytes()
        )
        self._living.update(advance)
        self._decisions.note(advance)

    def _bear(self, mating: Mating) -> Candidate:
        birth = BirthId(self._island, len(self._born))
        self._born.append(self._number)
        couple = mating.parents[:2] if mating.parents_are_named else ()
        robot = Robot((_POINT,) * (1 + birth.number % _PARTS))
        child = Candidate(birth, 0, couple, b"", robot, 0)
        place = self._living.random_place(birth, Purpose.PLACE, mating.wish)
        individual = child.individual(generation=None)
        self._living.insert(individual, robot, place, mating.wish.stores)
        return child


def check_rules(experiment: Experiment) -> None:
    """Raise unless the rules of an arena keep their contract.

    Raises:
        ExperimentError: they raise, decide what cannot be, change a module, or decide
            otherwise when another arena of the same rules is decided in turns.
    """
    alone = [_PointArena(experiment, island) for island in range(2)]
    modules = own_modules()
    with unchanged(_IN_DECIDE, modules):
        by_itself = [[each.decide() for _ in range(_DECISIONS)] for each in alone]
        turns = [_PointArena(experiment, island) for island in range(2)]
        mixed = [[each.decide() for each in turns] for _ in range(_DECISIONS)]
    if by_itself != [list(each) for each in zip(*mixed, strict=True)]:
        must = "decide in an arena as if there were no other"
        raise broken("", must, came="other decisions when two arenas take turns")


RULES = Kind(
    "rules",
    WHERE,
    BUILT_IN,
    is_one=partial(is_class, METHODS),
    section=lambda path: Experiment("by hand", arena=ArenaSection(rules=path)),
    sections=lambda whole: [at for at in island_experiments(whole) if at.arena],
    path=lambda experiment: experiment.arena.rules if experiment.arena else "",
    load=lambda experiment: load_rules(experiment)[0],
    check=check_rules,
)
"""``arena.rules``."""
