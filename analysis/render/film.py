"""Pictures of robots in motion, drawn one by one."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import overload

import numpy as np

from analysis.render.marks import rods_needed, way_marks, with_names, with_scale
from analysis.render.motion import frames
from analysis.render.picture import RobotRenderer
from analysis.render.stage import Picture
from schema.experiment.settings import EvaluationSettings
from schema.parts import Vector
from schema.robot.robot import Robot
from schema.robot.trace import Floats

_PAGES = ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
"""Colours on which transparent pictures are drawn."""


@dataclass(frozen=True, slots=True)
class Look:
    """How robots are shown.

    Attributes:
        size: of a picture [pixels].
        camera: one of ``CAMERAS``.
        background: that of ``furnish``.
        is_clear: whether the background is transparent.
        has_trail: whether the way of each core is drawn.
        has_start: whether each start is marked.
        has_scale: whether there is a scale bar.
    """

    size: tuple[int, int]
    camera: str
    background: Vector | None = None
    is_clear: bool = False
    has_trail: bool = False
    has_start: bool = False
    has_scale: bool = False


class Film(AbstractContextManager["Film"], Sequence[Picture]):
    """Pictures of one robot, or of several by name, that are drawn when asked for."""

    def __init__(
        self,
        robots: Robot | dict[str, Robot],
        settings: EvaluationSettings,
        look: Look,
        poses: Sequence[Floats] = (),
        interval_s: float = 1.0,
        *,
        is_fine: bool,
        advance: Callable[[], object] = lambda: None,
    ) -> None:
        """Place the camera; without poses, one robot is in neutral pose.

        ``advance`` is called with each picture.

        Raises:
            ExperimentError: invalid scenery.
        """
        self._names = list(robots) if isinstance(robots, dict) else []
        shown = [*robots.values()] if isinstance(robots, dict) else robots
        self._look, self._advance = look, advance
        marks = {"has_trail": look.has_trail, "has_start": look.has_start}
        rods = rods_needed(max(1, len(self._names)), **marks)
        self._renderers = [
            RobotRenderer(
                shown, settings, size=look.size, background=page, rods=rods,
                is_fine=is_fine,
            )
            for page in (_PAGES if look.is_clear else (look.background,))
        ]  # fmt: skip
        first = self._renderers[0]
        self._poses = poses or [first.stage.data.qpos.copy()]
        for renderer in self._renderers:
            self._frames = frames(renderer, self._poses, look.camera, interval_s)
        self._rods = way_marks(first, self._poses, **marks)

    def __exit__(self, *_: object) -> None:
        for renderer in self._renderers:
            renderer.stage.close()

    def __len__(self) -> int:
        return len(self._poses)

    @overload
    def __getitem__(self, index: int) -> Picture: ...

    @overload
    def __getitem__(self, index: slice) -> list[Picture]: ...

    def __getitem__(self, index: int | slice) -> Picture | list[Picture]:
        if isinstance(index, slice):
            return [self[at] for at in range(len(self))[index]]
        if not 0 <= index < len(self):
            raise IndexError(index)
        self._advance()
        first, *others = [self._drawn(one, index) for one in self._renderers]
        return _see_through(first, others[0]) if others else first

    def _drawn(self, renderer: RobotRenderer, index: int) -> Picture:
        look, frame = self._look, self._frames[index]
        done = index / max(1, len(self) - 1)
        shown = [one for when, one in self._rods if when <= done]
        picture = renderer.picture(self._poses[index], frame, shown)
        if look.has_scale:
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
