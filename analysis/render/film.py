"""Pictures of robots in motion, drawn one by one."""

import argparse
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from analysis.render.flags import TRANSPARENT
from analysis.render.motion import Shown, frames
from analysis.render.overlay import Rod, rod
from analysis.render.picture import Frame, RobotRenderer
from analysis.render.stage import FIELD_OF_VIEW, Picture
from schema.robot.trace import Floats

_INK = (70, 74, 82)
_TRAIL, _TRAIL_M = (222, 110, 45), 0.004
"""Colour and radius [m] of the line along a way."""
_START, _START_M = (150, 156, 166), 0.03
"""Colour and radius [m] of the disc at a start."""
_PIECES = 120
"""Straight pieces of the line along a way, at most."""
_STEPS = (1.0, 2.0, 5.0)
_BAR = 0.2
"""Greatest length of a scale bar, as a share of a picture's width."""


def way_marks(
    renderer: RobotRenderer,
    poses: Sequence[Floats],
    *,
    has_trail: bool,
    has_start: bool,
) -> list[tuple[float, Rod]]:
    """Return lines along the ways of the cores in poses, and discs at their starts.

    Each comes with the share of the poses after which it is shown.
    """
    rods = []
    chosen = np.linspace(0, len(poses) - 1, min(len(poses), _PIECES + 1)).round()
    paths = np.array([renderer.cores(poses[int(at)]) for at in chosen])
    for path in paths.swapaxes(0, 1):
        if has_start:
            ground = np.array([*path[0, :2], renderer.lowest_m(poses[0])])
            disc = rod(ground, np.array([0, 0, 0.001]), _START_M, _START)
            rods.append((0.0, disc))
        for at in range(1, len(path)) if has_trail else ():
            piece = rod(path[at - 1], path[at] - path[at - 1], _TRAIL_M, _TRAIL)
            rods.append((at / (len(path) - 1), piece))
    return rods


def with_scale(picture: Picture, distance_m: float) -> Picture:
    """Return a picture with a bar of a round length at the distance of the robots."""
    height, width = picture.shape[:2]
    metre = height / (2.0 * distance_m * np.tan(np.radians(FIELD_OF_VIEW / 2)))
    most_m = _BAR * width / metre
    power = 10.0 ** np.floor(np.log10(most_m))
    length_m = max(step * power for step in _STEPS if step * power <= most_m)
    size = max(10, width // 40)
    left, low, long = size, height - size, length_m * metre
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    draw.rectangle((left, low - size // 5, left + long, low), _INK)
    text = f"{length_m:g} m" if length_m >= 1.0 else f"{100 * length_m:g} cm"
    middle = (left + long / 2, low - size // 2)
    draw.text(middle, text, _INK, ImageFont.load_default(size), anchor="ms")
    return np.asarray(image)


def with_names(
    picture: Picture,
    renderer: RobotRenderer,
    names: Sequence[str],
    start: Floats,
    frame: Frame,
) -> Picture:
    """Return a picture with the names of robots below their places in a pose."""
    image = Image.fromarray(picture)
    draw, size = ImageDraw.Draw(image), max(10, picture.shape[1] // 45)
    font = ImageFont.load_default(size)
    spots = renderer.stage.pixels(renderer.cores(start), *frame)
    for name, (across, down) in zip(names, spots, strict=True):
        draw.text((across, down + 2 * size), name, _INK, font, anchor="mt")
    return np.asarray(image)


_PAGES = ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
"""Colours on which transparent pictures are drawn."""


class RobotFilm(AbstractContextManager["RobotFilm"], Sequence[Picture]):
    """Pictures of robots, drawn when asked for by number."""

    def __init__(
        self,
        shown: Shown,
        poses: Sequence[Floats],
        options: argparse.Namespace,
        interval_s: float = 1.0,
        *,
        is_fine: bool = True,
        advance: Callable[[], object] = lambda: None,
    ) -> None:
        """Place the camera, with the flags of ``revolve robot render``.

        ``advance`` is called with each picture.

        Raises:
            ExperimentError: invalid scenery.
        """
        self._names, self._poses = list(shown) if len(shown) > 1 else [], poses
        self._has_scale, self._advance = options.scale_bar, advance
        (robot, settings), *others = shown.values()
        robots = [robot, *(one for one, _ in others)] if others else robot
        marks = {"has_trail": options.trail, "has_start": options.start_mark}
        rods = len(shown) * (_PIECES * options.trail + options.start_mark)
        is_clear = options.background == TRANSPARENT
        self._renderers = [
            RobotRenderer(
                robots, settings, size=options.size, background=page,
                rods=rods, is_fine=is_fine,
            )
            for page in (_PAGES if is_clear else (options.background,))
        ]  # fmt: skip
        still = "fixed" if options.gait or others else "follow"
        for renderer in self._renderers:
            camera = options.camera or still
            self._frames = frames(renderer, poses, camera, interval_s)
        self._rods = way_marks(self._renderers[0], poses, **marks)

    def __exit__(self, *_: object) -> None:
        for renderer in self._renderers:
            renderer.stage.close()

    def __len__(self) -> int:
        return len(self._poses)

    def __getitem__(self, index: Any) -> Any:  # noqa: ANN401 - no slices
        # An index beyond the last raises what ends a loop.
        first, *others = [self._drawn(one, index) for one in self._renderers]
        self._advance()
        return _see_through(first, others[0]) if others else first

    def _drawn(self, renderer: RobotRenderer, index: int) -> Picture:
        frame, done = self._frames[index], index / max(1, len(self) - 1)
        rods = [rod for when, rod in self._rods if when <= done]
        picture = renderer.picture(self._poses[index], frame, rods)
        if self._has_scale:
            picture = with_scale(picture, frame[1])
        if self._names:
            start = self._poses[0]
            picture = with_names(picture, renderer, self._names, start, frame)
        return picture


def _see_through(on_white: Picture, on_black: Picture) -> Picture:
    """Return the picture, (H, W, 4), that looks like these on white and on black."""
    white, black = (each.astype(float) for each in (on_white, on_black))
    opaque = np.clip(255.0 - (white - black).mean(axis=2, keepdims=True), 0.0, 255.0)
    colour = np.clip(255.0 * black / np.maximum(opaque, 1.0), 0.0, 255.0)
    return np.concatenate([colour, opaque], axis=2).round().astype(np.uint8)
