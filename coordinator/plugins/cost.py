"""Time and memory of one evaluation, estimated from the settings."""

from schema.errors import rounded
from schema.experiment.document import Experiment, steps_of

_LONG_S, _LARGE_MB = 60.0, 500.0
"""From there on a run says what an evaluation takes."""
_STEP_S = 1e-5
"""Of a physics step, or of a brain tick."""


def evaluation_cost(experiment: Experiment) -> tuple[float, float]:
    """Return CPU time [s] and memory [MB] of an evaluation, or of a fitness window.

    Measured with robots of 14 parts; others take a few times as much or as little.
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
    return draws * (steps + ticks) * _STEP_S, (weights + waves + samples * 150) / 1e6


def cost_line(experiment: Experiment) -> str:
    """Return a line about long or large evaluations of an island, or an empty text."""
    time_s, memory_mb = evaluation_cost(experiment)
    if time_s < _LONG_S and memory_mb < _LARGE_MB:
        return ""
    takes = f"{rounded(time_s, 2)} s of CPU time and {rounded(memory_mb, 2)} MB"
    return f"{experiment.name}: one evaluation takes about {takes} of memory"
