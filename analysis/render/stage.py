"""Off-screen drawing of MuJoCo models by a camera, in the light of a far lamp.

MuJoCo renders through EGL or, where that is missing, OSMesa. It chooses between them at
its first import, so ``choose_engine`` must be called before. Where neither works, the
ray caster draws.
"""

import ctypes.util
import os
import sys
from collections.abc import Sequence
from functools import cached_property, lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from analysis.render.framing import framed, view_axes
from analysis.render.overlay import Rod
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
FIELD_OF_VIEW = 30.0
"""Angle between the upper and the lower edge of a picture [degrees]."""
_FLOOR_NAME, _TILES_NAME = "floor", "tiles"
_TILES = ((0.93, 0.94, 0.95), (0.875, 0.89, 0.91))
_TILE_M = 0.1
_GROUND = ("ground", "rough")
_AMBIENT, _LAMP = 0.6, 0.48
"""Strengths of the light: a level floor that the lamp shines on has its own colour."""
_FALL = np.array([0.5, -1.0, -0.35])
"""Where the light goes: to the right, up and towards a level camera."""
_SHADOW_PIXELS, _SMOOTHING = 2048, 4
"""Side of the map of shadows, twice as many if pictures are fine; samples per pixel."""
HIDDEN_M = -100.0
"""Height of what pictures do not show [m]."""
_MOST_FINE = 2048
"""Greatest width and height of pictures that are drawn twice as large [pixels]."""
_SPARE_GEOMS = 1000
"""Geoms of a picture that are in no model, such as the sky."""
_SHRUNK, _SHRUNK_M, _LAYERS = 0.0015, 5e-5, 17
"""Boxes are drawn smaller by multiples of a share or length, whichever is less [m]:
faces in one plane would flicker."""


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
        view: azimuth and elevation of the camera's view, as MuJoCo's [degrees].
        shadow_m: half width of the part of the ground that has shadows, around the
            point that the lamp shines at [m]; fixed by the first picture.
    """

    def __init__(
        self,
        model: Any,  # noqa: ANN401 - imported late
        size: tuple[int, int],
        view: tuple[float, float] = (AZIMUTH, LOW),
        *,
        is_fine: bool = True,
    ) -> None:
        """Prepare pictures of a size [pixels]; fine ones take four times as long."""
        import mujoco  # noqa: PLC0415 - after its engine is chosen

        self.model, self.data = model, mujoco.MjData(model)
        self._mujoco: Any = mujoco
        self.size, self.view = size, view
        self.shadow_m = float(model.stat.extent)
        self._factor = 1 + (is_fine and max(size) <= _MOST_FINE)
        boxes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
        self._rods = [
            geom for geom in range(model.ngeom) if model.geom(geom).name[:3] == "rod"
        ]
        shrunk_m = np.minimum(_SHRUNK * model.geom_size[boxes], _SHRUNK_M)
        model.geom_size[boxes] -= shrunk_m * (np.arange(len(boxes))[:, None] % _LAYERS)

    @cached_property
    def _renderer(self) -> Any:  # noqa: ANN401 - imported late
        self.model.vis.map.shadowclip = self.shadow_m / self.model.stat.extent
        self.model.vis.quality.shadowsize = self._factor * _SHADOW_PIXELS
        return _renderer(self.model, choose_engine(), self.size, self._factor)

    def close(self) -> None:
        """Free the renderer."""
        if "_renderer" in self.__dict__:
            self._renderer.close()

    def pose(self, qpos: Floats) -> None:
        """Set the positions of the model, (nq,)."""
        self.data.qpos[:] = qpos
        self._mujoco.mj_kinematics(self.model, self.data)

    def picture(
        self, look_at: Floats, distance_m: float, lit: Floats | None = None
    ) -> Picture:
        """Return a picture of the state, from a distance of a point, (3,) [m].

        The lamp shines at another point, (3,) [m], if it is given.
        """
        camera = self._mujoco.MjvCamera()
        camera.lookat[:], camera.distance = look_at, distance_m
        camera.azimuth, camera.elevation = self.view
        fall = self.fall()
        self.data.light_xdir[0] = fall
        self.data.light_xpos[0] = look_at if lit is None else lit
        self.data.light_xpos[0] -= 4.0 * self.shadow_m * fall
        self._renderer.update_scene(self.data, camera)
        large = np.array(self._renderer.render())
        (width, height), factor = self.size, large.shape[0] // self.size[1]
        parts = large.reshape(height, factor, width, factor, 3)
        return large if factor == 1 else parts.mean((1, 3)).round().astype(np.uint8)

    def show_rods(self, rods: Sequence[Rod]) -> None:
        """Show rods in place of those that the next picture would show."""
        model = self.model
        model.geom_pos[self._rods, 2] = HIDDEN_M
        shown = zip(self._rods, rods, strict=False)
        for geom, (centre, half_m, turn, radius_m, colour) in shown:
            model.geom_pos[geom], model.geom_quat[geom] = centre, turn
            model.geom_size[geom, :2] = radius_m, half_m
            model.geom_rgba[geom, :3] = np.divide(colour, 255.0)
        self._mujoco.mj_kinematics(model, self.data)

    def fall(self) -> Floats:
        """Return the direction of the light, a unit vector (3,)."""
        fall = _FALL @ view_axes(np.radians(self.view[0]), 0.0)
        return np.asarray(fall / np.linalg.norm(fall))

    def framing(self, points: Floats) -> tuple[Floats, float]:
        """Return ``look_at`` and ``distance_m`` to see points, as in ``framed``."""
        edge, (width, height) = np.tan(np.radians(FIELD_OF_VIEW / 2)), self.size
        azimuth, elevation = np.radians(self.view)
        return framed(points, azimuth, elevation, (edge, width / height * edge))

    def pixels(self, points: Floats, look_at: Floats, distance_m: float) -> Floats:
        """Return column and row, (N, 2), of points, (N, 3) [m], in a picture."""
        across = (points - look_at) @ view_axes(*np.radians(self.view)).T
        edge_m = np.tan(np.radians(FIELD_OF_VIEW / 2)) * (distance_m - across[:, 2:])
        away = across[:, :2] / edge_m * [self.size[1], -self.size[1]]
        return np.asarray(0.5 * (np.array(self.size) + away))


def _renderer(
    model: Any,  # noqa: ANN401 - imported late
    engine: str,
    size: tuple[int, int],
    factor: int,
) -> Any:  # noqa: ANN401 - imported late
    """Return MuJoCo's renderer, or the ray caster where that does not work."""
    import mujoco  # noqa: PLC0415 - after its engine is chosen

    from analysis.render.ray_caster import RayCaster  # noqa: PLC0415 - the same

    width, height = size
    if engine.lower() in _OFF:
        why = f"{GRAPHICS} is {engine}" if _installed() else "no EGL or OSMesa here"
    else:
        high, wide = factor * height, factor * width
        model.vis.global_.offwidth, model.vis.global_.offheight = wide, high
        try:
            most_geoms = _SPARE_GEOMS + model.ngeom
            return mujoco.Renderer(model, high, wide, max_geom=most_geoms)
        # The type of the exception depends on the backend.
        except Exception as error:  # noqa: BLE001
            why = f"{engine or 'its default backend'} does not work: {one_line(error)}"
    _tell_fallback(why)
    return RayCaster(model, height, width, floor=(_FLOOR_NAME, _TILES_NAME, _TILE_M))


