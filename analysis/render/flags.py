"""Command line flags of ``revolve robot render``; needs no renderer."""

import argparse
import re
from pathlib import Path

from schema.agent.flags import (
    Flags,
    add_count,
    add_plugins,
    add_settings,
    positive_number,
    whole_number,
)
from schema.limits import MOST_PIXELS
from schema.parts import Vector

PICTURE_ENDING = ".png"
FILM_ENDINGS = (".gif", ".mp4", ".webm")
PAGE_ENDING = ".html"
CAMERAS = ("follow", "fixed", "side", "top")
TRANSPARENT = "transparent"
MOST_FPS = 50
"""Frames per second, at most: a GIF counts hundredths, and browsers slow down 1."""
_LEAST_PIXELS = 16
_PAGES = {"white": (1.0, 1.0, 1.0), "black": (0.0, 0.0, 0.0), "grey": (0.5, 0.5, 0.5)}


def parser(_command: str = "robot render") -> Flags:
    """Return the parser of ``revolve robot render``."""
    flags = Flags(
        prog="revolve robot render",
        description="Render robots: in neutral pose, as a strip of consecutive "
        "pictures (--gait), or as a film of their evaluation (.gif, .mp4, .webm).",
        examples=(
            "revolve robot render best.yaml best.mp4 --experiment scenario1",
            "revolve robot render best.yaml best.png --gait 10 --size 320",
            "revolve robot render runs/a runs/b race.webm --trail --start-mark",
        ),
    )
    _add_robots(flags)
    flags.add_argument(
        "out", type=Path, metavar="OUT", help="file to write: .png, .gif, .mp4, .webm"
    )
    flags.add_argument(
        "--gait", type=whole_number(1), metavar="N",
        help="render N pictures, one per tick of the brain from the middle of the "
        "evaluation on, in rows of five",
    )  # fmt: skip
    flags.add_argument(
        "--size", "--width", type=_size, default=(640, 480), metavar="W[xH]",
        help="width and height of a picture in pixels (default: 640x480; the height "
        "is three quarters of the width)",
    )  # fmt: skip
    add_count(flags, "--fps", 25, "frames per second of a film", most=MOST_FPS)
    flags.add_argument(
        "--camera", choices=CAMERAS,
        help="moves with the robot (follow), or stands still and sees its whole way "
        "(default: follow; fixed for --gait and several robots)",
    )  # fmt: skip
    flags.add_argument(
        "--background", type=_background, metavar="COLOUR",
        help="colour of floor and sky: white, grey, black, #RRGGBB, or transparent "
        "for a picture (default: a floor with tiles of 10 cm)",
    )  # fmt: skip
    flags.add_argument(
        "--trail", action="store_true", help="draw the way of the core in a film"
    )
    flags.add_argument(
        "--start-mark", action="store_true", help="mark where the robot started"
    )
    flags.add_argument(
        "--scale-bar", action="store_true",
        help="draw a bar of a round length, at the distance of the robot",
    )  # fmt: skip
    return flags


def page_parser(_command: str = "robot page") -> Flags:
    """Return the parser of ``revolve robot page``."""
    flags = Flags(
        prog="revolve robot page",
        description="Write one HTML file in which robots move: it needs no network, "
        "and turns with the mouse.",
        examples=(
            "revolve robot page best.yaml best.html --experiment scenario1",
            "revolve robot page runs/a runs/b race.html --seconds 20",
        ),
    )
    _add_robots(flags)
    flags.add_argument("out", type=Path, metavar="OUT.html", help="page to write")
    return flags


def _add_robots(flags: Flags) -> None:
    flags.add_argument(
        "files", type=Path, nargs="+", metavar="FILE|RUN",
        help="robot file, or run folder, of which the best robot is shown; several "
        "robots move side by side from one start line",
    )  # fmt: skip
    flags.add_argument(
        "--seconds", type=positive_number, metavar="S",
        help="length of a film or page, from the start on (default: the evaluation)",
    )  # fmt: skip
    add_settings(flags, "that of the run folder that holds the file, else scenario1")
    add_plugins(flags)


def _size(text: str) -> tuple[int, int]:
    wide, has_height, high = text.partition("x")
    width = whole_number(_LEAST_PIXELS, MOST_PIXELS)(wide)
    if not has_height:
        return width, max(_LEAST_PIXELS, width * 3 // 4)
    return width, whole_number(_LEAST_PIXELS, MOST_PIXELS)(high)


def _background(text: str) -> Vector | str:
    if text == TRANSPARENT or text in _PAGES:
        return _PAGES.get(text, text)
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        red, green, blue = bytes.fromhex(text[1:])
        return red / 255.0, green / 255.0, blue / 255.0
    allowed = ", ".join((*_PAGES, "#RRGGBB", TRANSPARENT))
    raise argparse.ArgumentTypeError(f"must be one of {allowed}, got {text[:80]!r}")
