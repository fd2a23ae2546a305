"""Scenery from a user's MJCF: geoms, and errors."""

import mujoco
import pytest

from schema.errors import ExperimentError
from schema.experiment.document import Simulation
from schema.experiment.environment import Environment
from schema.experiment.scenery import object_count
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robot.robot import Robot
from tests.documents import parse_experiment
from tests.schema.robots import CORE

ALONE = Robot((CORE,))
YARD = """
<!-- a yard -->
<mujoco model="yard">
  <compiler angle="degree"/>
  <default><geom rgba="1 0 0 1"/><default class="ice"><geom friction="0.1 0 0"/>
  </default></default>
  <worldbody>
    <geom name="wall" type="box" size="0.1 2 0.5" pos="2 0 0.5"/>
    <body pos="0 3 0" euler="0 0 90">
      <geom class="ice" type="capsule" fromto="1 0 0.2  1 1 0.2" size="0.1"/>
      <replicate count="3" offset="0.5 0 0"><geom type="sphere" size="0.1"/></replicate>
    </body>
  </worldbody>
</mujoco>
"""


def scene(inside: str, outside: str = "") -> str:
    return f"<mujoco>{outside}<worldbody>{inside}</worldbody></mujoco>"


def test_scenery_adds_only_geoms_to_the_world() -> None:
    simulation = Simulation(friction=0.7, contact_time_s=0.02)
    empty = solo_spec(ALONE, BUILT_IN, simulation, Environment()).compile()
    model = solo_spec(ALONE, BUILT_IN, simulation, Environment(scenery=YARD)).compile()
    assert (model.nbody, model.nq) == (empty.nbody, empty.nq)
    assert model.ngeom == empty.ngeom + 5
    names = [f"scenery/{index}" for index in range(5)]
    wall, rod, *balls = (model.geom(name) for name in names)
    assert {int(model.geom(name).bodyid[0]) for name in names} == {0}
    # The ground's friction and contact, where it says nothing of them.
    assert wall.friction.tolist() == [0.7, 0.0, 0.0]
    assert wall.solref.tolist() == [0.02, 1.0]
    assert wall.condim[0] == 3
    assert rod.friction.tolist() == [0.1, 0.0, 0.0]
    assert wall.pos.tolist() == [2.0, 0.0, 0.5]
    assert wall.size.tolist() == [0.1, 2.0, 0.5]
    assert rod.rgba.tolist() == [1.0, 0.0, 0.0, 1.0]
    # The body's x axis is the world's y: its (1, 0.5) is (-0.5, 3 + 1).
    assert rod.pos.tolist() == pytest.approx([-0.5, 4.0, 0.2])
    assert rod.size[:2].tolist() == pytest.approx([0.1, 0.5])
    assert [ball.pos[1] for ball in balls] == pytest.approx([3.0, 3.5, 4.0])


def test_rotated_geoms_keep_their_rotation() -> None:
    environment = Environment(
        scenery=scene('<body euler="0 0 30"><geom type="box" size="1 .1 .1" '
                      'pos="5 0 1" euler="0 0 15"/></body>')
    )  # fmt: skip
    model = solo_spec(ALONE, BUILT_IN, Simulation(), environment).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axis = data.geom("scenery/0").xmat.reshape(3, 3)[:, 0]
    assert axis.tolist() == pytest.approx([0.5**0.5, 0.5**0.5, 0.0])


BOX = '<geom type="box" size="1 1 1"/>'
OBJECTS = scene(
    '<geom type="box" size="1 0.1 0.1" pos="3 0 0.1"/>'
    '<body pos="1 2 0.5" euler="0 0 90"><freejoint/>'
    '<geom type="box" size="0.1 0.2 0.3" density="500"/></body>'
    '<body pos="-1 0 0.1"><freejoint align="true"/>'
    '<geom type="sphere" size="0.1" mass="0.2"/>'
    '<frame pos="1 0 0"><geom type="sphere" size="0.1" mass="0.6"/></frame></body>'
)
"""A beam that stays, a box of 24 kg, and a dumbbell."""


