"""Clock of an arena: its intervals, in physics steps."""

from dataclasses import dataclass

from schema.experiment.document import Arena, Simulation, steps_of


@dataclass(frozen=True, slots=True)
class ArenaClock:
    """Intervals of an arena; every decision falls on a multiple of one of them.

    Attributes:
        founder, birth, cull, sample, snapshot: intervals [steps].
        timestep_s: length of a step [s].
    """

    founder: int
    birth: int
    cull: int
    sample: int
    snapshot: int
    timestep_s: float

    @classmethod
    def of(cls, arena: Arena, simulation: Simulation) -> "ArenaClock":
        """Return the clock of an experiment."""
        return cls(
            steps_of(arena.founder_interval_s, simulation),
            steps_of(arena.birth_interval_s, simulation),
            steps_of(arena.cull_interval_s, simulation),
            steps_of(arena.sample_interval_s, simulation),
            steps_of(arena.snapshot_interval_s, simulation),
            simulation.timestep_s,
        )

    def seconds(self, step: int) -> float:
        """Return the simulated time of a step [s]."""
        return step * self.timestep_s

    def next_decision(self, step: int) -> int:
        """Return the first step after this one at which something is due."""
        intervals = (self.birth, self.cull, self.sample)
        return min((step // each + 1) * each for each in intervals)

    def next_founder(self, step: int) -> int:
        """Return the first step after this one at which a founder is due."""
        return (step // self.founder + 1) * self.founder

    def is_snapshot_due(self, step: int, until: int) -> bool:
        """Return whether a snapshot is due between two steps."""
        return until // self.snapshot > step // self.snapshot
