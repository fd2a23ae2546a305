"""Tests of the surfaces of ground and scenery."""

import math
from pathlib import Path

import numpy as np
import pytest
from rerun.blueprint import Spatial3DView
from rerun.chunk import RrdReader

from analysis.viewer.blueprint import layout
from analysis.viewer.ground import Surface, surfaces
from analysis.viewer.recording import Recording
from analysis.viewer.scene import scene_of
from schema.experiment.document import Arena, Experiment, Islands, Simulation
from schema.experiment.environment import FLAT, Environment, relief
from schema.robot.ids import BirthId

WORLD = Simulation()


def solid(geom: str) -> Surface:
    """Return the surface of the one geom of a scene."""
    scenery = f"<mujoco><worldbody><geom {geom}/></worldbody></mujoco>"
    (found,) = surfaces(Environment(scenery=scenery), WORLD)
    return found


def volume(surface: Surface) -> float:
    """Return what a surface encloses: positive if its triangles face outward."""
    a, b, c = surface.corners.astype(np.float64).transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize(
    ("geom", "half_sizes", "expected"),
    [
        ('type="box" size="0.1 0.2 0.3"', (0.1, 0.2, 0.3), 8 * 0.006),
        ('type="sphere" size="0.3"', (0.3, 0.3, 0.3), 4 / 3 * math.pi * 0.027),
        (
            'type="ellipsoid" size="0.3 0.2 0.1"',
            (0.3, 0.2, 0.1),
            4 / 3 * math.pi * 0.006,
        ),
        ('type="cylinder" size="0.2 0.5"', (0.2, 0.2, 0.5), math.pi * 0.04),
        (
            'type="capsule" size="0.2 0.5"',
            (0.2, 0.2, 0.7),
            math.pi * 0.04 + 4 / 3 * math.pi * 0.008,
        ),
    ],
)
def test_a_shape_has_its_size_and_faces_outward(
    geom: str, half_sizes: tuple[float, float, float], expected: float
) -> None:
    drawn = solid(geom)
    reached = np.abs(drawn.corners).max(axis=(0, 1))
    assert reached == pytest.approx(half_sizes, rel=0.02)
    assert volume(drawn) == pytest.approx(expected, rel=0.05)
    if "box" in geom:
        assert reached == pytest.approx(half_sizes, rel=1e-6)
        assert volume(drawn) == pytest.approx(expected, rel=1e-5)
    lengths = np.linalg.norm(drawn.normals, axis=1)
    assert set(np.round(lengths, 5).tolist()) <= {0.0, 1.0}


def test_scenery_has_its_place_and_colour() -> None:
    """A bar of 2 m by 0.2 m, turned by 30 degrees, about (1, 2, 3)."""
    drawn = solid(
        'type="box" size="1 0.1 0.1" pos="1 2 3" euler="0 0 30" rgba="0 0.5 1 1"'
    )
    assert drawn.colour == (0.0, 0.5, 1.0, 1.0)
    low, high = drawn.corners.min(axis=(0, 1)), drawn.corners.max(axis=(0, 1))
    assert 0.5 * (low + high) == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)
    wide, deep = math.sqrt(0.75) + 0.05, 0.5 + 0.1 * math.sqrt(0.75)
    assert 0.5 * (high - low) == pytest.approx([wide, deep, 0.1], abs=1e-6)


def test_the_light_is_a_ball_at_its_place() -> None:
    (ball,) = surfaces(FLAT, WORLD, (1.0, 2.0, 3.0))
    low, high = ball.corners.min(axis=(0, 1)), ball.corners.max(axis=(0, 1))
    assert 0.5 * (low + high) == pytest.approx([1.0, 2.0, 3.0], abs=1e-3)
    assert 0.5 * (high - low) == pytest.approx([0.03] * 3, abs=1e-3)
    place = (1.0, 0.0, 0.5)
    lit = Environment(light=place)
    scenes = [
        scene_of(Experiment(name="alone", environment=lit)),
        scene_of(Experiment(name="arena", arena=Arena(light=place))),
        scene_of(Experiment(name="dark")),
    ]
    counts = [len(each.surfaces[0]) for each in scenes]
    assert counts == [1, 1, 0]


def test_rough_ground_is_drawn_node_by_node() -> None:
    environment = Environment(roughness_m=0.1, patch_m=0.5, extent_m=1.0)
    (drawn,) = surfaces(environment, WORLD)
    assert len(drawn.corners) == 2 * 4 * 4
    assert (drawn.normals[:, 2] > 0.0).all()
    shares = relief(environment)
    for x, y, z in drawn.corners.reshape(-1, 3).tolist():
        row, column = round((y + 1.0) / 0.5), round((x + 1.0) / 0.5)
        assert z == pytest.approx(0.1 * shares[row, column], abs=1e-7)


def test_ground_is_below_robots_at_their_recorded_places() -> None:
    """Robots of one arena, and a single off-line robot, have ground below them."""
    rough = Environment(roughness_m=0.1, patch_m=0.5, extent_m=1.0)
    islands = (Islands(environment=rough), Islands(environment=rough, arena=Arena()))
    scene = scene_of(Experiment(name="a", islands=islands))
    hermit, other, here, there = (BirthId(k // 2, k % 2) for k in range(4))
    assert len(scene.below([hermit])) == len(scene.below([here, there])) == 1
    assert scene.below([hermit, other]) == scene.below([hermit, here]) == ()
    assert scene.below([]) == ()
    assert surfaces(FLAT, WORLD) == ()
    # What is not shown is said.
    assert scene.omissions([hermit]) == scene.omissions([here, there]) == []
    assert ["stand side by side" in line for line in scene.omissions([])] == [True]
    for apart in ([hermit, other], [hermit, here]):
        assert ["move side by side" in line for line in scene.omissions(apart)] == [
            True
        ]
    assert scene_of(Experiment(name="b", islands=(Islands(),))).omissions([]) == []


def test_an_arena_shows_its_recorded_ground(tmp_path: Path) -> None:
    geom = '<geom type="box" size="0.1 0.1 0.1"/>'
    environment = Environment(
        roughness_m=0.1,
        patch_m=0.5,
        extent_m=1.0,
        scenery=f"<mujoco><worldbody>{geom}</worldbody></mujoco>",
    )
    # Island 0 is off-line: its robots hang side by side, with no ground below them.
    islands = (Islands(), Islands(arena=Arena()))
    scene = scene_of(Experiment(name="a", environment=environment, islands=islands))
    plan = layout(scene)
    with Recording("a", plan, file=tmp_path / "a.rrd") as recording:
        recording.add_scene(scene)
    found = {
        str(chunk.entity_path): chunk.to_record_batch()
        for chunk in RrdReader(tmp_path / "a.rrd")
        .stream()
        .filter(content="/islands/**")
    }
    found = {path: found[path] for path in sorted(found) if "/ground/" in path}
    assert list(found) == ["/islands/1/ground/0", "/islands/1/ground/1"]
    for number, surface in enumerate(scene.surfaces[1]):
        columns = found[f"/islands/1/ground/{number}"]
        (corners,) = columns["Mesh3D:vertex_positions"].to_pylist()
        assert corners == surface.corners.reshape(-1, 3).tolist()
    views: list[object] = [plan.root_container]
    shown: list[str] = []
    while views:
        view = views.pop()
        inside = getattr(view, "contents", ())
        if isinstance(view, Spatial3DView):
            shown += inside
        else:
            views += [] if isinstance(inside, str) else inside
    assert "/islands/1/ground/**" in shown
