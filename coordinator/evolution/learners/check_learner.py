"""Check of a learner before the first birth, on two small quadratic functions."""

from collections.abc import Iterator
from math import inf

import numpy as np

from coordinator.evolution.learners.learner import (
    BUILT_IN,
    WHERE,
    Batch,
    NewbornLearner,
    Points,
)
from schema.errors import ExperimentError
from schema.experiment.learning import Learning
from schema.plugins.load import load_object
from schema.plugins.origin import where_defined

_TRIALS = 24


def check_learner(rules: Learning) -> None:
    """Raise unless a learner keeps its contract.

    It learns 1, 3 and 20 parameters, with trials that fail among others. After each
    request, a second learner is told what was tried and must want the same.

    Args:
        rules: the section ``learning``.

    Raises:
        UnknownPlugin: no such learner, or a module that is not allowed.
        ExperimentError: it raises, asks for other than points from 0 to 1, or depends
            on anything but what it was told and the random stream.
    """
    for count in (1, 3, 20):
        for first, second in _requests(rules, count):
            if first != second:
                code = load_object(rules.learner, WHERE, BUILT_IN)
                raise ExperimentError(
                    f"{WHERE}: {where_defined(code)}: a learner that was told the same "
                    f"must want the same, got {first[0]} and {second[0]}"
                )


def _requests(rules: Learning, count: int) -> Iterator[tuple[Points, Points]]:
    """Yield what a learner wants, and what one wants that was only told the past."""
    start = (0.25,) * count
    learner = NewbornLearner(rules, start)
    told: list[Batch] = []
    tried = 1
    while tried < _TRIALS:
        most = _TRIALS - tried
        other = NewbornLearner(rules, start)
        for batch in told:
            other.tell(batch)
        first = learner.ask(np.random.default_rng(tried), most)
        yield first, other.ask(np.random.default_rng(tried), most)
        points = first if told else (start, *first)
        told.append((points, tuple(map(_fitness, points))))
        learner.tell(told[-1])
        tried += len(first)


def _fitness(point: tuple[float, ...]) -> float:
    """Return the negative distance to a point; -inf far from it."""
    distance = float(np.linalg.norm(np.array(point) - 0.6))
    return -distance if distance < 0.5 * len(point) ** 0.5 else -inf
