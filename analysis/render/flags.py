"""Command line flags of ``revolve robot render``; needs no renderer."""

from pathlib import Path

from schema.agent.flags import Flags, add_plugins, add_settings, whole_number
from schema.limits import MOST_PIXELS


def parser(_command: str = "robot render") -> Flags:
    """Return the parser of ``revolve robot render``."""
    flags = Flags(
        prog="revolve robot render",
        description="Render a robot: in neutral pose, as a strip of consecutive "
        "pictures (--gait), or as an animation of its evaluation (.gif).",
        examples=(
            "revolve robot render best.yaml best.gif --experiment scenario1",
            "revolve robot render best.yaml best.png --gait 10 --width 320",
        ),
    )
    flags.add_argument("file", type=Path, metavar="FILE", help="robot file")
    flags.add_argument(
        "out", type=Path, metavar="OUT.png|OUT.gif", help="picture to write"
    )
    flags.add_argument(
        "--gait",
        type=whole_number(1),
        metavar="N",
        help="render N pictures, one per tick of the brain from the middle of the "
        "evaluation on, in rows of five",
    )
    flags.add_argument(
        "--width",
        type=whole_number(16, MOST_PIXELS),
        default=640,
        metavar="PIXELS",
        help="width of a picture (default: 640)",
    )
    add_settings(flags, "that of the run folder that holds the file, else scenario1")
    add_plugins(flags)
    return flags
