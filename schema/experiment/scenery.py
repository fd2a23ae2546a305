"""Scenery: a user's MJCF, read as static geoms and as objects that move freely.

All static geoms are added to the world body. Each body with a free joint becomes an
object, a body after those of the robot. In arenas there are no objects.
"""

from dataclasses import dataclass
from functools import lru_cache
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from schema.errors import ExperimentError, cut, one_line, shown
from schema.experiment.document import Simulation
from schema.experiment.environment import Environment
from schema.limits import MOST_GEOMS, MOST_OBJECTS, MOST_OTHERS, MOST_SCENERY_DEPTH
from schema.plugins.bounded import is_finite, parse_xml
from schema.robot.trace import Floats

_ALLOWED = (
    *("mujoco", "compiler", "default", "worldbody"),
    *("body", "frame", "replicate", "geom", "freejoint"),
)
"""MJCF elements that are allowed."""
_SHAPES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}
_WORDS = ("name", "class", "childclass", "model")
"""Attributes whose values are not numbers."""
_COPIED = (
    *("type", "size", "rgba", "contype", "conaffinity", "condim", "priority"),
    *("friction", "solmix", "solref", "solimp", "margin", "gap"),
)
"""Attributes of a geom that are copied; pose is not among them."""


@dataclass(frozen=True, slots=True)
class Solid:
    """Shape of scenery, for drawing.

    Attributes:
        shape: box, sphere, capsule, ellipsoid or cylinder.
        size: (3,) as in MuJoCo: half sizes or semi-axes; of cylinder and capsule the
            radius, then the half length without caps [m].
        centre: (3,) world frame [m].
        rotation: (3, 3) shape frame to world frame.
        colour: red, green, blue, opacity, 0 to 1.
    """

    shape: str
    size: Floats
    centre: Floats
    rotation: Floats
    colour: tuple[float, ...]


def solids(scenery: str, simulation: Simulation) -> list[Solid]:
    """Return the shapes of scenery, in the order of its geoms."""
    model = scenery_model(scenery, simulation)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return [
        Solid(
            _SHAPES[mujoco.mjtGeom(model.geom_type[index])],
            model.geom_size[index],
            data.geom_xpos[index].copy(),
            data.geom_xmat[index].reshape(3, 3).copy(),
            tuple(model.geom_rgba[index].tolist()),
        )
        for index in range(model.ngeom)
    ]


def add_scenery(spec: mujoco.MjSpec, scenery: str, simulation: Simulation) -> None:
    """Add the geoms and objects of scenery to a world, both named ``scenery/{k}``.

    Objects come after the bodies that the world has. Errors as of ``scenery_model``.
    """
    model = scenery_model(scenery, simulation)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    moving = {
        body: _add_object(spec, model, data, body) for body in model.jnt_bodyid.tolist()
    }
    for index in range(model.ngeom):
        body = int(model.geom_bodyid[index])
        geom = moving.get(body, spec.worldbody).add_geom(name=f"scenery/{index}")
        for key in _COPIED:
            setattr(geom, key, getattr(model, f"geom_{key}")[index])
        if body in moving:
            geom.pos, geom.quat = model.geom_pos[index], model.geom_quat[index]
            continue
        quaternion = np.empty(4)
        mujoco.mju_mulQuat(quaternion, data.xquat[body], model.geom_quat[index])
        geom.pos, geom.quat = data.geom_xpos[index], quaternion


def object_count(environment: Environment, simulation: Simulation) -> int:
    """Return the number of objects of an environment's scenery."""
    if not environment.scenery:
        return 0
    return int(scenery_model(environment.scenery, simulation).njnt)


def refuse_objects(environment: Environment, simulation: Simulation) -> None:
    """Raise ``ExperimentError`` if the scenery of an arena has objects, or is wrong."""
    if count := object_count(environment, simulation):
        raise _invalid(
            f"arenas have no objects that move, got {count} <freejoint>; remove them"
        )


def _add_object(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, body: int
) -> mujoco.MjsBody:
    """Add an object without geoms; return its body."""
    made = spec.worldbody.add_body(name=f"scenery/{body}")
    made.pos, made.quat = data.xpos[body], data.xquat[body]
    # No alignment: the geoms' poses are in the frame that the compiler chose already.
    made.add_freejoint(name=f"scenery/{body}", align=0)
    made.explicitinertial = 1
    made.mass, made.inertia = model.body_mass[body], model.body_inertia[body]
    made.ipos, made.iquat = model.body_ipos[body], model.body_iquat[body]
    made.gravcomp = model.body_gravcomp[body]
    return made