def test_a_body_with_a_free_joint_becomes_an_object_after_the_robot() -> None:
    simulation = Simulation(friction=0.7)
    empty = solo_spec(ALONE, BUILT_IN, simulation, Environment()).compile()
    environment = Environment(scenery=OBJECTS)
    model = solo_spec(ALONE, BUILT_IN, simulation, environment).compile()
    assert object_count(environment, simulation) == 2
    assert (model.nbody, model.nq) == (empty.nbody + 2, empty.nq + 14)
    assert model.jnt_qposadr.tolist() == [0, 7, 14]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    box, dumbbell = model.body("scenery/1"), data.body("scenery/2")
    assert box.mass.item() == pytest.approx(8 * 0.1 * 0.2 * 0.3 * 500.0)
    # m (b^2 + c^2) / 3 about the first axis.
    assert sorted(box.inertia) == pytest.approx(
        [24.0 * each / 3.0 for each in (0.01 + 0.04, 0.01 + 0.09, 0.04 + 0.09)]
    )
    assert data.qpos[7:14] == pytest.approx([1.0, 2.0, 0.5, 0.5**0.5, 0, 0, 0.5**0.5])
    # The centre of mass is three quarters of the way to the heavier ball.
    assert dumbbell.xipos.tolist() == pytest.approx([-0.25, 0.0, 0.1])
    balls = [data.geom(f"scenery/{index}").xpos.tolist() for index in (2, 3)]
    assert balls[0] == pytest.approx([-1.0, 0.0, 0.1])
    assert balls[1] == pytest.approx([0.0, 0.0, 0.1])
    assert model.geom("scenery/1").friction.tolist() == [0.7, 0.0, 0.0]
    # Joints of robots have damping, objects none.
    assert not model.dof_damping[6:].any()
    mujoco.mj_step(model, data, 400)
    # The box has fallen onto its base, the rest stays.
    assert data.body("scenery/1").xpos[2] == pytest.approx(0.3, abs=2e-3)
    assert data.geom("scenery/0").xpos.tolist() == [3.0, 0.0, 0.1]


def test_an_object_keeps_its_compensation_of_gravity() -> None:
    bodies = "".join(
        f'<body pos="{x} 0 9" gravcomp="{share}"><freejoint/>{BOX}</body>'
        for x, share in ((5, 0), (10, 1), (15, 2))
    )
    environment = Environment(scenery=scene(bodies))
    model = solo_spec(ALONE, BUILT_IN, Simulation(), environment).compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 10)
    speeds = [data.joint(f"scenery/{body}").qvel[2] for body in (1, 2, 3)]
    fall = 9.81 * 10 * model.opt.timestep
    assert speeds == pytest.approx([-fall, 0.0, fall])


def test_objects_are_refused_in_arenas() -> None:
    document = f"name = 'mine'\n[environment]\nscenery = '''{OBJECTS}'''\n"
    assert parse_experiment(document, "mine.toml").arena is None
    with pytest.raises(ExperimentError) as raised:
        parse_experiment(document + "[arena]\n", "mine.toml")
    assert str(raised.value) == (
        "mine.toml: environment.scenery: arenas have no objects that move, got 2 "
        "<freejoint>; remove them"
    )


def test_a_robot_starts_on_an_object_that_lies_where_it_is_born() -> None:
    slab = '<body pos="0 0 .05"><freejoint/><geom type="box" size=".3 .3 .05"/></body>'
    environment = Environment(scenery=scene(BOX.replace("/>", ' pos="3 0 0"/>') + slab))
    model = solo_spec(ALONE, BUILT_IN, Simulation(), environment).compile()
    assert model.qpos0[2] == pytest.approx(0.1 + 0.0225, abs=3e-5)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("<mujoco><worldbody>", "not valid XML: "),
        ("<sdf/>", "must be <mujoco>, got <sdf>"),
        (scene(""), "must have a <geom>, got none"),
        (scene(f"<freejoint/>{BOX}"), "not valid MJCF: "),
        (scene(f"<body><body><freejoint/>{BOX}</body></body>"), "not valid MJCF: "),
        (scene("<body><freejoint/></body>" + BOX), "not valid MJCF: "),
        (
            scene(f"<body><freejoint/>{BOX}<body name='a'>{BOX}</body></body>"),
            "<body name='a'> must not be inside one with <freejoint>: use <frame>",
        ),
        (
            scene(f"<replicate count='101'><body><freejoint/>{BOX}</body></replicate>"),
            "must have <= 100 <freejoint>, got 101",
        ),
        (scene(f"<body><joint type='hinge'/>{BOX}</body>"), "<joint> is not allowed"),
        (scene(BOX, "<actuator><motor/></actuator>"), "<actuator> is not allowed"),
        (scene(BOX, "<option gravity='0 0 0'/>"), "<option> is not allowed"),
        (scene(BOX, "<include file='other.xml'/>"), "<include> is not allowed"),
        (scene(BOX, "<asset><mesh file='a.stl'/></asset>"), "<asset> is not allowed"),
        (scene(f"<body mocap='true' name='a'>{BOX}</body>"), "'a'> must not be mocap"),
        (scene('<geom type="plane" size="1 1 1"/>'), "geom 0 '' must be one of sphere"),
        (scene('<geom size="nan"/>'), "<geom size='nan'> must be finite"),
        (scene(f'<body pos="0 -inf 0">{BOX}</body>'), "<body pos='0 -inf 0'> must be"),
        (scene('<geom type="mesh" mesh="a"/>'), "not valid MJCF: "),
        (scene('<geom type="box" sise="1 1 1"/>'), "not valid MJCF: "),
    ],
)  # fmt: skip
def test_wrong_scenery_is_refused(text: str, error: str) -> None:
    document = f'name = "mine"\n[environment]\nscenery = """{text}"""\n'
    with pytest.raises(ExperimentError) as raised:
        parse_experiment(document, "mine.toml")
    (line,) = str(raised.value).splitlines()
    assert line.startswith("mine.toml: environment.scenery: ")
    assert error in line
