"""Robots that dm_control, MuJoCo 3, yourdfpy and pybullet read.

Each library is installed into an environment of its own in pytest's folder. Libraries
that cannot be installed are skipped with the reason.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import TypedDict

import mujoco
import numpy as np
import pytest

from schema.experiment.document import Simulation
from schema.formats.files import write_robot
from schema.mjcf.model import robot_spec
from schema.parts import BUILT_IN
from schema.robot.robot import Part, Robot
from tests.schema.robots import GREY, robot_of

INSTALL_S = 900
pytestmark = [pytest.mark.long, pytest.mark.timeout(INSTALL_S + 120)]

# Each prints {"joints": {name: [lower, upper]}, "links": {name: [mass, inertia]}}.
MUJOCO = """
import json, sys
import mujoco

def described(m, data):
    joints = {m.joint(j).name: m.jnt_range[j].tolist() for j in range(1, m.njnt)}
    links = {
        m.body(b).name: [float(m.body_mass[b]), m.body_inertia[b].tolist()]
        for b in range(1, m.nbody)
    }
    return {"joints": joints, "links": links, "sensors": data.sensordata.tolist()}
"""
PLAIN = """
m = mujoco.MjModel.from_xml_path(sys.argv[1])
d = mujoco.MjData(m)
mujoco.mj_step(m, d, nstep=400)
print(json.dumps(described(m, d)))
"""
DM_CONTROL = """
import warnings
warnings.simplefilter("ignore")
from dm_control import mjcf
physics = mjcf.Physics.from_mjcf_model(mjcf.from_path(sys.argv[1]))
physics.step(400)
print(json.dumps(described(physics.model.ptr, physics.data)))
"""
YOURDFPY = """
import json, sys
import numpy as np, yourdfpy
urdf = yourdfpy.URDF.load(sys.argv[1])
assert urdf.validate(), urdf.errors
joints = {j.name: [j.limit.lower, j.limit.upper] for j in urdf.robot.joints}
links = {
    l.name: [l.inertial.mass, np.linalg.eigvalsh(l.inertial.inertia).tolist()]
    for l in urdf.robot.links
}
print(json.dumps({"joints": joints, "links": links}))
"""
PYBULLET = """
import json, sys
import pybullet as p
p.connect(p.DIRECT)
flags = p.URDF_USE_INERTIA_FROM_FILE | p.URDF_MAINTAIN_LINK_ORDER
robot = p.loadURDF(sys.argv[1], flags=flags)
joints, links = {}, {}
for j in range(-1, p.getNumJoints(robot)):
    mass, _, inertia = p.getDynamicsInfo(robot, j)[:3]
    name = p.getBodyInfo(robot)[0] if j < 0 else p.getJointInfo(robot, j)[12]
    links[name.decode()] = [mass, inertia]
    if j >= 0:
        info = p.getJointInfo(robot, j)
        joints[info[1].decode()] = [info[8], info[9]]
print(json.dumps({"joints": joints, "links": links}), file=sys.stderr)
"""


class Description(TypedDict):
    """What a library knows of a robot.

    Attributes:
        joints: limits [rad] by name.
        links: mass [kg] and principal inertia [kg m2] by name.
        sensors: readings after 2 s, of MJCF.
    """

    joints: dict[str, list[float]]
    links: dict[str, tuple[float, list[float]]]
    sensors: list[float]


def spider() -> Robot:
    """Return four legs of hinge, brick, passive hinge, tilted bar and touch sensor."""
    parts: list[Part] = []
    for slot in range(4):
        first = len(parts) + 1
        bar = (60.0, 0.3, 0.0, *GREY)
        parts += [
            Part("ActiveHinge", 0, slot, slot % 2, 90, GREY),
            Part("FixedBrick", first, 1 - slot % 2, 0, 270, GREY),
            Part("Hinge", first + 1, 1, 0, 90 * slot, GREY),
            Part("ParametricBarJoint", first + 2, 1, 0, 0, bar),
            Part("TouchSensor", first + 3, 1, 0, 0, GREY),
        ]
    return robot_of(*parts)


def run_with(folder: Path, packages: list[str], script: str, file: Path) -> Description:
    """Return what a script prints about a file, in an environment with packages.

    Skips the test if the packages cannot be installed.
    """
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    install: list[str | Path] = [
        folder / "bin" / "pip",
        "install",
        "--quiet",
        *packages,
    ]
    try:
        done = subprocess.run(
            install, capture_output=True, text=True, timeout=INSTALL_S, check=False
        )
    except subprocess.TimeoutExpired:
        pytest.skip(f"{packages} not installed within {INSTALL_S} s")
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        pytest.skip(f"{packages} cannot be installed: {last}")
    found = subprocess.run(
        [folder / "bin" / "python", "-c", script, file],
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr
    # pybullet prints about itself on the standard output.
    text = found.stderr if script is PYBULLET else found.stdout
    described: Description = json.loads(text.strip().splitlines()[-1])
    return described


def check_same(found: Description, robot: Robot, *, rel: float) -> None:
    """Compare joints, limits [rad], masses [kg] and principal inertia with ours."""
    ours = robot_spec(robot, BUILT_IN, Simulation()).spec.compile()
    joints = {ours.joint(j).name: ours.jnt_range[j] for j in range(1, ours.njnt)}
    assert list(found["joints"]) == list(joints)
    assert len(joints) == 8
    for name, limits in joints.items():
        assert found["joints"][name] == pytest.approx(limits.tolist(), rel=rel), name
    links = {ours.body(b).name: b for b in range(1, ours.nbody)}
    assert list(found["links"]) == list(links)
    for name, body in links.items():
        mass, inertia = found["links"][name]
        assert mass == pytest.approx(ours.body_mass[body], rel=rel), name
        expected = np.sort(ours.body_inertia[body])
        assert np.sort(inertia) == pytest.approx(expected, rel=rel), name


@pytest.mark.parametrize(
    ("packages", "script"),
    [
        (["mujoco==3.2.7"], PLAIN),
        (["mujoco==3.3.7"], PLAIN),
        (["mujoco>=3.17,<4"], PLAIN),
        (["dm_control>=1.0.50", "mujoco<4"], DM_CONTROL),
    ],
    ids=["mujoco 3.2", "mujoco 3.3", "mujoco 3", "dm_control"],
)
def test_mjcf(packages: list[str], script: str, tmp_path: Path) -> None:
    robot, file = spider(), tmp_path / "spider.xml"
    write_robot(robot, file)
    found = run_with(tmp_path / "env", packages, MUJOCO + script, file)
    check_same(found, robot, rel=1e-9)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=400)
    # Accelerometer, gyro, and the pads of four touch sensors.
    assert len(found["sensors"]) == len(data.sensordata) == 3 + 3 + 8
    assert found["sensors"] == pytest.approx(data.sensordata.tolist(), abs=0.02)


@pytest.mark.parametrize("script", [YOURDFPY, PYBULLET], ids=["yourdfpy", "pybullet"])
def test_urdf(script: str, tmp_path: Path) -> None:
    robot, file = spider(), tmp_path / "spider.urdf"
    write_robot(robot, file)
    packages = ["yourdfpy"] if script is YOURDFPY else ["pybullet", "numpy"]
    # pybullet has single precision in places.
    check_same(run_with(tmp_path / "env", packages, script, file), robot, rel=1e-5)