def furnish(
    background: Vector | None,
    shown_light: Vector | None,
    reach_m: float,
    spec: Any,  # noqa: ANN401 - imported late
) -> None:
    """Add floor, lamp and sky to the specification of a model.

    Floor and sky have one colour, or, if it is None, the floor has tiles of 10 cm. A
    light that robots read is shown as a ball; ``reach_m`` is half the width of what is
    shown.
    """
    import mujoco  # noqa: PLC0415 - after its engine is chosen

    if shown_light is not None:
        ball = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE)
        ball.pos, ball.size[0], ball.rgba = shown_light, LIGHT_M, LIGHT_COLOUR
        ball.contype = ball.conaffinity = 0

    spec.visual.global_.fovy = FIELD_OF_VIEW
    spec.visual.headlight.ambient = (_AMBIENT, _AMBIENT, _AMBIENT)
    spec.visual.headlight.diffuse = spec.visual.headlight.specular = (0.0, 0.0, 0.0)
    spec.visual.quality.offsamples = _SMOOTHING
    # Robots are small: a near clipping plane.
    spec.stat.extent = reach_m
    spec.visual.map.znear = 0.05
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=background or _TILES[0],
        width=16,
        height=96,
    )
    first, second = (background, background) if background else _TILES
    spec.add_texture(
        name=_TILES_NAME,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=first,
        rgb2=second,
        width=256,
        height=256,
    )
    floor = spec.add_material(name=_FLOOR_NAME)
    floor.textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = _TILES_NAME
    floor.texuniform = True
    floor.texrepeat = (1.0 / _TILE_M, 1.0 / _TILE_M)
    floor.specular = 0.0
    for geom in spec.worldbody.geoms:
        if geom.name in _GROUND:
            geom.material = _FLOOR_NAME
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        castshadow=True,
        diffuse=(_LAMP, _LAMP, _LAMP),
        specular=(0.0, 0.0, 0.0),
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
