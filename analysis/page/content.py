"""Content of a page: robots, their motion, the ground, curves; and the page itself.

The script of the page, ``page.js``, reads the content as JSON. Positions are in the
world's frame [m], quaternions x, y, z, w; numbers over time are 32-bit floats in
base64.
"""

import base64
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from analysis.viewer.body import box_model
from analysis.viewer.ground import Relief, Surface
from schema.parts import BodySpace
from schema.robot.robot import Robot
from schema.robot.trace import Floats

_DIGITS = 5
"""Decimals of lengths [m] and quaternions."""


def moving(
    name: str,
    robot: Robot,
    space: BodySpace,
    rows: Floats,
    *,
    interval_s: float,
    start_s: float = 0.0,
    is_plain: bool = False,
    **facts: Any,  # noqa: ANN401 - any JSON
) -> dict[str, Any]:
    """Return a robot and its motion.

    Args:
        name: shown.
        robot: its body.
        space: its part types.
        rows: (T, 7 + J) position, attitude w, x, y, z and angles by ascending part.
        interval_s: between two rows [s].
        start_s: time of the first row [s].
        is_plain: whether each part is one box.
        facts: further entries of a robot: ``fitness``, ``unit``, ``ancestry``,
            ``commands`` (T', M) of M ``motors``, at intervals ``commands_s``.
    """
    model = box_model(robot, space, is_plain=is_plain)
    boxes = np.hstack(
        [
            model.segments[:, np.newaxis],
            model.centres,
            model.attitudes[model.attitude_of],
            2.0 * model.half_sizes,
            model.colours / 255.0,
        ]
    )
    return {
        "name": name,
        "start_s": start_s,
        "interval_s": interval_s,
        "joints": len(model.parents) - 1,
        "parts": len(robot.parts),
        "parents": model.parents,
        "anchors": np.round(model.anchors, _DIGITS).tolist(),
        "axes": np.round(model.axes, _DIGITS).tolist(),
        "slides": model.slides,
        "boxes": np.round(boxes, _DIGITS).tolist(),
        "motion": packed(rows),
        **facts,
    }


def packed(numbers: npt.ArrayLike) -> str:
    """Return numbers as 32-bit floats in base64."""
    return base64.b64encode(np.asarray(numbers, "<f4").tobytes()).decode()


def grounds(surfaces: Sequence[Surface], walls: Floats) -> list[dict[str, Any]]:
    """Return rough ground, scenery and walls, (W, 10), as shapes."""
    shapes: list[dict[str, Any]] = []
    for one in surfaces:
        if isinstance(one, Relief):
            nodes = np.unique(one.corners.reshape(-1, 3), axis=0)  # by x, then y
            extent_m, heights = float(nodes[-1, 0]), packed(nodes[:, 2])
            shapes.append({"shape": "mesh", "extent": extent_m, "heights": heights})
            continue
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = one.rotation, one.centre
        shapes.append({
            "shape": one.shape, "size": one.size.tolist(), "colour": one.colour,
            "frame": frame.T.ravel().tolist(),
        })  # fmt: skip
    shapes += [{"shape": "wall", "wall": wall.tolist()} for wall in walls]
    return shapes


def page(title: str, lead: str, content: Mapping[str, Any]) -> str:
    """Return a page as HTML: ``robots`` of ``moving``, ``grounds``, and ``curves``.

    A curve has a ``title``, ``times`` [s] and ``values``.
    """
    data = msgspec.json.encode(content).decode().replace("</", "<\\/")
    fills = {
        "TITLE": escape(title),
        "LEAD": escape(lead),
        "STYLE": _file("page.css"),
        "DATA": data,
        "LIBRARY": _file("three.min.js"),
        "SCRIPT": _file("page.js"),
    }
    text = _file("page.html")
    for name, fill in fills.items():
        text = text.replace(f"<!--{name}-->", fill)
    return text


def _file(name: str) -> str:
    return files("analysis.page").joinpath(name).read_text("utf-8")
