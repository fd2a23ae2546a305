"""Contacts of the last step, near scenery that has a gap."""

import mujoco
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.environment import Environment
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robot.ids import BirthId
from schema.robot.robot import Part
from schema.wire.arena import Insertion
from tests.schema.robots import GREY, robot_of
from tests.worker.arena_cases import populated, settings_of
from worker.robot.devices import Sensors, Servos
from worker.robot.placed import PlacedRobot
from worker.robot.recording import Probe

WITH_PADS = robot_of(Part("TouchSensor", 0, 3, 0, 0, GREY))
"""A core with two pads in front of its face towards -x, 5.55 cm from its centre."""


@pytest.mark.parametrize(
    ("x", "gap_m", "touches"),
    [(0.0, 0.0, 0.0), (0.0, 0.03, 0.0), (-0.01, 0.0, 1.0), (-0.01, 0.03, 1.0)],
)
def test_contacts_within_a_gap_do_not_count(
    x: float, gap_m: float, touches: float
) -> None:
    """The pads end 9.5 mm from a wall, or 0.5 mm in it."""
    geom = f'<geom type="box" size="0.05 2 0.3" pos="-0.115 0 0.3" gap="{gap_m}"/>'
    scenery = f"<mujoco><worldbody>{geom}</worldbody></mujoco>"
    environment = Environment(scenery=scenery)
    model = solo_spec(WITH_PADS, BUILT_IN, Simulation(), environment).compile()
    data = mujoco.MjData(model)
    data.qpos[0] = x
    sensors = Sensors(PlacedRobot(WITH_PADS, BUILT_IN, model, data), width=8)
    assert sensors.start()[0, 6:].tolist() == [touches, touches]
    placed = PlacedRobot(WITH_PADS, BUILT_IN, model, data)
    probe = Probe(placed, Servos(placed).actuators)
    probe.read()
    assert probe.numbers[-1] == touches
    settings = replace(settings_of(drop_m=0.0), environment=environment)
    world = populated(settings, [Insertion(BirthId(0, 0), WITH_PADS, (0.0, 0.0))])
    (robot,) = world.population.robots
    robot.view.qpos[0] = x
    world.advance(1)
    pads = {geom for geom, _ in robot.view.sensors.pads}
    assert pads.isdisjoint(world.population.clusters[0].touched) is not bool(touches)
