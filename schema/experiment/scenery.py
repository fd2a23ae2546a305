"""Scenery: a user's MJCF, read as static geoms.

All geoms are added to the world body, so that a model's bodies and joints are those
of robots only.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import isfinite
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from schema.errors import ExperimentError, one_line, shown
from schema.experiment.bounded import parse_xml
from schema.experiment.document import Simulation
from schema.limits import MOST_GEOMS, MOST_OTHERS, MOST_SCENERY_DEPTH
from schema.robot.results import Floats

_ALLOWED = (
    *("mujoco", "compiler", "default", "worldbody"),
    *("body", "frame", "replicate", "geom"),
)
"""MJCF elements that are allowed: none of them moves."""
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
    """Return the shapes of scenery, in the order of its geoms.

    Raises:
        ExperimentError: the text is not valid scenery.
    """
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
    """Add the geoms of scenery to a world, named ``scenery/{k}``.

    Args:
        spec: of the world.
        scenery: MJCF.
        simulation: default friction and contact of its geoms.

    Raises:
        ExperimentError: the text is not valid scenery.
    """
    model = scenery_model(scenery, simulation)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for index in range(model.ngeom):
        geom = spec.worldbody.add_geom(name=f"scenery/{index}")
        for key in _COPIED:
            setattr(geom, key, getattr(model, f"geom_{key}")[index])
        quaternion = np.empty(4)
        body = int(model.geom_bodyid[index])
        mujoco.mju_mulQuat(quaternion, data.xquat[body], model.geom_quat[index])
        geom.pos, geom.quat = data.geom_xpos[index], quaternion


@lru_cache(maxsize=16)
def scenery_model(scenery: str, simulation: Simulation) -> mujoco.MjModel:
    """Return the compiled model of scenery alone; do not change it.

    Args:
        scenery: MJCF.
        simulation: default friction and contact of its geoms.

    Raises:
        ExperimentError: not XML, not MJCF, no geom or too many, an element that moves
            or refers to another file, or a shape that is not supported.
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
    return model


def _invalid(message: str) -> ExperimentError:
    return ExperimentError(f"environment.scenery: {message}")


def _check_elements(root: ET.Element) -> None:
    if root.tag != "mujoco":
        raise _invalid(f"must be <mujoco>, got <{root.tag}>")
    for element in root.iter():
        if element.tag not in _ALLOWED:
            raise _invalid(
                f"<{element.tag}> is not allowed, because scenery "
                f"does not move; allowed: {', '.join(_ALLOWED)}"
            )
        for key, value in element.items():
            if key == "user":
                raise _invalid(f"<{element.tag} user=...> is not allowed")
            if key not in _WORDS and not all(map(_is_finite, value.split())):
                raise _invalid(f"<{element.tag} {key}={shown(value)}> must be finite")
        if element.get("mocap", "false") != "false":
            name = element.get("name", "")
            raise _invalid(
                f"<body name={name!r}> must not be mocap, because scenery does not move"
            )


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
        raise _invalid(
            f"<replicate count={shown(count)}> must be a whole number <= {MOST_GEOMS}"
        )
    return int(count)


def _is_finite(word: str) -> bool:
    """Return whether a word is not inf or nan, which MuJoCo accepts."""
    try:
        return isfinite(float(word))
    except ValueError:
        return True


def _check_shapes(model: mujoco.MjModel) -> None:
    if not model.ngeom:
        raise _invalid("must have a <geom>, got none")
    for index, kind in enumerate(model.geom_type.tolist()):
        if kind not in _SHAPES:
            shape = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
            raise _invalid(
                f"geom {index} {model.geom(index).name!r} must be "
                f"one of {', '.join(_SHAPES.values())}, got {shape}"
            )
