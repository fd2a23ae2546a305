"""Tests of pictures of arenas."""

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from analysis.render.arena_picture import ArenaRenderer, Poses
from analysis.render.overlay import Overlay
from analysis.render.stage import HIDDEN_M, Stage, furnish
from schema.experiment.document import ArenaSection
from schema.experiment.file import read_experiment
from schema.experiment.settings import arena_settings_of
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.updates import ArenaSample
from tests.analysis.render.test_picture import mostly

SETTINGS = arena_settings_of(read_experiment("scenario3"))
RED, BLUE = BirthId(0, 0), BirthId(1, 7)
SIZE = 160, 120


def brick(colour: tuple[float, float, float]) -> Robot:
    """Return a core with an active hinge."""
    hinge = Part("ActiveHinge", 0, 2, 0, 0, colour)
    return Robot((Part("Core", -1, -1, -1, 0, colour), hinge))


ROBOTS = {RED: brick((1.0, 0.0, 0.0)), BLUE: brick((0.0, 0.0, 1.0))}


def pose(x: float, y: float, angle: float = 0.0) -> np.ndarray:
    return np.array([x, y, 0.05, 1.0, 0.0, 0.0, 0.0, angle])


@pytest.fixture(params=["gl", "rays"])
def _engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "rays":
        monkeypatch.setenv("MUJOCO_GL", "disable")


def test_no_geom_is_left_out_of_a_picture_of_many() -> None:
    spec = mujoco.MjSpec()
    for _ in range(10_000):
        spec.worldbody.add_geom(size=[0.01] * 3, pos=[0.0, 0.0, HIDDEN_M])
    spec.worldbody.add_geom(size=[0.3] * 3, rgba=[1.0, 0.0, 0.0, 1.0])
    furnish(None, None, 1.0, spec)
    stage = Stage(spec.compile(), SIZE, is_fine=False)
    stage.pose(np.zeros(0))
    assert len(mostly(stage.picture(np.zeros(3), 3.0), 0)) > 1000
    stage.close()


@pytest.mark.usefixtures("_engine")
def test_robots_are_at_their_places_while_they_live() -> None:
    frames: list[Poses] = [
        {RED: pose(-0.5, 0.0), BLUE: pose(0.5, 0.0)},
        {BLUE: pose(0.5, 0.0, 1.0)},
        {},
    ]
    with ArenaRenderer(ROBOTS, SETTINGS, frames, Overlay(), size=SIZE) as renderer:
        both, alone, empty = map(renderer.picture, frames)
        again = renderer.picture(frames[0])
    red, blue = mostly(both, 0), mostly(both, 2)
    assert min(len(red), len(blue)) > 20
    # The camera looks along (-0.64, 0.77), so +x is to its right.
    assert red[:, 1].max() < blue[:, 1].min()
    for found in (red, blue):
        assert (found > 0).all()
        assert (found < (119, 159)).all()
    assert len(mostly(alone, 0)) == len(mostly(empty, 0)) == len(mostly(empty, 2)) == 0
    assert mostly(alone, 2).mean(axis=0) == pytest.approx(blue.mean(axis=0), abs=3)
    # The hinge has turned.
    assert mostly(alone, 2).tolist() != blue.tolist()
    assert mostly(again, 0).tolist() == red.tolist()
    assert mostly(again, 2).tolist() == blue.tolist()


@pytest.mark.usefixtures("_engine")
def test_patches_lie_below_painted_robots_and_lines_join_them() -> None:
    frame = {RED: pose(-0.4, 0.0), BLUE: pose(0.4, 0.0)}
    patch = (-0.4, 0.0, 0.3, 5.0)
    sample = ArenaSample(0, 2.0, "energy", ((BLUE, 7.0),), 1.0, patches=(patch,))
    pairs = ((RED, BLUE, True),)
    pictures = []
    for samples in ((), (sample,), (replace(sample, pairs=pairs),)):
        overlay = Overlay(samples)
        with ArenaRenderer(ROBOTS, SETTINGS, [frame], overlay, size=SIZE) as renderer:
            before, shown = (renderer.picture(frame, time_s) for time_s in (1.9, 2.0))
        pictures += [before, shown]
    plain, _, unfed, fed, unmet, met = pictures
    assert (plain == unfed).all()
    assert (plain == unmet).all()
    red, blue = mostly(plain, 0), mostly(plain, 2)
    # The robot whose store is known is yellow, the other one keeps its colours.
    assert len(mostly(fed, 0)) == pytest.approx(len(red), rel=0.1)
    assert not len(mostly(fed, 2))
    row, column = blue[len(blue) // 2]
    assert fed[row, column, 0] > 3 * fed[row, column, 2]
    # The patch is around the first robot, and hides none of it.
    green = np.argwhere((plain != fed).any(axis=2) & (fed.argmax(axis=2) == 1))
    assert (green.min(axis=0) < red.min(axis=0)).all()
    assert (green.max(axis=0) > red.max(axis=0)).all()
    # The line begins and ends above the robots.
    line = np.argwhere((fed != met).any(axis=2))
    assert line[:, 1].min() == pytest.approx(red[:, 1].mean(), abs=6)
    assert line[:, 1].max() == pytest.approx(blue[:, 1].mean(), abs=6)


@pytest.mark.parametrize(
    ("place", "arena"),
    [
        # Between the camera, which looks along (-0.64, 0.77), and the robot.
        ((0.2, -0.2), ArenaSection(wall_diameter_m=0.9, wall_height_m=2.0)),
        ((0.0, 0.0), ArenaSection(wall_diameter_m=0.6)),
    ],
)
def test_the_wall_is_rendered_and_hides_no_robot(
    place: tuple[float, float], arena: ArenaSection
) -> None:
    frame = {RED: pose(*place)}
    pictures = []
    for settings in (SETTINGS, replace(SETTINGS, arena=arena)):
        alone = {RED: ROBOTS[RED]}
        with ArenaRenderer(alone, settings, [frame], Overlay(), size=SIZE) as made:
            pictures.append(made.picture(frame))
    assert (pictures[0] != pictures[1]).any()
    plain, walled = (mostly(picture, 0) for picture in pictures)
    assert len(plain) > 20
    assert len(walled) == pytest.approx(len(plain), rel=0.1)
    # The camera did not move.
    assert walled.mean(axis=0) == pytest.approx(plain.mean(axis=0), abs=10)
