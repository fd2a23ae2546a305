"""Check of a learner before the first birth, on two small quadratic functions."""

from math import inf

import numpy as np

from coordinator.evolution.learners.learner import Batch, NewbornLearner
from schema.experiment.learning import Learning
from schema.plugins.contract import broken

_TRIALS = 24


def check_learner(rules: Learning) -> None:
    """Raise unless a learner keeps its contract.

    It learns 1, 3 and 20 parameters, with trials that fail among others. After each
    request, a second learner is told what was tried and must want the same.

    Raises:
        ExperimentError: as of ``learner_class``; it raises, asks for other than points
            from 0 to 1, or depends on anything but what it was told and the stream.
    """
    for count in (1, 3, 20):
        start = (0.25,) * count
        learner = NewbornLearner(rules, start)
        told: list[Batch] = []
        tried = 1
        while tried < _TRIALS:
            other = NewbornLearner(rules, start)
            for batch in told:
                other.tell(batch)
            first, second = (
                asked.ask(np.random.default_rng(tried), _TRIALS - tried)
                for asked in (learner, other)
            )
            if first != second:
                rule = "want the same when it was told the same"
                raise broken("", rule, came=f"{first[0]} and {second[0]}")
            points = first if told else (start, *first)
            told.append((points, tuple(map(_fitness, points))))
            learner.tell(told[-1])
            tried += len(first)


def _fitness(point: tuple[float, ...]) -> float:
    """Return the negative distance to a point; -inf far from it."""
    distance = float(np.linalg.norm(np.array(point) - 0.6))
    return -distance if distance < 0.5 * len(point) ** 0.5 else -inf
