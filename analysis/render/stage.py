"""Off-screen drawing of MuJoCo models by a camera that looks down at them.

MuJoCo renders through EGL or, where that is missing, OSMesa. It chooses between them at
its first import, so ``choose_engine`` must be called before. Where neither works, the
ray caster draws.
"""

import ctypes.util
import os
import sys
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from analysis.render.framing import framed
from schema.agent.import_path import GRAPHICS, NO_GRAPHICS, check_graphics
from schema.agent.log import tell_user
from schema.errors import one_line
from schema.experiment.environment import LIGHT_COLOUR, LIGHT_M
from schema.parts import Vector
from schema.robot.trace import Floats

Picture = npt.NDArray[np.uint8]
"""(H, W, 3) red, green, blue."""

_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
_OFF = (NO_GRAPHICS, "disabled", "off", "false", "0")
"""Values of the setting for which MuJoCo loads no graphics library."""
AZIMUTH = 130.0
"""Direction of the camera's view, as MuJoCo's [degrees]."""
LOW, HIGH = -28.0, -38.0
"""Elevations of the camera's view: at a robot, and down on many [degrees]."""
FIELD_OF_VIEW = 45.0
"""Angle between the upper and the lower edge of a picture [degrees]."""
_FLOOR_NAME = "floor"
_FLOOR = ((0.93, 0.94, 0.95), (0.86, 0.88, 0.90))
_SKY = (1.0, 1.0, 1.0)
_TILE_M = 0.2
_GROUND = ("ground", "rough")
_LAMP = np.array([-1.0, -1.6, 6.0])
"""Place of the lamp, in half widths of what is shown."""


def choose_engine() -> str:
    """Choose the backend of MuJoCo's renderer, and return its name.

    Returns:
        The value of ``MUJOCO_GL``; "disable" if neither EGL nor OSMesa works.
    """
    if "mujoco" not in sys.modules:
        os.environ[GRAPHICS] = os.environ.get(GRAPHICS) or _installed() or NO_GRAPHICS
        check_graphics()
    return os.environ.get(GRAPHICS, "")


def _installed() -> str | None:
    if find_spec("OpenGL") is None:
        return None
    for name, library in _LIBRARIES.items():
        if ctypes.util.find_library(library):
            return name
    return None


@lru_cache(maxsize=1)
def _tell_fallback(why: str) -> None:
    """Say once why robots are drawn without OpenGL."""
    tell_user(f"robots are drawn without OpenGL: {why}")


class Stage:
    """A model and the camera that draws it.

    Attributes:
        model: MuJoCo model, furnished by ``furnish``.
        data: its state.
    """

    def __init__(
        self,
        model: Any,  # noqa: ANN401 - imported late
        size: tuple[int, int],
        elevation: float = LOW,
    ) -> None:
        """Prepare pictures of a size [pixels], seen from an elevation [degrees]."""
        import mujoco  # noqa: PLC0415 - after its engine is chosen

        self.model, self.data = model, mujoco.MjData(model)
        self._mujoco: Any = mujoco
        self._size, self._elevation = size, elevation
        self._renderer = _renderer(model, choose_engine(), size)

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()

    def pose(self, qpos: Floats) -> None:
        """Set the positions of the model, (nq,)."""
        self.data.qpos[:] = qpos
        self._mujoco.mj_kinematics(self.model, self.data)
        self._mujoco.mj_camlight(self.model, self.data)

    def picture(self, look_at: Floats, distance_m: float) -> Picture:
        """Return a picture of the state, from a distance of a point, (3,) [m]."""
        camera = self._mujoco.MjvCamera()
        camera.lookat[:], camera.distance = look_at, distance_m
        camera.azimuth, camera.elevation = AZIMUTH, self._elevation
        self._renderer.update_scene(self.data, camera)
        return np.array(self._renderer.render())

    def framing(
        self, centres: Floats, radii: Floats, cut: tuple[float, float]
    ) -> tuple[Floats, float]:
        """Return ``look_at`` and ``distance_m`` to see spheres, as in ``framed``.

        Shares of the picture's height may be cut off above and below.
        """
        edge, (width, height) = np.tan(np.radians(FIELD_OF_VIEW / 2)), self._size
        above, below = ((1 - 2 * share) * edge for share in cut)
        view = np.radians(AZIMUTH), np.radians(self._elevation)
        return framed(centres, radii, *view, (above, below, width / height * edge))


