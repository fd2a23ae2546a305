"""Models of robots in clusters: spheres, pairs that are near, tracks."""

from collections.abc import Callable
from itertools import combinations

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robogen_parts import ACTIVE_WHEEL
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats, Trace
from tests.plugins.crawlers import PISTON
from tests.worker.arena_cases import SETTINGS, crowd, populated, seconds, settings_of
from worker.arena.world import World
from worker.clusters.models import bounding_spheres
from worker.clusters.proximity import FASTEST, Proximity, RobotBounds
from worker.clusters.robot import FitnessWindow
from worker.clusters.states import Pairs
from worker.fitness import load_fitness, path_velocity, straight_velocity

GREY = (0.5, 0.5, 0.5)
ROBOT = Robot(
    (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("Piston", 0, 0, 0, 0, GREY),
        Part("ActiveHinge", 1, 1, 0, 0, GREY),
        Part("Piston", 2, 1, 1, 90, GREY),
        Part("ActiveWheel", 3, 0, 0, 0, (70.0, *GREY)),
    )
)
SPACE = {**BUILT_IN, "Piston": PISTON, "ActiveWheel": ACTIVE_WHEEL}


def surface(model: mujoco.MjModel, geom: int) -> Floats:
    """Return points on the edges of a geom, (N, 3), in its frame."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        return np.asarray(signs * model.geom_size[geom])
    radius, half = model.geom_size[geom, :2]
    turn = np.linspace(0.0, 2.0 * np.pi, 48)
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn + half], 1)
    return np.concatenate([rim, rim * (1.0, 1.0, -1.0)])


def test_spheres_cover_all_points_and_weights_bound_all_speeds() -> None:
    model = solo_spec(ROBOT, SPACE, Simulation(drop_m=1.0), FLAT).compile()
    data = mujoco.MjData(model)
    bounds = bounding_spheres(model)
    root = int(model.jnt_bodyid[0])
    rng = np.random.default_rng(5)
    slack = np.inf
    for _ in range(30):
        data.qpos[7:] = np.array([0.015, 0.7, 0.015, 9.0]) * rng.uniform(-1, 1, 4)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        bound = float(np.abs(data.qvel) @ bounds.weights)
        for geom in range(model.ngeom):
            body = int(model.geom_bodyid[geom])
            if body < root:
                continue
            turn = data.geom_xmat[geom].reshape(3, 3)
            points = data.geom_xpos[geom] + surface(model, geom) @ turn.T
            own = bounds.bodies == body - root
            frame = data.xmat[body].reshape(3, 3)
            centres = data.xpos[body] + bounds.centres[own, :3] @ frame.T
            away = np.linalg.norm(points[:, None] - centres, axis=2)
            assert (away <= bounds.radii[own] + 1e-9).any(axis=1).all()
            jacobian = np.empty((3, model.nv))
            for point in points:
                mujoco.mj_jac(model, data, jacobian, None, point, body)
                speed = float(np.linalg.norm(jacobian @ data.qvel))
                slack = min(slack, bound - speed)
                assert speed <= bound
    # The bound is no more than a few times the greatest speed.
    assert 0.0 <= slack < 3.0


Robots = Callable[[int], Robot]


def pairs_of_clusters(world: World) -> Pairs:
    """Return all pairs of robots in different clusters."""
    clusters = [world.population.cluster_of[birth] for birth in world.births]
    pairs = combinations(range(len(clusters)), 2)
    return [pair for pair in pairs if clusters[pair[0]] is not clusters[pair[1]]]


def measured(world: World, bounds: RobotBounds, pairs: Pairs, gap_m: float) -> Pairs:
    """Return the pairs that are near, from the distances of all of them."""
    steps = world.population.model_cache.settings.arena.proximity_steps + 1
    moves = np.minimum(bounds.speeds[0], FASTEST) * steps * 0.005
    return [
        (first, second)
        for first, second in pairs
        if distance(world, first, second) < moves[first] + moves[second] + gap_m
    ]


def distance(world: World, first: int, second: int) -> float:
    """Return the least distance of a sphere of each of two robots [m]."""
    layout = world.population.layout
    rows = layout.robot_rows
    spheres = np.arange(len(rows.radii))
    (centres,) = layout.spheres(layout.read()[np.newaxis], spheres)
    owners = np.searchsorted(rows.first_bodies, rows.sphere_bodies, side="right") - 1
    here, there = owners == first, owners == second
    gaps = centres[:, here, None] - centres[:, None, there]
    apart = np.sqrt((gaps**2).sum(axis=0)) - rows.radii[here, None] - rows.radii[there]
    return float(apart.min())


@pytest.mark.parametrize("gap_m", [0.02, 0.1, 0.5])
def test_pairs_to_merge_and_to_keep_equal_those_of_all_measurements(
    robot_of: Robots, gap_m: float
) -> None:
    """For falling robots, with distances greater than the arena's as well."""
    world = populated(settings_of(drop_m=0.5), crowd(robot_of, 20, 1.2))
    proximity = Proximity(settings_of(merge_distance_m=gap_m, split_distance_m=gap_m))
    pairs = 0
    for _ in range(12):
        seconds(world, 0.125)
        layout = world.population.layout
        bounds = RobotBounds(layout, layout.read()[np.newaxis])
        found = proximity.pairs_to_merge(bounds)[0]
        pairs_apart = pairs_of_clusters(world)
        assert found == measured(world, bounds, pairs_apart, gap_m)
        assert not pairs_apart or proximity.pairs_to_keep(bounds, pairs_apart) == found
        pairs += len(found)
    assert pairs > 0 or gap_m < 0.1


