"""Who touched whom and for how long: the interaction study's raw material."""

from collections.abc import Sequence

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.wire.arena import Touch
from worker.clusters.cluster import Cluster


class Contacts:
    """Tallies of an advance: each look at which two robots touch counts whole."""

    def __init__(self, settings: ArenaSettings) -> None:
        """Start without any; counts nothing unless the arena asks for it."""
        self._is_wanted = settings.arena.record_touches
        steps = settings.arena.proximity_steps
        self._look_s = steps * settings.simulation.timestep_s
        self._counts: dict[tuple[BirthId, BirthId], int] = {}

    def count(self, clusters: Sequence[Cluster], moment: int) -> None:
        """Count those who touch at a moment of the clusters' tracks."""
        if not self._is_wanted:
            return
        for cluster in clusters:
            for first, second in cluster.track.touching[moment]:
                pair = (cluster.members[first], cluster.members[second])
                self._counts[pair] = self._counts.get(pair, 0) + 1

    def hand_over(self) -> tuple[Touch, ...]:
        """Return the tallies by pair and start again."""
        touches = tuple(
            Touch(first, second, self._counts[first, second] * self._look_s)
            for first, second in sorted(self._counts)
        )
        self._counts.clear()
        return touches