def _renderer(
    model: Any,  # noqa: ANN401 - imported late
    engine: str,
    size: tuple[int, int],
) -> Any:  # noqa: ANN401 - imported late
    """Return MuJoCo's renderer, or the ray caster where that does not work."""
    import mujoco  # noqa: PLC0415 - after its engine is chosen

    from analysis.render.ray_caster import RayCaster  # noqa: PLC0415 - the same

    width, height = size
    if engine.lower() in _OFF:
        why = f"{GRAPHICS} is {engine}" if _installed() else "no EGL or OSMesa here"
    else:
        try:
            return mujoco.Renderer(model, height, width)
        # The type of the exception depends on the backend.
        except Exception as error:  # noqa: BLE001
            why = f"{engine or 'its default backend'} does not work: {one_line(error)}"
    _tell_fallback(why)
    floor = (_FLOOR_NAME, np.array(_FLOOR, np.float32), _TILE_M)
    return RayCaster(model, height, width, floor=floor)


def furnish(
    size: tuple[int, int],
    shown_light: Vector | None,
    reach_m: float,
    spec: Any,  # noqa: ANN401 - imported late
) -> None:
    """Add floor, light and sky to the specification of a model.

    A light that robots read is shown as a ball; ``reach_m`` is half the width of what
    is shown.
    """
    import mujoco  # noqa: PLC0415 - after its engine is chosen

    if shown_light is not None:
        ball = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE)
        ball.pos, ball.size[0], ball.rgba = shown_light, LIGHT_M, LIGHT_COLOUR
        ball.contype = ball.conaffinity = 0

    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    spec.visual.global_.fovy = FIELD_OF_VIEW
    spec.visual.headlight.ambient = (0.35, 0.35, 0.35)
    spec.visual.headlight.diffuse = (0.35, 0.35, 0.35)
    spec.visual.headlight.specular = (0.0, 0.0, 0.0)
    spec.visual.quality.shadowsize = 2048
    # Robots are small: a near clipping plane and fine shadows.
    spec.stat.extent = reach_m
    spec.visual.map.znear = 0.01
    spec.visual.map.shadowclip = 1.0
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=_SKY,
        rgb2=_SKY,
        width=16,
        height=96,
    )
    spec.add_texture(
        name="tiles",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=_FLOOR[0],
        rgb2=_FLOOR[1],
        width=256,
        height=256,
    )
    floor = spec.add_material(name=_FLOOR_NAME)
    floor.textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = "tiles"
    floor.texuniform = True
    floor.texrepeat = (1.0 / _TILE_M, 1.0 / _TILE_M)
    for geom in spec.worldbody.geoms:
        if geom.name in _GROUND:
            geom.material = _FLOOR_NAME
    spec.worldbody.add_light(
        pos=reach_m * _LAMP,
        dir=(0.15, 0.25, -1.0),
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        castshadow=True,
        cutoff=60.0,
        exponent=1.0,
        attenuation=(1.0, 0.0, 0.0),
        diffuse=(0.5, 0.5, 0.5),
        specular=(0.1, 0.1, 0.1),
    )


def add_rods(count: int, size_m: float, spec: Any) -> None:  # noqa: ANN401 - imported late
    """Add cylinders ``rod0``, ``rod1`` and so on, of a size at most, to be placed."""
    import mujoco  # noqa: PLC0415 - after its engine is chosen

    for number in range(count):
        rod = spec.worldbody.add_geom(name=f"rod{number}", contype=0, conaffinity=0)
        rod.type = mujoco.mjtGeom.mjGEOM_CYLINDER
        # MuJoCo ignores later turns of a geom that is parallel to its body, and rays
        # what is beyond its first size.
        rod.quat, rod.size = (0.8, 0.6, 0.0, 0.0), (size_m, size_m, 0.0)