CLOCK = Simulation(
    timestep_s=0.01, pose_steps=10, brain_steps=10, window_steps=80, warmup_steps=20
)
"""Samples every 0.1 s, a window of 0.8 s, a warm-up of 0.2 s."""


def track(window: FitnessWindow) -> Trace:
    return Trace(0.1, np.array(window.positions))


def test_window_excludes_fall_and_warm_up() -> None:
    window = FitnessWindow(CLOCK, born=100)
    window.add(110, (9.0, 9.0, 9.0))
    assert not window.positions
    window.add(120, (0.0, 0.0, 0.0))
    window.add(130, (0.1, 0.0, 0.0))
    has_fitness = [window.has_fitness]
    window.add(140, (0.1, 0.1, 5.0))
    has_fitness.append(window.has_fitness)
    assert has_fitness == [False, True]
    assert path_velocity(track(window)) == pytest.approx(1.0)
    assert straight_velocity(track(window)) == pytest.approx(2**0.5 / 2)


def test_window_is_mature_after_warm_up_and_window() -> None:
    """200 + 800 ms: from the sample at age 1 s on."""
    window = FitnessWindow(CLOCK, born=50)
    mature = []
    for step in range(50, 200, 10):
        window.add(step, (0.0, 0.0, 0.0))
        mature.append(window.is_mature)
    assert mature.index(True) == (20 + 80) // 10


def test_window_drops_old_samples() -> None:
    """East at 1 m/s for 0.8 s, then back west: after 0.4 s of that s is 0."""
    window = FitnessWindow(CLOCK, born=0)
    places = [0.1 * min(n, 16 - n) for n in range(17)]
    straight, path = [], []
    for number, x in enumerate(places):
        window.add(20 + 10 * number, (x, 0.0, 0.0))
        if window.is_mature:
            straight.append(straight_velocity(track(window)))
            path.append(path_velocity(track(window)))
    assert straight == pytest.approx([1.0, 0.75, 0.5, 0.25, 0.0, 0.25, 0.5, 0.75, 1.0])
    assert path == pytest.approx([1.0] * 9)
    assert len(window.positions) == 9


def test_fitness_of_the_window_uses_the_experiment_s_weights() -> None:
    window = FitnessWindow(CLOCK, born=0)
    for number in range(9):
        window.add(20 + 10 * number, (0.01 * number, 0.0, 0.0))
    fitness = replace(SETTINGS.fitness, path_weight=1.0, straight_weight=5.0)
    assert load_fitness(fitness).value(track(window)) == pytest.approx(0.6)
