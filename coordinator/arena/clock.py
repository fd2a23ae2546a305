"""Clock of an arena: its intervals, in physics steps."""

from schema.experiment.document import Arena, Simulation, steps_of


class ArenaClock:
    """Intervals of an arena; every decision falls on a multiple of one of them.

    Attributes:
        founder, birth, cull, sample, snapshot: intervals [steps].
        window: length of a window of fitness [steps].
        first_window: time from a birth to the end of its first window [steps].
    """

    def __init__(self, rules: Arena, simulation: Simulation) -> None:
        self._timestep_s = simulation.timestep_s
        self.founder = steps_of(rules.founder_interval_s, simulation)
        self.birth = steps_of(rules.birth_interval_s, simulation)
        self.cull = steps_of(rules.cull_interval_s, simulation)
        self.sample = steps_of(rules.sample_interval_s, simulation)
        self.snapshot = steps_of(rules.snapshot_interval_s, simulation)
        self.window = simulation.window_steps
        self.first_window = simulation.warmup_steps + simulation.window_steps

    def seconds(self, step: int) -> float:
        """Return the simulated time of a step [s]."""
        return step * self._timestep_s

    def next_decision(self, step: int, *, is_founding: bool) -> int:
        """Return the step of the next decision; while founding, of the next founder."""
        later = (self.birth, self.cull, self.sample)
        intervals = (self.founder,) if is_founding else later
        return min((step // each + 1) * each for each in intervals)

    def is_snapshot_due(self, step: int, until: int) -> bool:
        """Return whether a snapshot is due between two steps."""
        return until // self.snapshot > step // self.snapshot
