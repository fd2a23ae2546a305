"""Pictures of one robot, and their files."""

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from analysis.render.stage import FIELD_OF_VIEW, Picture, Stage, choose_engine, furnish
from schema.errors import RevolveError
from schema.experiment.document import body_space
from schema.experiment.settings import EvaluationSettings
from schema.robot.robot import Robot
from schema.robot.trace import Floats, Trace

Simulate = Callable[..., Trace]
"""The worker's simulation of a robot with settings; it may take an ``identity``.

Each tick calls ``watch`` with ``MjData``.
"""
_COLOURS = 256
_SAMPLES = 6
"""Pictures from which the colours of a film are chosen."""
_REACH_M = 0.5
"""Half width of what a picture of a robot shows, for light and clipping [m]."""


class NoPictures(RevolveError):  # noqa: N818 - names what is missing
    """A picture cannot be rendered or written."""


class RobotRenderer(AbstractContextManager["RobotRenderer"]):
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

        Raises:
            ExperimentError: invalid scenery.
        """
        choose_engine()
        from schema.mjcf.model import solo_spec  # noqa: PLC0415 - imports MuJoCo

        self.model = solo_spec(
            robot,
            body_space(settings.space),
            settings.simulation,
            settings.environment,
            furnish=partial(furnish, size, settings.environment.light, _REACH_M),
        ).compile()
        self._stage = Stage(self.model, size)
        data = self._stage.data
        self._stage.pose(data.qpos)
        own = self.model.body("root").id
        self._geoms = self.model.body_rootid[self.model.geom_bodyid] == own
        centres = data.geom_xpos[self._geoms]
        reaches = self.model.geom_rbound[self._geoms, np.newaxis]
        low, high = (centres - reaches).min(axis=0), (centres + reaches).max(axis=0)
        # Centre and radius of a sphere around the robot in neutral pose, in the frame
        # of the core.
        self._middle = 0.5 * (low + high) - data.qpos[:3]
        away = np.linalg.norm(centres - 0.5 * (low + high), axis=1)
        self._radius = float((away + reaches[:, 0]).max())

    def __exit__(self, *_: object) -> None:
        self._stage.close()

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
        stage = self._stage
        if pose is not None:
            stage.pose(pose)
        middle = stage.data.qpos[:3] + self._middle
        near_m = 1.05 * self._radius / np.sin(np.radians(FIELD_OF_VIEW / 2))
        return stage.picture(
            middle if look_at is None else look_at,
            near_m if distance_m is None else distance_m,
        )

    def framing(
        self, poses: Sequence[Floats], cut: tuple[float, float]
    ) -> tuple[Floats, float]:
        """Return ``look_at`` and ``distance_m`` to see a robot and its shadow in poses.

        Shares of the picture's height may be cut off above and below.
        """
        centres: list[Floats] = []
        lamp = self._stage.data.light_xpos[0]
        for pose in poses:
            self._stage.pose(pose)
            places = self._stage.data.geom_xpos[self._geoms]
            height = np.clip(places[:, 2:], 0.0, 0.5 * lamp[2])
            away = (places - lamp) * height / (lamp[2] - height)
            centres += [places, places + away]
        radii = np.tile(self.model.geom_rbound[self._geoms], len(centres))
        return self._stage.framing(np.concatenate(centres), radii, cut)


def gait_strip(
    pictures: Sequence[Picture], texts: Sequence[str] = (), *, columns: int = 5
) -> Picture:
    """Return pictures of one size in rows; the rest of the last row is white.

    The text of each, such as its simulated time, is written below it, if given.
    """
    if texts:
        marked = zip(pictures, texts, strict=True)
        pictures = [_with_text(picture, text) for picture, text in marked]
    height, width, _ = pictures[0].shape
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    cells = np.full((rows * columns, height, width, 3), 255, np.uint8)
    cells[: len(pictures)] = pictures
    strip = cells.reshape(rows, columns, height, width, 3).swapaxes(1, 2)
    return strip.reshape(rows * height, columns * width, 3)


def _with_text(picture: Picture, text: str) -> Picture:
    height, width, _ = picture.shape
    size = max(10, width // 16)
    image = Image.new("RGB", (width, height + 3 * size // 2), "white")
    image.paste(Image.fromarray(picture))
    font = ImageFont.load_default(min(size, 5 * width // (3 * len(text))))
    middle = (width / 2, height + 3 * size / 4)
    ImageDraw.Draw(image).text(middle, text, "black", font, anchor="mm")
    return np.asarray(image)


def save_picture(picture: Picture, path: Path) -> None:
    """Write a picture in the format of the file's ending.

    Raises:
        NoPictures: the ending is unknown, or the file cannot be written.
    """
    with _writing(path):
        Image.fromarray(picture).save(path)


def save_animation(pictures: Sequence[Picture], path: Path, interval_s: float) -> None:
    """Write pictures as a ``gif``.

    Raises:
        NoPictures: the file cannot be written.
    """
    with _writing(path):
        path.write_bytes(gif(pictures, interval_s, _COLOURS))


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        why = f"cannot be written: {error.strerror or error}"
        raise NoPictures(f"{path}: {why}") from None
    except ValueError as error:
        raise NoPictures(f"{path}: {error}") from None


def gif(pictures: Sequence[Picture], interval_s: float, colours: int) -> bytes:
    """Return pictures as a GIF that repeats.

    All pictures share one palette without dithering, so that what does not move is
    stored once.

    Args:
        pictures: pictures of one size; at least one.
        interval_s: time between two pictures [s]; a GIF stores hundredths.
        colours: size of the palette, at most 256.
    """
    every = -(-len(pictures) // _SAMPLES)
    samples = Image.fromarray(np.concatenate(pictures[::every]))
    palette = samples.quantize(colours, Image.Quantize.MEDIANCUT)
    first, *others = (
        Image.fromarray(one).quantize(palette=palette, dither=Image.Dither.NONE)
        for one in pictures
    )
    file = io.BytesIO()
    first.save(
        file,
        "GIF",
        save_all=True,
        append_images=others,
        duration=round(1000 * interval_s),
        loop=0,
    )
    return file.getvalue()
