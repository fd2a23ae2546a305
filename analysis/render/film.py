"""Pictures of robots in motion, drawn one by one."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager

import numpy as np

from analysis.render.flags import TRANSPARENT
from analysis.render.marks import rods_needed, way_marks, with_names, with_scale
from analysis.render.motion import Shown, frames
from analysis.render.picture import RobotRenderer
from analysis.render.stage import Picture
from schema.robot.trace import Floats

_PAGES = ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
"""Colours on which transparent pictures are drawn."""


class RobotFilm(AbstractContextManager["RobotFilm"]):
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
        is_clear = options.background == TRANSPARENT
        self._renderers = [
            RobotRenderer(
                robots, settings, size=options.size, background=page,
                rods=rods_needed(len(shown), **marks), is_fine=is_fine,
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

    def __iter__(self) -> Iterator[Picture]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, index: int) -> Picture:
        self._advance()
        first, *others = [self._drawn(one, index) for one in self._renderers]
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
