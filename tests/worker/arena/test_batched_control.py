"""Batches feel and command what one robot does, to the last bit."""

from collections.abc import Callable

import numpy as np

from schema.robot.robot import Robot
from tests.worker.arena_cases import SETTINGS, crowd, populated, seconds
from worker.arena.world import World


def lonely(world: World) -> list[tuple[np.ndarray, list[float]]]:
    """Return readings and commands of all, felt and told one by one."""
    found = []
    tick_s = 25 * 0.005
    outputs = np.random.default_rng(3).uniform(-0.2, 1.2, (len(world.births), 40))
    for one, own in zip(world.population.robots, outputs, strict=True):
        view, velocities = one.view, list(one.view.sensors.velocities)
        readings, commands = view.sensors.readings.copy(), view.ctrl.copy()
        view.sensors.read(tick_s)
        felt = view.sensors.readings.copy()
        view.sensors.readings[:], view.sensors.velocities = readings, velocities
        view.servos.drive(own)
        told = view.ctrl.tolist()
        view.ctrl[:] = commands
        found.append((felt, told))
    return found


def test_a_batch_feels_and_commands_as_each_alone_would(
    robot_of: Callable[[int], Robot],
) -> None:
    world = populated(SETTINGS, crowd(robot_of, 16, 0.6))
    seconds(world, 2.0)
    world.advance(world.step + 23)
    expected = lonely(world)
    batched_io, layout = world._io, world.population.layout
    assert any(len(cluster.members) > 1 for cluster in world.population.clusters)
    state = layout.read()
    batched_io.settle(layout)
    batched_io.read(state)
    outputs = np.random.default_rng(3).uniform(-0.2, 1.2, (len(world.births), 40))
    batched_io.drive(state, outputs)
    pads = 0
    for row, (one, (felt, told)) in enumerate(
        zip(world.population.robots, expected, strict=True)
    ):
        assert batched_io.readings[row].tobytes() == felt.tobytes()
        assert one.view.sensors.readings is not felt
        assert one.view.ctrl.tolist() == told
        pads += len(one.view.sensors.pads)
    assert pads > 0
