"""Robots as pictures, without a screen.

MuJoCo draws them off the screen, through EGL or, where that is missing, OSMesa: which
of them is settled when MuJoCo is first imported, so ``choose_engine`` goes first.
"""

import ctypes.util
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt
from PIL import Image

from schema.errors import RevolveError
from schema.experiment.document import Simulation, Space
from schema.experiment.environment import Environment
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.parts import BodySpace
from schema.robot.results import Floats, Track
from schema.robot.robot import Robot

Picture = npt.NDArray[np.uint8]
"""(H, W, 3) red, green, blue."""

_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
_SETTING = "MUJOCO_GL"
_AZIMUTH, _ELEVATION = 130.0, -28.0
_FIELD_OF_VIEW = 45.0
_FLOOR = ((0.93, 0.94, 0.95), (0.86, 0.88, 0.90))
_SKY = (1.0, 1.0, 1.0)
_TILE_M = 0.1
_GROUND = ("ground", "rough")


class NoPictures(RevolveError):  # noqa: N818 - reads as what it says
    """Nothing here can draw without a screen."""


def choose_engine() -> str:
    """Settle what draws, and return its name.

    Raises:
        NoPictures: neither EGL nor OSMesa is installed.
    """
    if "mujoco" in sys.modules or os.environ.get(_SETTING):
        return os.environ.get(_SETTING, "")
    for name, library in _LIBRARIES.items():
        if ctypes.util.find_library(library):
            os.environ[_SETTING] = name
            return name
    raise NoPictures(
        "pictures need EGL or OSMesa: install one (Debian: libegl1 libgl1-mesa-dri, "
        "or libosmesa6)"
    )


class Studio:
    """One robot on a tiled floor, and a camera that looks at it.

    Attributes:
        model: MuJoCo's model of it; poses are its ``qpos``.
    """

    def __init__(
        self,
        robot: Robot,
        space: BodySpace,
        simulation: Simulation,
        environment: Environment,
        *,
        size: tuple[int, int] = (640, 480),
    ) -> None:
        """Set the robot up, at its neutral pose.

        Args:
            robot: a checked robot.
            space: its part types.
            simulation: the world's numbers.
            environment: what it stands in.
            size: width and height of pictures [pixels].

        Raises:
            NoPictures: what should draw does not work.
        """
        choose_engine()
        import mujoco  # noqa: PLC0415 - after its engine is chosen

        from schema.mjcf.model import solo_model  # noqa: PLC0415 - the same

        self._mujoco: Any = mujoco
        self.model = solo_model(
            robot, space, simulation, environment, furnish=_furnish(*size)
        )
        self._data = mujoco.MjData(self.model)
        try:
            self._renderer = mujoco.Renderer(self.model, size[1], size[0])
        # Whatever the engine raises: it is another one on each machine.
        except Exception as error:
            engine = os.environ.get(_SETTING, "OpenGL")
            raise NoPictures(f"{engine} cannot draw here: {error}") from error
        mujoco.mj_forward(self.model, self._data)
        geoms = self.model.geom_bodyid > 0
        centres = self._data.geom_xpos[geoms]
        reaches = self.model.geom_rbound[geoms, np.newaxis]
        low, high = (centres - reaches).min(axis=0), (centres + reaches).max(axis=0)
        # Of a sphere that holds the standing robot, in the frame of the core.
        self._middle = 0.5 * (low + high) - self._data.qpos[:3]
        away = np.linalg.norm(centres - 0.5 * (low + high), axis=1)
        self._radius = float((away + reaches[:, 0]).max())

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        """Let go of the engine."""
        self._renderer.close()

    def picture(
        self, pose: Floats | None = None, *, look_at: Floats | None = None
    ) -> Picture:
        """Return the robot in a pose.

        Args:
            pose: (nq,) of the model; neutral, standing, if None.
            look_at: (3,) point in the middle [m]; the robot's if None.
        """
        if pose is not None:
            self._data.qpos[:] = pose
        mujoco = self._mujoco
        mujoco.mj_forward(self.model, self._data)
        camera = mujoco.MjvCamera()
        middle = self._data.qpos[:3] + self._middle
        camera.lookat[:] = middle if look_at is None else look_at
        camera.distance = 1.05 * self._radius / np.sin(np.radians(_FIELD_OF_VIEW / 2))
        camera.azimuth, camera.elevation = _AZIMUTH, _ELEVATION
        self._renderer.update_scene(self._data, camera)
        return np.array(self._renderer.render())


def _furnish(width: int, height: int) -> Callable[[Any], None]:
    """Return what adds floor, light and sky to a world."""

    def add(spec: Any) -> None:  # noqa: ANN401 - the engine is imported late
        import mujoco  # noqa: PLC0415 - the same

        spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
        spec.visual.global_.fovy = _FIELD_OF_VIEW
        spec.visual.headlight.ambient = (0.35, 0.35, 0.35)
        spec.visual.headlight.diffuse = (0.35, 0.35, 0.35)
        spec.visual.headlight.specular = (0.0, 0.0, 0.0)
        spec.visual.quality.shadowsize = 2048
        # Robots are small: what is near must not be cut off, nor shadows be coarse.
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
        floor = spec.add_material(name="floor")
        floor.textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = "tiles"
        floor.texuniform = True
        floor.texrepeat = (0.5 / _TILE_M, 0.5 / _TILE_M)
        for geom in spec.worldbody.geoms:
            if geom.name in _GROUND:
                geom.material = "floor"
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

    return add


def gait_strip(pictures: Sequence[Picture], *, columns: int = 5) -> Picture:
    """Return consecutive pictures side by side, row by row, white where none is left.

    Args:
        pictures: all of one size; at least one.
        columns: how many stand in a row at most.
    """
    height, width, _ = pictures[0].shape
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    strip = np.full((rows * height, columns * width, 3), 255, np.uint8)
    for number, picture in enumerate(pictures):
        top, left = divmod(number, columns)
        strip[top * height : (top + 1) * height, left * width : (left + 1) * width] = (
            picture
        )
    return strip


def save_picture(picture: Picture, path: Path) -> None:
    """Write a picture; the ending says how (.png).

    Raises:
        NoPictures: an ending that nobody knows, or a file that cannot be written.
    """
    _write(path, lambda: Image.fromarray(picture).save(path))


def save_film(pictures: Sequence[Picture], path: Path, interval_s: float) -> None:
    """Write pictures as one that moves, over and over (.gif).

    Args:
        pictures: all of one size; at least one.
        path: ends in .gif.
        interval_s: from one to the next [s]; a GIF counts hundredths.

    Raises:
        NoPictures: a file that cannot be written.
    """
    frames = [Image.fromarray(picture) for picture in pictures]
    _write(
        path,
        lambda: frames[0].save(
            path,
            save_all=True,
            append_images=frames[1:],
            duration=round(1000 * interval_s),
            loop=0,
        ),
    )


def _write(path: Path, save: Callable[[], None]) -> None:
    try:
        save()
    except OSError as error:
        raise NoPictures(f"{path}: cannot be written: {error.strerror}") from None
    except ValueError as error:
        raise NoPictures(f"{path}: {error}") from None


class Simulate(Protocol):
    """What the worker has: a robot, alone, through its life."""

    def __call__(
        self,
        robot: Robot,
        space: Space,
        simulation: Simulation,
        environment: Environment,
        *,
        identity: Identity = NO_IDENTITY,
        watch: Callable[[Any], None],
    ) -> Track:
        """Return its track; ``watch`` is shown the engine's state at each tick."""
