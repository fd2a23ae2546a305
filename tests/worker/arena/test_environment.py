"""Physics of robots on slopes, on rough ground and among scenery."""

import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError
from schema.experiment.document import Simulation
from schema.experiment.environment import Environment
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.arena import Insertion
from tests.schema import robots
from tests.worker.arena_cases import SECOND, placed, populated, seconds, settings_of
from tests.worker.evaluations import with_simulation
from worker.arena.world import World
from worker.robot.evaluation import simulate

Robots = Callable[[int], Robot]
A, B = BirthId(0, 0), BirthId(0, 1)
BOX = robots.robot_of()
"""A core alone, 9 cm by 9 cm by 4.5 cm, with its imu."""
WITH_PADS = robots.robot_of(Part("TouchSensor", 0, 3, 0, 0, robots.GREY))
"""The same with two pads in front of its face towards -x."""
G = 9.81


def scene(*geoms: str) -> str:
    return f"<mujoco><worldbody>{''.join(geoms)}</worldbody></mujoco>"


WILD = Environment(
    slope_deg=8.0,
    roughness_m=0.04,
    extent_m=2.0,
    scenery=scene(
        '<geom type="box" size="0.1 0.1 0.1" pos="0.3 0 0.1" euler="0 0 20"/>',
        '<geom type="sphere" size="0.15" pos="-0.2 0.3 0"/>',
    ),
)
WALL = scene('<geom type="box" size="0.05 2 0.3" pos="-1.05 0 0.3"/>')


def alone(simulation: Simulation, environment: Environment) -> EvaluationSettings:
    return with_simulation(simulation, environment=environment)


def arena(environment: Environment, **keys: object) -> ArenaSettings:
    return replace(settings_of(**keys), environment=environment)


@pytest.mark.parametrize("slope_deg", [0.0, 20.0, 35.0])
def test_imu_at_rest_on_a_slope_reads_the_components_of_gravity(
    slope_deg: float,
) -> None:
    """The readings are g sin a along x, uphill, and g cos a along z."""
    settings = arena(Environment(slope_deg=slope_deg), drop_m=0.01)
    world = populated(settings, placed(BOX, (0.5, 0.0)))
    seconds(world, 2.0)
    readings = world.population.find(A).view.sensors.readings[0, :6].tolist()
    slope = math.radians(slope_deg)
    expected = [G * math.sin(slope), 0.0, G * math.cos(slope), 0.0, 0.0, 0.0]
    assert readings == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("slope_deg", [5.0, 30.0])
def test_box_without_friction_accelerates_down_the_slope(slope_deg: float) -> None:
    """It moves by g sin(a) t^2 / 2 towards -x: 2.45 m in a second at 30 degrees."""
    clock = Simulation(friction=0.0, window_steps=400)
    track = simulate(BOX, alone(clock, Environment(slope_deg=slope_deg)))
    times = np.arange(len(track.core_position)) * track.interval_s
    expected = -0.5 * G * math.sin(math.radians(slope_deg)) * times**2
    assert track.core_position[:, 0] == pytest.approx(expected, rel=0.01, abs=0.02)
    assert np.abs(track.core_position[:, 1]).max() < 1e-6
    assert np.ptp(track.core_position[:, 2]) < 1e-3


def test_wall_stops_a_sliding_robot_and_its_touch_sensors_read_it() -> None:
    """Pads reach 5.5 cm from the core's centre; the wall's face is at x = -1 m."""
    settings = arena(Environment(slope_deg=20.0, scenery=WALL), drop_m=0.0)
    slippery = replace(settings, simulation=replace(settings.simulation, friction=0.0))
    world = populated(slippery, [Insertion(A, WITH_PADS, (0.0, 0.0))])
    view = world.population.find(A).view
    seconds(world, 0.5)
    assert view.sensors.readings[0, 6:8].tolist() == [0.0, 0.0]
    assert -1.0 < view.qpos[0] < -0.3
    seconds(world, 3.0)
    assert view.sensors.readings[0, 6:8].tolist() == [1.0, 1.0]
    assert view.qpos[0] == pytest.approx(-1.0 + 0.0555, abs=2e-3)
    assert np.abs(view.qvel[:3]).max() < 1e-3
    without_wall = replace(slippery, environment=Environment(slope_deg=20.0))
    free = populated(without_wall, placed(WITH_PADS, (0.0, 0.0)))
    seconds(free, 3.5)
    assert free.population.find(A).view.qpos[0] < -10.0


