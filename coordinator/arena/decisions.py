"""Decisions of the rules of one arena: what they see, and the rows of what they do.

They see what robots did since the last decision: tracks, work and meetings.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
import numpy.typing as npt
from msgspec.structs import asdict

from coordinator.arena.candidates import Mating
from coordinator.arena.living import (
    LivingRobot,
    LivingRobots,
    Moment,
    pair_records,
)
from coordinator.arena.rules import CheckedRules
from coordinator.evolution.breeding import Candidate
from coordinator.evolution.random_streams import Purpose, stream
from coordinator.islands.events import Record
from coordinator.islands.rows import parent_column
from schema.experiment.document import Experiment
from schema.parts import Vector
from schema.plugins.arena_rules import ArenaView, Decisions, Meeting, Patch, Resident
from schema.robot.ids import BirthId
from schema.wire.arena import Advance

Track = npt.NDArray[np.float32]
NO_TRACK: Track = np.zeros((0, 2), np.float32)
Pair = tuple[BirthId, BirthId]


class Activity:
    """Tracks, work and meetings of the living since the last decision.

    Robots that died since are left out, with their meetings.
    """

    def __init__(self, distance_m: float, sample_s: float) -> None:
        """Robots meet within ``distance_m``; samples are ``sample_s`` apart."""
        self._distance_m, self._sample_s = distance_m, sample_s
        self._tracks: dict[BirthId, list[Track]] = {}
        self._work_j: dict[BirthId, float] = {}
        self._samples: dict[Pair, int] = {}
        self._nearest_m: dict[Pair, float] = {}

    def add(self, advance: Advance) -> None:
        """Add an advance with tracks."""
        births = [judgement.birth for judgement in advance.judgements]
        places = np.frombuffer(advance.tracks, "<f4").reshape(-1, 2)
        samples = len(places) // max(1, len(births))
        tracks = places.reshape(len(births), samples, 2)
        before, self._tracks = self._tracks, {}
        for birth, track in zip(births, tracks, strict=True):
            self._tracks[birth] = [*before.get(birth, ()), track]
        self._work_j = {
            birth: self._work_j.get(birth, 0.0) + work_j
            for birth, work_j in zip(births, advance.work_j, strict=True)
        }
        for sample in range(tracks.shape[1]):
            self._meet(births, tracks[:, sample].astype(np.float64))

    def _meet(self, births: Sequence[BirthId], places: npt.NDArray[np.float64]) -> None:
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        rows, columns = np.nonzero(np.triu(apart <= self._distance_m, 1))
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            pair, distance_m = (births[row], births[column]), float(apart[row, column])
            self._samples[pair] = self._samples.get(pair, 0) + 1
            nearest_m = self._nearest_m.get(pair, distance_m)
            self._nearest_m[pair] = min(nearest_m, distance_m)

    def track(self, birth: BirthId) -> Track:
        """Return the track of a robot, (S, 2) [m]."""
        tracks = self._tracks.get(birth)
        return np.concatenate(tracks) if tracks else NO_TRACK

    def work_j(self, birth: BirthId) -> float:
        """Return the work of a robot's motors [J]."""
        return self._work_j.get(birth, 0.0)

    def meetings(self) -> tuple[Meeting, ...]:
        """Return the meetings of the living, by pair."""
        return tuple(
            Meeting(*pair, count * self._sample_s, self._nearest_m[pair])
            for pair, count in sorted(self._samples.items())
            if all(birth in self._tracks for birth in pair)
        )

    def clear(self) -> None:
        """Begin again, after a decision."""
        for each in (self._tracks, self._work_j, self._samples, self._nearest_m):
            each.clear()


_EMPTY = 1e-9
"""Content up to which a patch does not shine."""


