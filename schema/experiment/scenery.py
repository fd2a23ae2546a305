"""A user's MJCF of what stands in a world, read as geoms that never move.

All of it becomes geoms of the world's own body: what counts bodies and joints finds
those of robots only.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import isfinite
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from schema.errors import ExperimentError, one_line
from schema.experiment.document import Simulation
from schema.robot.results import Floats

_ALLOWED = (
    *("mujoco", "compiler", "default", "worldbody"),
    *("body", "frame", "replicate", "geom"),
)
"""Elements of MJCF that can only stand still."""
_SHAPES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}
_WORDS = ("name", "class", "childclass", "model")
"""Attributes that hold no numbers."""
_COPIED = (
    *("type", "size", "rgba", "contype", "conaffinity", "condim", "priority"),
    *("friction", "solmix", "solref", "solimp", "margin", "gap"),
)
"""What a geom is, beside where."""


def scenery_problem(scenery: str, simulation: Simulation) -> str:
    """Return why a text cannot be scenery; nothing if it can."""
    try:
        scenery_model(scenery, simulation)
    except ExperimentError as error:
        return str(error)
    return ""


@dataclass(frozen=True, slots=True)
class Solid:
    """One shape of scenery, for whoever draws it.

    Attributes:
        shape: box, sphere, capsule, ellipsoid or cylinder.
        size: (3,) as MuJoCo has it: half sizes or semi-axes; of the round ones about
            z the radius, then half of the length without caps [m].
        centre: (3,) world frame [m].
        rotation: (3, 3) its frame into the world's.
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
        ExperimentError: it is not scenery.
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
    """Add what stands in a world: its geoms, named ``scenery/{k}``.

    Args:
        spec: the world's.
        scenery: MJCF.
        simulation: whose friction and contact it has where it says nothing.

    Raises:
        ExperimentError: it is not scenery.
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
    """Return scenery alone, compiled; not to be changed.

    Args:
        scenery: MJCF.
        simulation: whose friction and contact it has where it says nothing.

    Raises:
        ExperimentError: no XML, no MJCF, nothing in it, or something that moves,
            comes from another file or is no simple shape.
    """
    try:
        root = ET.fromstring(scenery)  # noqa: S314 - of the user's own document
    except ET.ParseError as error:
        raise ExperimentError(f"environment.scenery: no XML: {error}") from None
    _check_elements(root)
    # Before the user's own, which go beyond it.
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
        raise ExperimentError(
            f"environment.scenery: no MJCF: {one_line(error)}"
        ) from None
    _check_shapes(model)
    return model


def _check_elements(root: ET.Element) -> None:
    if root.tag != "mujoco":
        raise ExperimentError(
            f"environment.scenery: must be <mujoco>, got <{root.tag}>"
        )
    for element in root.iter():
        if element.tag not in _ALLOWED:
            raise ExperimentError(
                f"environment.scenery: <{element.tag}> is not allowed, for scenery "
                f"only stands there; allowed: {', '.join(_ALLOWED)}"
            )
        for key, value in element.items():
            if key not in _WORDS and not all(map(_is_finite, value.split())):
                raise ExperimentError(
                    f"environment.scenery: <{element.tag} {key}={value!r}> must be "
                    "finite"
                )
        if element.get("mocap", "false") != "false":
            name = element.get("name", "")
            raise ExperimentError(
                f"environment.scenery: <body name={name!r}> must not be mocap, for "
                "scenery only stands there"
            )


def _is_finite(word: str) -> bool:
    """Return whether a word is no number that is none; the engine takes them."""
    try:
        return isfinite(float(word))
    except ValueError:
        return True


def _check_shapes(model: mujoco.MjModel) -> None:
    if not model.ngeom:
        raise ExperimentError("environment.scenery: must have a <geom>, got none")
    for index, kind in enumerate(model.geom_type.tolist()):
        if kind not in _SHAPES:
            shape = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
            raise ExperimentError(
                f"environment.scenery: geom {index} {model.geom(index).name!r} must be "
                f"one of {', '.join(_SHAPES.values())}, got {shape}"
            )
