"""Command line flags of ``revolve view``; needs no viewer."""

from pathlib import Path

from schema.agent.command import NETWORK, add_shared
from schema.agent.flags import Flags, add_plugins, birth_name, number
from schema.robot.ids import BirthId

HOST, PORT = "127.0.0.1", 9876
"""Address of the server for viewers."""
LAST_S, FILM_S = 600.0, 20.0
"""Simulated time at the end of a run that is replayed and filmed by default [s]."""
BEST, BEST_EVER = "best", "best-ever"
"""Robots with a name: the fittest of the last population, and of all evaluated."""


def parser(_command: str = "view") -> Flags:
    """Return the parser of ``revolve view``."""
    flags = Flags(
        prog="revolve view",
        description="Show a live run, or replay one from its tables.",
        examples=(
            "revolve view runs/scenario3-seed1",
            "revolve view runs/scenario1-seed1 --robot best --save best.rrd",
            "revolve view runs/scenario3-seed1 --save arena.gif --from 100 --until 120",
            "revolve view --connect runs/scenario3-seed1    # while it runs",
        ),
    )
    flags.add_argument(
        "run",
        nargs="?",
        type=Path,
        metavar="RUN",
        help="run folder, to be replayed (default: the live run at the hub)",
    )
    add_shared(flags, "--connect")
    flags.add_argument(
        "--save", type=Path, metavar="FILE",
        help="write a recording (.rrd), or, of an arena and without a viewer, a film "
        "(.gif, .mp4, .webm) or web page (.html), instead of opening a window",
    )  # fmt: skip
    flags.add_argument(
        "--serve", nargs="?", const=f"{HOST}:{PORT}", metavar="HOST:PORT",
        help=f"serve viewers instead of opening a window (default: {HOST}:{PORT})",
    )  # fmt: skip
    flags.add_argument(
        "--follow", type=_robot_name, metavar="ISLAND:BIRTH",
        help="robot that the camera follows, such as 1:17; without ISLAND, island 0",
    )  # fmt: skip
    flags.add_argument(
        "--robot", action="append", default=[], type=selected, metavar="ROBOT",
        help="re-simulate a robot and show its full motion: 'best' (of the last "
        "population), 'best-ever' (evaluated, dead or alive), BIRTH of island 0, or "
        "ISLAND:BIRTH; may be repeated",
    )  # fmt: skip
    flags.add_argument(
        "--ancestry", action="store_true",
        help="with --robot: also its first parent, and so on back to the founder",
    )  # fmt: skip
    flags.add_argument(
        "--from", dest="start", type=number, metavar="S",
        help="replay poses from this simulated time on [s] (default: the last "
        f"{LAST_S:g} s; of a film the last {FILM_S:g} s)",
    )  # fmt: skip
    flags.add_argument(
        "--until", type=number, metavar="S", help="replay poses up to this time [s]"
    )
    add_shared(flags, *NETWORK)
    add_plugins(flags)
    return flags


def _robot_name(text: str) -> BirthId:
    """Return the individual of a flag, as ``birth_name``; ``17`` is of island 0."""
    island, number_there = birth_name(text)
    return BirthId(island or 0, number_there)


def selected(text: str) -> BirthId | str:
    """Return the robot of ``--robot``: an individual, or a name such as ``best``."""
    return text if text in (BEST, BEST_EVER) else _robot_name(text)