class ArenaDecisions:
    """The rules of one arena, and what they need to know.

    Attributes:
        rules: they decide.
        needs_tracks: they need what robots did since the last decision.
        patches: as of the last decision.
    """

    def __init__(
        self, experiment: Experiment, number: int, *, seed: int, run: int
    ) -> None:
        """Initialise before the first decision.

        Raises:
            ExperimentError: as of ``CheckedRules``.
        """
        self.rules = CheckedRules(experiment)
        distance_m, clock = self.rules.meeting_distance_m, experiment.simulation
        self.needs_tracks = distance_m is not None
        self._activity = Activity(
            distance_m or 0.0, clock.pose_steps * clock.timestep_s
        )
        self._stream = partial(stream, seed, run)
        self._number = number
        self._light_m = experiment.arena.patch_light_m if experiment.arena else 0.0
        self._before_s = 0.0
        self._born: list[BirthId | None] = []
        self.patches: tuple[Patch, ...] = ()

    @property
    def lights(self) -> tuple[Vector, ...]:
        """Positions of the lights of the patches, if they have some [m]."""
        if not self._light_m:
            return ()
        shining = (patch for patch in self.patches if patch.content > _EMPTY)
        return tuple((patch.x, patch.y, self._light_m) for patch in shining)

    def note(self, advance: Advance) -> None:
        """Remember what robots did in an advance."""
        if self.needs_tracks:
            self._activity.add(advance)

    def decide(
        self,
        living: LivingRobots,
        moment: Moment,
        step: int,
        *,
        births: bool,
        deaths: bool,
    ) -> tuple[Decisions, list[Record]]:
        """Return the decisions at a step, and the rows of meetings since the last one.

        ``births`` and ``deaths`` say what is due.

        Raises:
            ExperimentError: as of ``CheckedRules.decide``.
        """
        over_s = moment.sim_time_s - self._before_s
        meetings = self._activity.meetings()
        view = ArenaView(
            moment.sim_time_s,
            over_s,
            moment.births,
            living.room,
            births,
            deaths,
            tuple(map(self._resident, living)),
            meetings,
            tuple(self._born),
            self.rules.parameters(moment.sim_time_s),
        )
        rng = self._stream(BirthId(self._number, step), 0, Purpose.RULES)
        decisions = self.rules.decide(view, rng)
        self._activity.clear()
        self._before_s, self._born = moment.sim_time_s, []
        self.patches = decisions.patches
        return decisions, pair_records("meetings", meetings, moment, over_s)

    def end_mating(
        self, mating: Mating, child: Candidate | None, outcome: str, moment: Moment
    ) -> list[Record]:
        """Note what became of a mating; return its row if the rules named parents."""
        self._born.append(None if child is None else child.birth)
        if not mating.parents_are_named:
            return []
        x, y = mating.wish.near or (None, None)
        row = {
            "island": moment.island,
            "sim_time_s": moment.sim_time_s,
            "parents": parent_column(mating.parents),
            "x": x,
            "y": y,
            "birth": child and child.birth.number,
            "outcome": outcome,
        }
        return [Record("matings", row)]

    def sample(self, moment: Moment) -> list[Record]:
        """Return the rows of all patches."""
        at = {"island": moment.island, "sim_time_s": moment.sim_time_s}
        return [
            Record("patches", {**at, "patch": number, **asdict(patch)})
            for number, patch in enumerate(self.patches)
        ]

    def _resident(self, one: LivingRobot) -> Resident:
        individual, judgement = one.individual, one.judgement
        return Resident(
            one.birth,
            individual.parents,
            judgement.age_s if judgement else 0.0,
            one.position[:2],
            self._activity.track(one.birth),
            self._activity.work_j(one.birth),
            one.known_fitness,
            individual.measures,
            individual.size,
            one.is_infant,
            one.stores,
        )


def matings_of(decisions: Decisions, living: LivingRobots) -> list[Mating]:
    """Return the matings that rules decided on; parents that they name live."""
    matings: list[Mating] = []
    for wish in decisions.births:
        named = [living.get(birth) for birth in wish.parents]
        parents = tuple(one.individual for one in named if one is not None)
        matings.append(Mating(wish, parents or living.mature()))
    return matings
