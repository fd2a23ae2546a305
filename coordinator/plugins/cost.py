"""Time and memory of one evaluation, estimated from the settings."""

from schema.errors import rounded
from schema.experiment.document import Experiment, steps_of

LONG_S, LARGE_MB = 60.0, 500.0
"""From there on a run says what an evaluation takes."""
_STEP_S = 1e-5
"""Of a physics step, or of a brain tick."""


def evaluation_cost(experiment: Experiment) -> tuple[float, float]:
    """Return the CPU time [s] and the memory [MB] of one evaluation of an island.

    Measured with robots of 14 parts; other robots and worlds take a few times as much
    or as little. In an arena it is one fitness window of a robot.
    """
    clock, space = experiment.simulation, experiment.space
    steps = clock.evaluation_steps
    if clock.evaluation_s is not None:
        steps = steps_of(clock.evaluation_s[1], clock)
    ticks, samples = steps / clock.brain_steps, clock.window_steps / clock.pose_steps
    draws = 1 if experiment.robust is None else experiment.robust.draws
    states = space.max_outputs + space.max_hidden
    weights = 8 * states * (space.max_inputs + states)
    waves = 0.0 if experiment.arena is not None else ticks * (100 + 16 * states)
    memory = weights + waves + samples * 150
    return draws * (steps + ticks) * _STEP_S, memory / 1e6


def cost_line(experiment: Experiment) -> str:
    """Return a line about a long or large evaluation of an island; empty if it is none.

    Args:
        experiment: settings of the island.
    """
    time_s, memory_mb = evaluation_cost(experiment)
    if time_s < LONG_S and memory_mb < LARGE_MB:
        return ""
    return (
        f"{experiment.name}: one evaluation takes about {rounded(time_s, 2)} s of CPU "
        f"time and {rounded(memory_mb, 2)} MB of memory"
    )
