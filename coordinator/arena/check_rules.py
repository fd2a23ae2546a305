"""Check that rules of an arena keep their contract, in an arena of points.

The points walk at random instead of simulated robots. Rules must depend on nothing but
their arguments and the decisions before.
"""

from math import tau

import numpy as np
from msgspec.structs import replace

from coordinator.arena.activity import Activity
from coordinator.arena.rules import CheckedRules
from schema.experiment.document import Experiment
from schema.plugins.arena_rules import ArenaView, Decisions, Resident, Stores
from schema.plugins.contract import broken, content_of
from schema.plugins.state import own_modules, unchanged
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Judgement

_IN_DECIDE = "keep its memory in self, as arenas share modules and classes"
_ROBOTS, _DECISIONS = 12, 40
_SAMPLES = 5
_STEP_M = 0.1
_PARTS = 5


class _PointArena:
    """Arena of points in a disc, with rules.

    Two of them with the same experiment and island decide the same.
    """

    def __init__(self, experiment: Experiment, island: int) -> None:
        assert experiment.arena is not None
        self.rules = CheckedRules(experiment)
        self._arena, self._island = experiment.arena, island
        self._rng = np.random.default_rng(island)
        self._labels = experiment.measures.labels
        self._interval_s = self._arena.birth_interval_s
        distance_m = self.rules.meeting_distance_m or 0.0
        self._activity = Activity(distance_m, self._interval_s / _SAMPLES)
        self._living: dict[BirthId, tuple[float, Stores, tuple[BirthId, ...]]] = {}
        self._places: dict[BirthId, np.ndarray] = {}
        self._births = 0
        self._time_s = 0.0
        self._born: list[BirthId | None] = []
        for _ in range(_ROBOTS):
            self._bear((), {})

    def decide(self) -> object:
        """Walk, let the rules decide, do so, and return the content of the decision."""
        births = tuple(sorted(self._living))
        steps = self._rng.normal(0.0, _STEP_M, (len(births), _SAMPLES, 2))
        starts = np.array([self._places[birth] for birth in births]).reshape(-1, 1, 2)
        tracks = (starts + steps.cumsum(axis=1)).astype(np.float32)
        self._places = {b: track[-1] for b, track in zip(births, tracks, strict=True)}
        works = tuple(self._rng.uniform(0.0, 0.1, len(births)).tolist())
        if self.rules.meeting_distance_m is not None:
            judged = tuple(
                Judgement(b, 0.0, 0.0, 0.0, 0.0, is_mature=True, place=(0.0, 0.0, 0.0))
                for b in births
            )
            advance = Advance(0, bytes(32), judged, (), ())
            advance = replace(advance, work_j=works, tracks=tracks.tobytes())
            self._activity.add(advance)
        self._time_s += self._interval_s
        seed = self._island, round(self._time_s / self._interval_s)
        view = self._view(births)
        decisions = self.rules.decide(view, np.random.default_rng(seed))
        self._activity.clear()
        self._apply(decisions)
        return content_of(decisions)

    def _view(self, births: tuple[BirthId, ...]) -> ArenaView:
        interval_s = self._interval_s
        deaths_are_due = self._time_s % self._arena.cull_interval_s < interval_s
        return ArenaView(
            self._time_s,
            interval_s,
            self._births,
            max(0, self._arena.population_limit - len(births)),
            births_are_due=True,
            deaths_are_due=deaths_are_due,
            robots=tuple(map(self._resident, births)),
            meetings=self._activity.meetings(),
            born=tuple(self._born),
            parameters=self.rules.parameters(self._time_s),
        )

    def _resident(self, birth: BirthId) -> Resident:
        born_s, stores, parents = self._living[birth]
        age_s = self._time_s - born_s
        x, y = self._places[birth].tolist()
        # Robots that are younger than a few decisions are immature.
        is_mature = age_s > 3 * self._interval_s
        return Resident(
            birth,
            parents,
            age_s,
            (x, y),
            self._activity.track(birth),
            self._activity.work_j(birth),
            (birth.number * 7 % 11) / 11 if is_mature else None,
            dict.fromkeys(self._labels, birth.number / 7),
            _PARTS,
            is_infant=False,
            stores=stores,
        )

    def _apply(self, decisions: Decisions) -> None:
        for birth, stores in decisions.stores.items():
            born_s, before, parents = self._living[birth]
            self._living[birth] = born_s, {**before, **stores}, parents
        for death in decisions.deaths:
            del self._living[death.birth]
        self._born = []
        for number, child in enumerate(decisions.births):
            # Some bodies are not viable.
            is_viable = number % 3 < 2  # noqa: PLR2004 - every third is not
            has_room = len(self._living) < self._arena.population_limit
            born = is_viable and has_room and self._bear(child.parents, child.stores)
            self._born.append(born or None)

    def _bear(self, parents: tuple[BirthId, ...], stores: Stores) -> BirthId:
        birth = BirthId(self._island, self._births)
        self._births += 1
        angle, radius_m = self._rng.uniform(0.0, (tau, self._arena.birth_radius_m))
        self._places[birth] = radius_m * np.array((np.cos(angle), np.sin(angle)))
        self._living[birth] = self._time_s, {**self.rules.stores, **stores}, parents
        return birth


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