def test_robots_stay_above_rough_ground(robot_of: Robots) -> None:
    """They start without contact; penetration is that of soft contacts."""
    environment = Environment(roughness_m=0.05, patch_m=0.05, extent_m=1.0)
    depths: list[float] = []

    def watch(data: mujoco.MjData) -> None:
        # The ground and what rises above it are the model's first two geoms.
        is_ground = data.contact.geom.min(axis=1) <= 1
        depths.append(-float(data.contact.dist[is_ground].min(initial=0.0)))
        assert data.geom_xpos[2:, 2].min() > 0.0

    for seed in (0, 2, 3):
        depths.clear()
        clock = Simulation(window_steps=800)
        simulate(robot_of(seed), alone(clock, environment), watch=watch)
        assert depths[0] == 0.0
        assert 0.0 < max(depths) < 0.004


def test_robot_alone_in_an_arena_has_the_off_line_track(robot_of: Robots) -> None:
    """The same to the last bit: on a slope, on rough ground, beside scenery."""
    robot, settings = robot_of(3), arena(WILD)
    world = populated(settings, [Insertion(A, robot, (0.0, 0.0))])
    world.advance(600 + 800)
    simulation = replace(
        settings.simulation, drop_m=settings.arena.drop_m, window_steps=800
    )
    track = simulate(robot, alone(simulation, WILD))
    own = np.array(world.population.find(A).window.positions)
    positions = own[-len(track.core_position) :]
    assert positions.tobytes() == track.core_position.tobytes()


def test_robots_on_one_obstacle_are_not_in_contact() -> None:
    """Contacts with scenery neither count nor merge clusters."""
    slab = scene('<geom type="box" size="2 2 0.1" pos="0 0 0.1"/>')
    settings = arena(Environment(scenery=slab), record_touches=True, drop_m=0.0)
    world = populated(settings, placed(BOX, (-0.3, 0.0), (0.3, 0.0)))
    assert seconds(world, 1.0).touches == ()
    assert len(world.population.clusters) == 2
    world = populated(settings, placed(BOX, (0.0, 0.0), (0.095, 0.0)))
    assert seconds(world, 1.0).touches == ()
    (cluster,) = world.population.clusters
    assert cluster.data.ncon >= 8
    for birth in (A, B):
        core = world.population.find(birth).view
        assert core.qpos[2] == pytest.approx(0.2 + 0.0225, abs=1e-3)
        assert core.geoms[1] - core.geoms[0] == 1


def test_robots_are_born_on_top_of_obstacles() -> None:
    """A block 0.2 m high and a drop of 0.05 m; a heading of 45 degrees clears it."""
    block = scene('<geom type="box" size="0.1 0.1 0.1" pos="0 0 0.1"/>')
    settings = arena(Environment(scenery=block), drop_m=0.05)
    # The core's side is 45 mm away, its corner 63.6 mm.
    for place, heading, expected in (
        ((0.0, 0.0), 0.0, 0.2),
        ((0.14, 0.0), 0.0, 0.2),
        ((0.15, 0.0), 0.0, 0.0),
        ((0.15, 0.0), 0.25 * math.pi, 0.2),
    ):
        world = populated(settings, [Insertion(A, BOX, place, heading)])
        one = world.population.find(A)
        assert one.place == tuple(one.view.qpos[:3])
        assert one.place[2] == pytest.approx(expected + 0.05 + 0.0225, abs=3e-5)


def rolled(x: float) -> float:
    """Return how far a ball rolls that lies at x, while a core stands at 0 [m]."""
    ball = '<geom type="sphere" size="0.03" mass="0.01"/>'
    scenery = scene(f'<body pos="{x} 0 0.03"><freejoint/>{ball}</body>')
    places: list[float] = []
    simulate(
        BOX,
        alone(Simulation(window_steps=2 * SECOND), Environment(scenery=scenery)),
        watch=lambda data: places.append(float(data.qpos[7])),
    )
    return places[-1] - x


def test_a_robot_moves_the_objects_that_it_touches() -> None:
    """A core falls off a ball below its edge; another ball is out of reach."""
    assert abs(rolled(0.04)) > 0.01
    assert rolled(0.3) == pytest.approx(0.0, abs=1e-4)


def test_objects_are_refused_by_arenas_in_one_line() -> None:
    body = '<body pos="1 0 1"><freejoint/><geom type="sphere" size="0.1"/></body>'
    with pytest.raises(ExperimentError, match="arenas have no objects") as raised:
        World(arena(Environment(scenery=scene(body))))
    assert "\n" not in str(raised.value)
