"""Off-screen rendering of robots.

MuJoCo renders through EGL or, where that is missing, OSMesa. It chooses between them at
its first import, so ``choose_engine`` must be called before. Where neither works, the
ray caster draws.
"""

import ctypes.util
import os
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from analysis.render.framing import framed
from schema.agent.log import tell_user
from schema.errors import RevolveError, one_line
from schema.experiment.document import body_space
from schema.experiment.environment import LIGHT_COLOUR, LIGHT_M
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.parts import Vector
from schema.robot.results import Floats, Track
from schema.robot.robot import Robot

Picture = npt.NDArray[np.uint8]
"""(H, W, 3) red, green, blue."""

_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
_SETTING = "MUJOCO_GL"
_OFF = ("disable", "disabled", "off", "false", "0")
"""Values of the setting for which MuJoCo loads no graphics library."""
_AZIMUTH, _ELEVATION = 130.0, -28.0
_FIELD_OF_VIEW = 45.0
_FLOOR_NAME = "floor"
_FLOOR = ((0.93, 0.94, 0.95), (0.86, 0.88, 0.90))
_SKY = (1.0, 1.0, 1.0)
_TILE_M = 0.2
_GROUND = ("ground", "rough")


class NoPictures(RevolveError):  # noqa: N818 - names what is missing
    """A picture cannot be rendered or written."""


def choose_engine() -> str:
    """Choose the backend of MuJoCo's renderer, and return its name.

    Returns:
        The value of ``MUJOCO_GL``; "disable" if neither EGL nor OSMesa is installed.
    """
    if "mujoco" not in sys.modules and not os.environ.get(_SETTING):
        os.environ[_SETTING] = _installed() or _OFF[0]
    return os.environ.get(_SETTING, "")


def _installed() -> str | None:
    """Return the first backend whose library is installed."""
    if find_spec("OpenGL") is None:
        return None
    found = (
        name for name, file in _LIBRARIES.items() if ctypes.util.find_library(file)
    )
    return next(found, None)


@lru_cache(maxsize=1)
def _tell_fallback(why: str) -> None:
    """Say once why robots are drawn without OpenGL."""
    tell_user(f"robots are drawn without OpenGL: {why}")


class RobotRenderer:
    """Renders one robot on a tiled floor; a context manager.

    Attributes:
        model: MuJoCo model of the robot; poses are its ``qpos``.
    """

    def __init__(
        self,
        robot: Robot,
        settings: EvaluationSettings,
        *,
        size: tuple[int, int] = (640, 480),
    ) -> None:
        """Build the model, with the robot in neutral pose.

        Args:
            robot: a valid robot.
            settings: its part types, simulation, ground and scenery.
            size: width and height of pictures [pixels].

        Raises:
            ExperimentError: invalid scenery.
        """
        engine = choose_engine()
        import mujoco  # noqa: PLC0415 - after its engine is chosen

        from schema.mjcf.model import solo_spec  # noqa: PLC0415 - the same

        self._mujoco: Any = mujoco
        self.model = solo_spec(
            robot,
            body_space(settings.space),
            settings.simulation,
            settings.environment,
            furnish=partial(_furnish, size, settings.environment.light),
        ).compile()
        self._data = mujoco.MjData(self.model)
        self._renderer = _renderer(self.model, engine, size)
        mujoco.mj_forward(self.model, self._data)
        own = self.model.body("root").id
        geoms = self.model.body_rootid[self.model.geom_bodyid] == own
        self._size, self._geoms = size, geoms
        centres = self._data.geom_xpos[geoms]
        reaches = self.model.geom_rbound[geoms, np.newaxis]
        low, high = (centres - reaches).min(axis=0), (centres + reaches).max(axis=0)
        # Centre and radius of a sphere around the robot in neutral pose, in the frame
        # of the core.
        self._middle = 0.5 * (low + high) - self._data.qpos[:3]
        away = np.linalg.norm(centres - 0.5 * (low + high), axis=1)
        self._radius = float((away + reaches[:, 0]).max())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def picture(
        self,
        pose: Floats | None = None,
        *,
        look_at: Floats | None = None,
        distance_m: float | None = None,
    ) -> Picture:
        """Return a picture of the robot in a pose.

        Args:
            pose: (nq,) ``qpos`` of the model; the previous pose if None.
            look_at: (3,) point that the camera looks at [m]; the robot if None.
            distance_m: of the camera from there [m]; None: just enough for the robot
                in neutral pose.
        """
        if pose is not None:
            self._data.qpos[:] = pose
        mujoco = self._mujoco
        mujoco.mj_forward(self.model, self._data)
        camera = mujoco.MjvCamera()
        middle = self._data.qpos[:3] + self._middle
        camera.lookat[:] = middle if look_at is None else look_at
        near_m = 1.05 * self._radius / np.sin(np.radians(_FIELD_OF_VIEW / 2))
        camera.distance = near_m if distance_m is None else distance_m
        camera.azimuth, camera.elevation = _AZIMUTH, _ELEVATION
        self._renderer.update_scene(self._data, camera)
        return np.array(self._renderer.render())

    def framing(
        self, poses: Sequence[Floats], cut: tuple[float, float]
    ) -> tuple[Floats, float]:
        """Return where a camera that stands still sees the robot in all of some poses.

        Args:
            poses: (nq,) each; at least one.
            cut: shares of the picture's height that are cut off above and below.

        Returns:
            ``look_at`` and ``distance_m`` of ``picture``.
        """
        centres = []
        for pose in poses:
            self._data.qpos[:] = pose
            self._mujoco.mj_kinematics(self.model, self._data)
            centres.append(self._data.geom_xpos[self._geoms])
        radii = np.tile(self.model.geom_rbound[self._geoms], len(poses))
        edge, (width, height) = np.tan(np.radians(_FIELD_OF_VIEW / 2)), self._size
        above, below = ((1 - 2 * share) * edge for share in cut)
        view = np.radians(_AZIMUTH), np.radians(_ELEVATION)
        tangents = above, below, width / height * edge
        return framed(np.concatenate(centres), radii, *view, tangents)


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
        why = f"{_SETTING} is {engine}" if _installed() else "no EGL or OSMesa here"
    else:
        try:
            return mujoco.Renderer(model, height, width)
        # The type of the exception depends on the backend.
        except Exception as error:  # noqa: BLE001
            why = f"{engine or 'its default backend'} does not work: {one_line(error)}"
    _tell_fallback(why)
    floor = (_FLOOR_NAME, np.array(_FLOOR, np.float32), _TILE_M)
    return RayCaster(model, height, width, floor=floor)


