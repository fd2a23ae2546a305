"""Settings of requests, read and their plug-ins checked once per settings."""

from functools import lru_cache
from typing import TypeVar

from schema.experiment.document import body_space
from schema.experiment.kinds import Use
from schema.experiment.settings import (
    ArenaSettings,
    EvaluationSettings,
    read_arena_settings,
    read_evaluation_settings,
)
from worker.kinds import FITNESS_KIND, MEASURE_KIND, single_measures

T = TypeVar("T", EvaluationSettings, ArenaSettings)


@lru_cache(maxsize=64)
def checked_evaluation(settings: bytes) -> EvaluationSettings:
    """Return the settings of an evaluation request, with checked plug-ins.

    Raises:
        ExperimentError: the bytes are not such settings; a plug-in cannot be loaded or
            breaks its contract.
    """
    return _checked(read_evaluation_settings(settings))


@lru_cache(maxsize=64)
def checked_arena(settings: bytes) -> ArenaSettings:
    """Return the settings of a request to advance an arena, with checked plug-ins.

    Raises:
        ExperimentError: as ``checked_evaluation``.
    """
    return _checked(read_arena_settings(settings))


def _checked(settings: T) -> T:
    body_space(settings.space)
    Use(FITNESS_KIND, settings.fitness).check()
    for measures in single_measures(settings.measures):
        Use(MEASURE_KIND, measures).check()
    return settings
