"""What the robots of an arena did since its last decision: tracks, work, meetings."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from schema.plugins.arena_rules import Meeting
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
