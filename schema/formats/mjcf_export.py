"""World of a robot as other tools read it: names, sensors, servos and all digits.

dm_control reserves ``/`` in names, so that ``3/servo`` becomes ``3_servo``. The
sensors are only for other tools: our own readings follow from positions, velocities
and contacts. MuJoCo has no sensor of light.
"""

import ctypes
import re
from xml.etree import ElementTree as ET

import mujoco

from schema.parts import BodySpace, Sensor
from schema.robot.robot import Robot

_PAD_M = 0.001
"""Margin of the site of a touch sensor about its box [m]: contacts lie on its faces."""
_LONG = re.compile(r"\d+\.\d{8,}(?:e[+-]\d+)?")


def add_sensors(spec: mujoco.MjSpec, robot: Robot, space: BodySpace) -> None:
    """Add the sensors of a robot, and rename all elements with ``/`` in their names.

    An imu becomes ``{p}_accelerometer`` and ``{p}_gyro``, where p is the index of its
    part, and a touch sensor ``{p}_{box}_touch``.
    """
    _rename(spec)
    for index, part in enumerate(robot.parts):
        for sensor in space[part.kind].sensors:
            if not isinstance(sensor, Sensor):
                continue
            if sensor.kind == "imu":
                kinds = mujoco.mjtSensor
                site = f"{index}_imu"
                _add(spec, kinds.mjSENS_ACCELEROMETER, site, f"{index}_accelerometer")
                _add(spec, kinds.mjSENS_GYRO, site, f"{index}_gyro")
            elif sensor.kind == "touch":
                name = f"{index}_{sensor.box}_touch"
                _add_pad(spec.geom(f"{index}_{sensor.box}"), name)
                _add(spec, mujoco.mjtSensor.mjSENS_TOUCH, name, name)


def add_limits(spec: mujoco.MjSpec, robot: Robot, space: BodySpace) -> None:
    """Add the range of the velocities that motors take, and their gains.

    Gains are custom numbers [1/s], one for each actuator; 0 is a motor that controls
    the velocity. Arguments as of ``add_sensors``.
    """
    gains: list[float] = []
    for servo in spec.actuators:
        motor = space[robot.parts[int(servo.name.removeprefix("joint"))].kind].motor
        assert motor is not None
        servo.ctrllimited = 1
        servo.ctrlrange = (-motor.max_velocity, motor.max_velocity)
        gains.append(motor.gain if motor.control == "position" else 0.0)
    if gains:
        numbers = spec.add_numeric()
        numbers.name, numbers.size, numbers.data = "motor_gain", len(gains), gains


def exact_xml(spec: mujoco.MjSpec) -> str:
    """Return the XML of a compiled spec with all digits: with six, gaits differ."""
    # MuJoCo has no public setting of the digits. Its bindings load this library, too.
    engine = ctypes.CDLL(mujoco._functions.__file__)  # noqa: SLF001
    usual = engine._mjPRIVATE__get_xml_precision()  # noqa: SLF001
    engine._mjPRIVATE__set_xml_precision(17)  # noqa: SLF001
    try:
        # Short numbers stay short: 0.005, not 0.0050000000000000001.
        return _LONG.sub(lambda found: repr(float(found[0])), spec.to_xml())
    finally:
        engine._mjPRIVATE__set_xml_precision(usual)  # noqa: SLF001


def portable(root: ET.Element) -> ET.Element:
    """Return MJCF, changed in place, whose servos are ``velocity`` elements.

    MuJoCo 4 writes them as ``general`` elements with an attribute ``input``, which
    MuJoCo 3.3 and earlier do not know. Both give the same model.
    """
    for servo in root.iterfind("actuator/general[@input='vel']"):
        servo.tag = "velocity"
        servo.set("kv", servo.attrib.pop("gainprm", "1"))
        for name in ("input", "biastype", "biasprm"):
            del servo.attrib[name]
    for numbers in root.iterfind("custom/numeric"):
        del numbers.attrib["size"]  # of the data
    return root


def _rename(spec: mujoco.MjSpec) -> None:
    """Replace ``/`` in all names, which are unique among elements of a kind."""
    for elements in (spec.bodies, spec.joints, spec.geoms, spec.sites):
        taken = {element.name for element in elements}
        for element in elements:
            if "/" in element.name:
                name = element.name.replace("/", "_")
                while name in taken:
                    name += "_"
                taken.add(name)
                element.name = name


def _add(spec: mujoco.MjSpec, kind: mujoco.mjtSensor, site: str, name: str) -> None:
    sensor = spec.add_sensor()
    sensor.name, sensor.type = name, kind
    sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_SITE, site


def _add_pad(geom: mujoco.MjsGeom, name: str) -> None:
    """Add the site within which a touch sensor feels contacts of its box."""
    site = geom.parent.add_site()
    site.name, site.type = name, geom.type
    site.pos, site.quat = geom.pos, geom.quat
    site.size = [size + _PAD_M for size in geom.size]
