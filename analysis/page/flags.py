"""Command line flags of ``revolve robot page``; needs no renderer."""

from pathlib import Path

from schema.agent.flags import Flags, add_plugins, add_settings, positive_number

PAGE_ENDING = ".html"


def parser(_command: str = "robot page") -> Flags:
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
    flags.add_argument(
        "files", type=Path, nargs="+", metavar="FILE|RUN",
        help="robot file, or run folder, of which the best robot is shown",
    )  # fmt: skip
    flags.add_argument("out", type=Path, metavar="OUT.html", help="page to write")
    flags.add_argument(
        "--seconds", type=positive_number, metavar="S",
        help="length of the motion, from the start on (default: the evaluation)",
    )  # fmt: skip
    add_settings(flags, "that of the run folder that holds the file, else scenario1")
    add_plugins(flags)
    return flags
