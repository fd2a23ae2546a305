"""Tests of recorded motion, and of robots side by side."""

import numpy as np
import pytest
from msgspec.structs import replace

from analysis.render.film import way_marks, with_scale
from analysis.render.motion import frames, recorded, side_by_side
from analysis.render.picture import RobotRenderer
from schema.formats.files import settings_of
from schema.robot.trace import Floats
from worker.bench.spider import spider
from worker.robot.evaluation import simulate

SPIDER = spider()
SETTINGS = settings_of(None)
CLOCK = replace(SETTINGS.simulation, warmup_steps=0, window_steps=100)
SHORT = replace(SETTINGS, simulation=CLOCK)


def test_states_between_ticks_lead_from_tick_to_tick() -> None:
    """One per physics step: those of ticks are the simulation's own, bit for bit."""
    at_ticks: list[Floats] = []
    simulate(SPIDER, SHORT, watch=lambda data: at_ticks.append(data.qpos.copy()))
    poses = recorded(simulate, SPIDER, SHORT, CLOCK.timestep_s)
    assert np.array_equal(poses[:: CLOCK.brain_steps], at_ticks)
    assert len({pose.tobytes() for pose in poses}) == len(poses)
    every = recorded(simulate, SPIDER, SHORT, 0.04)
    assert np.array_equal(every, poses[:: round(0.04 / CLOCK.timestep_s)])


def walk(angle: float, length_m: float, count: int) -> list[Floats]:
    """Return states of a robot without joints that walks straight ahead."""
    half = angle / 2
    steps = np.linspace(0.0, length_m, count)
    return [
        np.array([
            3 + np.cos(angle) * s, 4 + np.sin(angle) * s, 0.1,
            np.cos(half), 0.0, 0.0, np.sin(half),
        ])
        for s in steps
    ]  # fmt: skip


def test_robots_side_by_side_keep_their_speed_and_go_one_way() -> None:
    """Wherever they looked, all look and go to the right of the camera in the end."""
    motions = [walk(0.3, 1.0, 5), walk(2.5, 0.5, 3)]
    joined = np.array(
        side_by_side(motions, {"a": (SPIDER, SHORT), "b": (SPIDER, SHORT)})
    )
    assert joined.shape == (5, 14)
    right = np.array([np.sin(np.radians(130)), -np.cos(np.radians(130))])
    first, second = joined[:, :7], joined[:, 7:]
    assert first[-1, :2] - first[0, :2] == pytest.approx(right)
    assert second[2, :2] - second[0, :2] == pytest.approx(0.5 * right)
    assert np.array_equal(second[4], second[2])  # it waits
    assert (second[0, :2] - first[0, :2]) @ right == pytest.approx(0.0)  # start line
    assert np.linalg.norm(second[0, :2] - first[0, :2]) > 0.5
    for lane in (first, second):
        assert 2 * lane[0, 6] * lane[0, 3] == pytest.approx(right[1])  # sine of the yaw


def test_cameras_follow_or_stand_still() -> None:
    with RobotRenderer(SPIDER, SHORT) as renderer:
        start = renderer.stage.data.qpos.copy()
        poses = [start.copy() for _ in range(50)]
        for at, pose in enumerate(poses):
            pose[:2] += 0.02 * at * np.array([0.0, 1.0])
        follow = frames(renderer, poses, "follow", 0.04)
        fixed = frames(renderer, poses, "fixed", 0.04)
        side = frames(renderer, poses, "side", 0.04)
        # The view is along -x: what goes along +y goes to the right.
        assert renderer.stage.view[0] == pytest.approx(180.0)
        columns = renderer.stage.pixels(
            np.array([poses[0][:3], poses[-1][:3]]), *side[0]
        )[:, 0]
    moved = follow[30][0] - follow[15][0]
    assert moved == pytest.approx([0.0, 0.3, 0.0])
    assert fixed[0][1] > follow[0][1]
    assert all(one is fixed[0] for one in fixed)
    assert 0 < columns[0] < columns[1] < 640


def test_the_trail_grows_with_the_way_from_its_start() -> None:
    with RobotRenderer(SPIDER, SHORT) as renderer:
        start = renderer.stage.data.qpos.copy()
        poses = [start + np.eye(len(start))[0] * at for at in range(4)]
        marks = way_marks(renderer, poses, has_trail=True, has_start=True)
        low = renderer.lowest_m(start)
    assert [when for when, _ in marks] == pytest.approx([0.0, 1 / 3, 2 / 3, 1.0])
    assert marks[0][1][0][2] == pytest.approx(low, abs=1e-3)
    assert [one[0][0] for _, one in marks[1:]] == pytest.approx([0.5, 1.5, 2.5])


def test_the_scale_bar_is_as_long_as_it_says() -> None:
    """From 1 m, 480 pixels are 2 tan 15 = 0.536 m; the bar is at most 128 pixels."""
    picture = with_scale(np.full((480, 640, 3), 255, np.uint8), 1.0)
    row = picture[480 - 16 - 1]
    assert (row[:, 0] < 128).sum() == pytest.approx(0.1 * 480 / 0.536, abs=1.5)
