"""Tests of the surfaces of ground and scenery."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from rerun.blueprint import Spatial3DView
from rerun.chunk import RrdReader

from analysis.viewer.blueprint import layout
from analysis.viewer.ground import Relief, surfaces
from analysis.viewer.recording import Recording
from analysis.viewer.scene import Scene, scene_of
from schema.experiment.document import ArenaSection, Experiment, Islands, Simulation
from schema.experiment.environment import FLAT, Environment, relief
from schema.experiment.scenery import Solid
from schema.robot.ids import BirthId

WORLD = Simulation()


SCENERY = "<mujoco><worldbody><geom {}/></worldbody></mujoco>"


def recorded(scene: Scene, folder: Path) -> dict[str, pa.RecordBatch]:
    """Return what is recorded of the ground and the scenery, by entity."""
    with Recording("a", layout(scene), file=folder / "a.rrd") as recording:
        recording.add_scene(scene)
    chunks = RrdReader(folder / "a.rrd").stream().filter(content="/islands/**")
    found = {str(chunk.entity_path): chunk.to_record_batch() for chunk in chunks}
    return {path: found[path] for path in sorted(found) if "/ground/" in path}


def shown(geom: str, folder: Path) -> dict[str, Any]:
    """Return what is recorded of the one geom of an arena's scenery."""
    environment = Environment(scenery=SCENERY.format(geom))
    scene = scene_of(
        Experiment(name="a", arena=ArenaSection(), environment=environment)
    )
    (rows,) = recorded(scene, folder).values()
    (row,) = rows.to_pylist()
    return {name.partition(":")[2]: value for name, value in row.items()}


TURN = 'pos="1 2 3" euler="0 90 0" rgba="0 0.2 1 1"'
"""The axis of a shape is along x."""


@pytest.mark.parametrize(
    ("geom", "expected"),
    [
        ('type="box" size="0.1 0.2 0.3"',
         {"half_sizes": [[0.1, 0.2, 0.3]], "centers": [[1, 2, 3]]}),
        ('type="sphere" size="0.3"',
         {"half_sizes": [[0.3, 0.3, 0.3]], "centers": [[1, 2, 3]]}),
        ('type="ellipsoid" size="0.3 0.2 0.1"',
         {"half_sizes": [[0.3, 0.2, 0.1]], "centers": [[1, 2, 3]]}),
        ('type="cylinder" size="0.2 0.5"',
         {"radii": [0.2], "lengths": [1.0], "centers": [[1, 2, 3]]}),
        # The viewer places a capsule by an end of its axis.
        ('type="capsule" size="0.2 0.5"',
         {"radii": [0.2], "lengths": [1.0], "translations": [[0.5, 2, 3]]}),
    ],
)  # fmt: skip
def test_scenery_has_its_size_place_and_colour(
    geom: str, expected: dict[str, Any], tmp_path: Path
) -> None:
    found = shown(f"{geom} {TURN}", tmp_path)
    for name, values in expected.items():
        assert np.array(found[name]) == pytest.approx(np.array(values), abs=1e-6), name
    assert found["colors"] == [0x0033FFFF]
    turn = np.array([0.0, 0.5**0.5, 0.0, 0.5**0.5])
    assert np.abs(found["quaternions"][0] @ turn) == pytest.approx(1.0, abs=1e-6)


def test_the_light_is_a_ball_at_its_place() -> None:
    place = (1.0, 2.0, 3.0)
    (ball,) = surfaces(FLAT, WORLD, place)
    assert isinstance(ball, Solid)
    assert (ball.shape, ball.size[0]) == ("sphere", 0.03)
    assert tuple(ball.centre) == place
    scenes = [
        scene_of(Experiment(name="alone", environment=Environment(light=place))),
        scene_of(Experiment(name="arena", arena=ArenaSection(light=place))),
        scene_of(Experiment(name="dark")),
    ]
    assert [len(each.surfaces[0]) for each in scenes] == [1, 1, 0]


def test_rough_ground_is_drawn_node_by_node() -> None:
    environment = Environment(roughness_m=0.1, patch_m=0.5, extent_m=1.0)
    (drawn,) = surfaces(environment, WORLD)
    assert isinstance(drawn, Relief)
    assert len(drawn.corners) == 2 * 4 * 4
    assert (drawn.normals[:, 2] > 0.0).all()
    shares = relief(environment)
    for x, y, z in drawn.corners.reshape(-1, 3).tolist():
        row, column = round((y + 1.0) / 0.5), round((x + 1.0) / 0.5)
        assert z == pytest.approx(0.1 * shares[row, column], abs=1e-7)


def test_ground_is_below_robots_at_their_recorded_places() -> None:
    """Robots of one arena, and a single off-line robot, have ground below them."""
    rough = Environment(roughness_m=0.1, patch_m=0.5, extent_m=1.0)
    islands = (
        Islands(environment=rough),
        Islands(environment=rough, arena=ArenaSection()),
    )
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
    scenery = SCENERY.format('type="box" size="0.1 0.1 0.1"')
    environment = Environment(
        roughness_m=0.1, patch_m=0.5, extent_m=1.0, scenery=scenery
    )
    # Island 0 is off-line: its robots hang side by side, with no ground below them.
    islands = (Islands(), Islands(arena=ArenaSection()))
    scene = scene_of(Experiment(name="a", environment=environment, islands=islands))
    found = recorded(scene, tmp_path)
    assert list(found) == ["/islands/1/ground/0", "/islands/1/ground/1"]
    (ground, _) = scene.surfaces[1]
    assert isinstance(ground, Relief)
    (corners,) = found["/islands/1/ground/0"]["Mesh3D:vertex_positions"].to_pylist()
    assert corners == ground.corners.reshape(-1, 3).tolist()
    views: list[object] = [layout(scene).root_container]
    shown: list[str] = []
    while views:
        view = views.pop()
        inside = getattr(view, "contents", ())
        if isinstance(view, Spatial3DView):
            shown += inside
        else:
            views += [] if isinstance(inside, str) else inside
    assert "/islands/1/ground/**" in shown