def _furnish(
    size: tuple[int, int],
    shown_light: Vector | None,
    spec: Any,  # noqa: ANN401 - imported late
) -> None:
    """Add floor, light and sky to the specification of a model.

    Args:
        size: width and height of pictures [pixels].
        shown_light: position of the light that robots read, shown as a ball [m].
        spec: of the model.
    """
    import mujoco  # noqa: PLC0415 - after its engine is chosen

    if shown_light is not None:
        ball = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE)
        ball.pos, ball.size[0], ball.rgba = shown_light, LIGHT_M, LIGHT_COLOUR
        ball.contype = ball.conaffinity = 0

    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    spec.visual.global_.fovy = _FIELD_OF_VIEW
    spec.visual.headlight.ambient = (0.35, 0.35, 0.35)
    spec.visual.headlight.diffuse = (0.35, 0.35, 0.35)
    spec.visual.headlight.specular = (0.0, 0.0, 0.0)
    spec.visual.quality.shadowsize = 2048
    # Robots are small: a near clipping plane and fine shadows.
    spec.stat.extent = 0.5
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
        pos=(-0.5, -0.8, 3.0),
        dir=(0.15, 0.25, -1.0),
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        castshadow=True,
        cutoff=60.0,
        exponent=1.0,
        attenuation=(1.0, 0.0, 0.0),
        diffuse=(0.5, 0.5, 0.5),
        specular=(0.1, 0.1, 0.1),
    )


def gait_strip(
    pictures: Sequence[Picture], times_s: Sequence[float] = (), *, columns: int = 5
) -> Picture:
    """Return pictures side by side in rows; the rest of the last row is white.

    Args:
        pictures: pictures of one size; at least one.
        times_s: simulated time of each, written below it [s]; empty: none is written.
        columns: most pictures in a row.
    """
    if times_s:
        marked = zip(pictures, times_s, strict=True)
        pictures = [_with_time(each, time_s) for each, time_s in marked]
    height, width, _ = pictures[0].shape
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    cells = np.full((rows * columns, height, width, 3), 255, np.uint8)
    cells[: len(pictures)] = pictures
    strip = cells.reshape(rows, columns, height, width, 3).swapaxes(1, 2)
    return strip.reshape(rows * height, columns * width, 3)


def _with_time(picture: Picture, time_s: float) -> Picture:
    """Return a picture with its time below, in black on white."""
    height, width, _ = picture.shape
    size = max(10, width // 16)
    image = Image.new("RGB", (width, height + 3 * size // 2), "white")
    image.paste(Image.fromarray(picture))
    font = ImageFont.load_default(size)
    middle = (width / 2, height + 3 * size / 4)
    text = f"{time_s:.2f} s"
    ImageDraw.Draw(image).text(middle, text, "black", font, anchor="mm")
    return np.asarray(image)


def save_picture(picture: Picture, path: Path) -> None:
    """Write a picture in the format of the file's ending.

    Raises:
        NoPictures: the ending is unknown, or the file cannot be written.
    """
    _save(Image.fromarray(picture), path)


def save_animation(pictures: Sequence[Picture], path: Path, interval_s: float) -> None:
    """Write pictures as an animation that repeats (.gif).

    Args:
        pictures: pictures of one size; at least one.
        path: path that ends in .gif.
        interval_s: time between two pictures [s]; a GIF stores hundredths.

    Raises:
        NoPictures: the file cannot be written.
    """
    first, *others = map(Image.fromarray, pictures)
    pause_ms = round(1000 * interval_s)
    _save(first, path, save_all=True, append_images=others, duration=pause_ms, loop=0)


def _save(image: Image.Image, path: Path, **options: Any) -> None:  # noqa: ANN401 - Pillow's
    try:
        image.save(path, **options)
    except OSError as error:
        raise NoPictures(f"{path}: cannot be written: {error.strerror}") from None
    except ValueError as error:
        raise NoPictures(f"{path}: {error}") from None


class Simulate(Protocol):
    """The worker's simulation of one robot."""

    def __call__(
        self,
        robot: Robot,
        settings: EvaluationSettings,
        *,
        identity: Identity = NO_IDENTITY,
        watch: Callable[[Any], None],
    ) -> Track:
        """Return the robot's track; each tick calls ``watch`` with ``MjData``."""