@lru_cache(maxsize=16)
def scenery_model(scenery: str, simulation: Simulation) -> mujoco.MjModel:
    """Return the compiled model of scenery alone; do not change it.

    The simulation has the default friction and contact of its geoms.

    Raises:
        ExperimentError: no MJCF of scenery: its elements, shapes or their numbers.
    """
    try:
        root = parse_xml(scenery, most_depth=MOST_SCENERY_DEPTH)
    except ValueError as error:
        raise _invalid(str(error)) from None
    _check_elements(root)
    _check_count(root)
    # First, so that the user's own defaults override it.
    general = ET.Element("default")
    ET.SubElement(
        general,
        "geom",
        condim="3",
        friction=f"{simulation.friction!r} 0 0",
        solref=f"{simulation.contact_time_s!r} 1",
    )
    root.insert(0, general)
    try:
        text = ET.tostring(root, encoding="unicode")
        model = mujoco.MjSpec.from_string(text).compile()
    except ValueError as error:
        raise _invalid(f"not valid MJCF: {one_line(error)}") from None
    _check_shapes(model)
    _check_objects(model)
    return model


def _invalid(message: str) -> ExperimentError:
    return ExperimentError(f"environment.scenery: {message}")


def _check_elements(root: ET.Element) -> None:
    if root.tag != "mujoco":
        raise _invalid(f"must be <mujoco>, got <{root.tag}>")
    for element in root.iter():
        if element.tag not in _ALLOWED:
            allowed = ", ".join(_ALLOWED)
            raise _invalid(f"<{cut(element.tag)}> is not allowed; allowed: {allowed}")
        for key, value in element.items():
            if key == "user":
                raise _invalid(f"<{element.tag} user=...> is not allowed")
            if key not in _WORDS and not is_finite(value):
                where = f"<{element.tag} {cut(key)}={shown(value)}>"
                raise _invalid(f"{where} must be finite")
        if element.get("mocap", "false") != "false":
            name = shown(element.get("name", ""))
            raise _invalid(f"<body name={name}> must not be mocap: nothing moves it")


def _check_count(root: ET.Element) -> None:
    """Raise if MuJoCo would make too many bodies or geoms by replication."""
    if sum(1 for _ in root.iter("default")) > MOST_OTHERS:
        raise _invalid(f"must have <= {MOST_OTHERS} <default>")
    # The elements, each with the number of its copies.
    level, made = [(root, 1)], 0
    while level:
        inner = []
        for element, copies in level:
            if element.tag == "replicate":
                copies *= _replicas(element)  # noqa: PLW2901 - of what is inside
            made += copies
            inner += [(child, copies) for child in element]
        if made > MOST_GEOMS:
            raise _invalid(f"must have <= {MOST_GEOMS} elements, copies included")
        level = inner


def _replicas(element: ET.Element) -> int:
    count = element.get("count", "")
    if not (count.isascii() and count.isdigit() and len(count) <= len(str(MOST_GEOMS))):
        where = f"<replicate count={shown(count)}>"
        raise _invalid(f"{where} must be a whole number <= {MOST_GEOMS}")
    return int(count)


def _check_shapes(model: mujoco.MjModel) -> None:
    if not model.ngeom:
        raise _invalid("must have a <geom>, got none")
    for index, kind in enumerate(model.geom_type.tolist()):
        if kind not in _SHAPES:
            shape = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
            allowed, name = ", ".join(_SHAPES.values()), model.geom(index).name
            raise _invalid(
                f"geom {index} {name!r} must be one of {allowed}, got {shape}"
            )


def _check_objects(model: mujoco.MjModel) -> None:
    if model.njnt > MOST_OBJECTS:
        raise _invalid(f"must have <= {MOST_OBJECTS} <freejoint>, got {model.njnt}")
    inside = set(range(1, model.nbody)).difference(model.jnt_bodyid.tolist())
    for body in sorted(inside):
        if model.body_weldid[body]:
            where = f"<body name={model.body(body).name!r}>"
            raise _invalid(
                f"{where} must not be inside one with <freejoint>: use <frame>"
            )
