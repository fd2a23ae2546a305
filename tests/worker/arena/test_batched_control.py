"""Batched readings and commands equal those of single robots, to the last bit."""

from collections.abc import Callable

import numpy as np

from schema.robot.robot import Robot
from tests.worker.arena_cases import SETTINGS, crowd, populated, seconds
from worker.arena.world import World


def one_by_one(world: World) -> list[tuple[np.ndarray, list[float]]]:
    """Return readings and commands of all robots, computed one by one."""
    found = []
    tick_s = 25 * 0.005
    outputs = np.random.default_rng(3).uniform(-0.2, 1.2, (len(world.births), 40))
    for one, own in zip(world.population.robots, outputs, strict=True):
        view, velocities = one.view, list(one.view.sensors.velocities)
        readings, commands = view.sensors.readings.copy(), view.ctrl.copy()
        view.sensors.read(tick_s)
        read = view.sensors.readings.copy()
        view.sensors.readings[:], view.sensors.velocities = readings, velocities
        view.servos.drive(own)
        commanded = view.ctrl.tolist()
        view.ctrl[:] = commands
        found.append((read, commanded))
    return found


def test_batched_readings_and_commands_equal_single_ones(
    robot_of: Callable[[int], Robot],
) -> None:
    world = populated(SETTINGS, crowd(robot_of, 16, 0.6))
    seconds(world, 2.0)
    world.advance(world.step + 23)
    expected = one_by_one(world)
    batched_io, layout = world._io, world.population.layout
    assert any(len(cluster.members) > 1 for cluster in world.population.clusters)
    state = layout.read()
    batched_io.settle(layout)
    batched_io.read(state)
    outputs = np.random.default_rng(3).uniform(-0.2, 1.2, (len(world.births), 40))
    batched_io.drive(state, outputs)
    pads = 0
    for row, (one, (read, commanded)) in enumerate(
        zip(world.population.robots, expected, strict=True)
    ):
        assert batched_io.readings[row].tobytes() == read.tobytes()
        assert one.view.sensors.readings is not read
        assert one.view.ctrl.tolist() == commanded
        pads += len(one.view.sensors.pads)
    assert pads > 0
