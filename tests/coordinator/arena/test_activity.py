"""Meetings, tracks and work of robots, compared with slow loops over positions."""

from math import dist

import numpy as np
import pytest

from coordinator.arena.decisions import Activity
from schema.plugins.arena_rules import Meeting
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Judgement
from tests.coordinator.arena_views import born
from tests.coordinator.arena_world import poses


def advance(
    births: tuple[BirthId, ...], tracks: np.ndarray, work_j: tuple[float, ...]
) -> Advance:
    judged = tuple(
        Judgement(b, 0.0, 0.0, 0.0, 0.0, is_mature=True, place=(0.0, 0.0, 0.0))
        for b in births
    )
    points = tracks.astype("<f4").tobytes()
    return Advance(0, bytes(32), judged, (), (), work_j=work_j, tracks=points)


@pytest.mark.parametrize("seed", range(3))
def test_meetings_are_those_of_a_loop_over_positions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = born(0, 1, 2, 3, 4), born(0, 2, 3, 4, 6)
    tracks = [rng.uniform(-0.5, 0.5, (5, s, 2)).astype(np.float32) for s in (3, 4)]
    activity = Activity(0.4, 0.2)
    work = dict.fromkeys(second, 0.0)
    nearest: dict[tuple[BirthId, BirthId], list[float]] = {}
    for births, places in zip((first, second), tracks, strict=True):
        works = tuple(rng.uniform(size=5).tolist())
        activity.add(advance(births, places, works))
        for birth, work_j in zip(births, works, strict=True):
            work[birth] = work.get(birth, 0.0) + work_j
        for sample in range(places.shape[1]):
            for a in range(5):
                for b in range(a + 1, 5):
                    apart = dist(places[a, sample].tolist(), places[b, sample].tolist())
                    if apart <= 0.4:
                        nearest.setdefault((births[a], births[b]), []).append(apart)
    wanted = [
        Meeting(*pair, len(apart) * 0.2, min(apart))
        for pair, apart in sorted(nearest.items())
        if set(pair) <= set(second)
    ]
    found = activity.meetings()
    assert len(found) > 3
    assert [(m.first, m.second) for m in found] == [(m.first, m.second) for m in wanted]
    assert [m.duration_s for m in found] == [m.duration_s for m in wanted]
    assert np.allclose([m.nearest_m for m in found], [m.nearest_m for m in wanted])
    for birth in second:
        assert activity.work_j(birth) == pytest.approx(work[birth])
    assert np.array_equal(activity.track(born(6)[0]), tracks[1][4])
    both = np.concatenate([tracks[0][2], tracks[1][1]])
    assert np.array_equal(activity.track(born(2)[0]), both)
    activity.clear()
    assert not activity.meetings()
    assert activity.track(born(2)[0]).shape == (0, 2)


def test_robots_that_are_all_gone_have_no_meetings() -> None:
    activity = Activity(0.4, 0.2)
    activity.add(advance(born(0, 1), np.zeros((2, 3, 2)), (0.0, 0.0)))
    activity.add(advance((), np.zeros((0, 0, 2)), ()))
    assert not activity.meetings()
    tracks = poses([], 0.2).tracks(())
    assert tracks.shape == (0, 0, 2)
