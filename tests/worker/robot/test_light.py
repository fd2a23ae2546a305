"""Light off-line: the readings of light sensors, by hand and as in an arena."""

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Fitness, Simulation, Space, body_space
from schema.experiment.environment import Environment
from schema.experiment.settings import EvaluationSettings
from schema.mjcf.model import solo_spec
from schema.parts import Vector
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from schema.wire.arena import Insertion
from tests.worker.arena_cases import populated, settings_of
from worker.robot.devices import Sensors
from worker.robot.evaluation import simulate
from worker.robot.own_sensors import Surroundings
from worker.robot.placed import PlacedRobot

GREY = (0.5, 0.5, 0.5)
SPACE = Space(part_types=(*Space().part_types, "schema.parts:LIGHT_SENSOR"))
LAMP = Robot(
    (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("LightSensor", 0, 2, 0, 0, GREY),
        Part("ActiveHinge", 0, 3, 0, 0, GREY),
    ),
    Brain(
        (
            *(Neuron("input", "Input", 0) for _ in range(6)),
            Neuron("input", "Input", 1),
            Neuron("output", "Simple", 2, (0.0, 1.0)),
        ),
        (Connection(6, 7, 1.0),),
    ),
)
"""A robot whose motor gets what its light sensor reads; the sensor faces world +x."""
FACE_M = 0.0475
"""Distance of the sensor's face from the core's centre."""
HEIGHT_M = 0.0225
WALL = """<mujoco><worldbody>
<geom type="box" size="0.01 1 1" pos="0.2 0 0"/></worldbody></mujoco>"""


def settings(environment: Environment, seconds: float = 2.0) -> EvaluationSettings:
    simulation = Simulation(window_steps=round(200 * seconds))
    return EvaluationSettings(
        space=SPACE, simulation=simulation, fitness=Fitness(), environment=environment
    )


def reading(light: Vector, scenery: str = "") -> float:
    """Return the sensor's first reading."""
    space, clock = body_space(SPACE), Simulation()
    model = solo_spec(LAMP, space, clock, Environment(scenery=scenery)).compile()
    data = mujoco.MjData(model)
    sensors = Sensors(PlacedRobot(LAMP, space, model, data), width=7, has_light=True)
    mujoco.mj_kinematics(model, data)
    sensors.look(Surroundings(0.0, (), light=light))
    return float(sensors.readings[0, 6])


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        ((0.5, 0.0, HEIGHT_M), 1.0),
        ((FACE_M + 2.0, 0.0, HEIGHT_M), 0.25),
        # 45 degrees off the axis, sqrt(2) m away.
        ((FACE_M + 1.0, 1.0, HEIGHT_M), 0.5 * 0.5**0.5),
        ((-0.5, 0.0, HEIGHT_M), 0.0),
    ],
)
def test_brightness_by_hand(light: Vector, expected: float) -> None:
    assert reading(light) == pytest.approx(expected, abs=2e-3)


def test_scenery_hides_the_light() -> None:
    assert reading((0.15, 0.0, HEIGHT_M), WALL) == pytest.approx(1.0, abs=2e-3)
    assert reading((0.5, 0.0, HEIGHT_M), WALL) == 0.0


def commands(environment: Environment) -> Floats:
    """Return the motor's command at each tick of an evaluation."""
    found: list[float] = []
    simulate(
        LAMP, settings(environment), watch=lambda data: found.append(data.ctrl.item())
    )
    return np.array(found)


def test_an_evaluation_feeds_the_light_to_the_brain() -> None:
    near, far = (
        commands(Environment(light=(x, 0.0, HEIGHT_M))) for x in (0.6, FACE_M + 2.0)
    )
    hidden = commands(Environment(light=(0.6, 0.0, HEIGHT_M), scenery=WALL))
    # Outputs 1, 1/4 and 0 of the joint's range.
    assert near[0] > far[0] > hidden[0]
    share = (far[0] - hidden[0]) / (near[0] - hidden[0])
    assert share == pytest.approx(0.25, abs=5e-3)


def test_a_lone_robot_of_an_arena_reads_the_same() -> None:
    light = (1.0, 0.3, 0.2)
    alone = commands(Environment(light=light))
    for arena_light, own_light in ((light, None), (None, light), (light, light)):
        arena = replace(
            settings_of(light=arena_light, drop_m=0.0),
            space=SPACE,
            environment=Environment(light=own_light),
        )
        world = populated(arena, [Insertion(BirthId(0, 0), LAMP, (0.0, 0.0))])
        found = []
        for _ in alone:
            found.append(world.population.find(BirthId(0, 0)).view.ctrl.item())
            world.advance(world.step + arena.simulation.brain_steps)
        assert found == pytest.approx(alone.tolist(), abs=1e-9)
