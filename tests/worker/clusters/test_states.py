"""Intervals of an arena and their moments."""

import pytest
from msgspec.structs import replace

from tests.worker.arena_cases import SETTINGS, settings_of
from worker.clusters.states import Schedule


@pytest.mark.parametrize("proximity_steps", [1, 7, 8, 25, 30])
@pytest.mark.parametrize("pose_steps", [1, 10, 40])
def test_no_interval_has_more_moments_than_there_are_rows(
    proximity_steps: int, pose_steps: int
) -> None:
    settings = settings_of(proximity_steps=proximity_steps)
    clock = replace(SETTINGS.simulation, pose_steps=pose_steps)
    schedule = Schedule(replace(settings, simulation=clock))
    step, counts = 0, []
    while step < 2000:
        moments = schedule.moments(step, 2000)
        counts.append(len(moments))
        step = moments[-1]
    assert max(counts) <= schedule.most_moments
    assert schedule.most_moments <= max(counts) + 3
