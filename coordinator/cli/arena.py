"""``revolve arena``: inspect and control a running arena."""

import argparse
import sys
from pathlib import Path
from uuid import uuid4

from coordinator.cli.status import ask, ask_status
from schema.agent.command import NETWORK, add_shared
from schema.agent.flags import Flags, add_count, birth_name, number
from schema.agent.log import tell_user
from schema.errors import NetworkError
from schema.formats.run_settings import read_with_settings
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.operator import (
    InsertRobot,
    ListRobots,
    OperatorAction,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
    selected_names,
)
from schema.wire.status import RunStatus

ACTIONS = {
    "list": "list the living robots",
    "pause": "pause the arena at its next decision",
    "resume": "resume a paused arena",
    "insert": "insert the robot in a file",
    "remove": "remove a robot",
    "brain": "replace a robot's brain with that of the robot in a file",
    "snapshot": "save the arena's state in the run folder",
}

PLAIN: dict[str, OperatorAction] = {
    "list": ListRobots(),
    "pause": PauseArena(),
    "resume": ResumeArena(),
    "snapshot": SaveSnapshot(),
}

_ANY = ("", "--connect runs/scenario3-seed1")
_EXAMPLES = {
    "list": _ANY,
    "pause": _ANY,
    "resume": _ANY,
    "insert": ("best.yaml --place 0.5 -1.2", "wheeled.yaml --experiment mine.toml"),
    "remove": ("17", "0:17 --island 1 --connect runs/archipelago-arenas-seed1"),
    "brain": ("17 best.yaml", "17 best.yaml --island 1"),
    "snapshot": _ANY,
}


def main(arguments: list[str]) -> int:
    """Send one request to a running coordinator and print its reply.

    Returns:
        0 if done, 1 if refused.
    """
    options = parser().parse_args(arguments[1:])
    action = _action(options)
    coordinator = _coordinator(options)
    request = OperatorRequest(uuid4().hex, options.island, action, options.run)
    reply = ask(options, request, coordinator)[coordinator]
    stream = sys.stderr if reply.is_refused else sys.stdout
    stream.write(f"{reply.text}\n")
    return 1 if reply.is_refused else 0


def _coordinator(options: argparse.Namespace) -> str:
    """Return the name of the coordinator whose run ``--run`` selects."""
    statuses = ask_status(options)
    runs = [run for status in statuses.values() for run in status.runs]
    selected = selected_names(options.run, map(_name, runs))
    folders = {
        name: chosen
        for name, status in statuses.items()
        if (chosen := [run.folder for run in status.runs if _name(run) in selected])
    }
    if len(folders) == 1:
        ((name, chosen),) = folders.items()
        # The hub of the user may have another run than the one that is meant.
        tell_user(f"arena of {chosen[0]}" if len(chosen) == 1 else f"arena of {name}")
        return name
    raise NetworkError(
        f"{options.connect}: exactly one coordinator must have a run "
        f"{options.run!r}, got {len(folders)} of {len(statuses)}; choose one by --run"
    )


def _name(run: RunStatus) -> str:
    return Path(run.folder).name


def _action(options: argparse.Namespace) -> OperatorAction:
    if options.action in PLAIN:
        return PLAIN[options.action]
    if options.action == "insert":
        place = tuple(options.place) if options.place else None
        return InsertRobot(_robot(options), place)
    island, birth_number = options.birth
    birth = BirthId(options.island if island is None else island, birth_number)
    if options.action == "remove":
        return RemoveRobot(birth)
    return SetBrain(birth, _robot(options))


def _robot(options: argparse.Namespace) -> Robot:
    """Return the robot of a file."""
    robot, *_ = read_with_settings(Path(options.file), options.experiment)
    return robot


def parser(_command: str = "arena") -> Flags:
    """Return the parser of ``revolve arena``."""
    flags = Flags(
        prog="revolve arena",
        description="Inspect and control a running arena.",
        examples=(
            "revolve arena list --connect runs/scenario3-seed1",
            "revolve arena pause --connect runs/scenario3-seed1",
            "revolve arena remove 17",
        ),
    )
    actions = flags.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, what in ACTIONS.items():
        action = actions.add_parser(
            name,
            help=what,
            description=f"{what.capitalize()}.",
            examples=[
                f"revolve arena {name} {words}".rstrip() for words in _EXAMPLES[name]
            ],
        )
        if name in ("remove", "brain"):
            action.add_argument(
                "birth",
                type=birth_name,
                metavar="BIRTH",
                help="birth number, or ISLAND:N of a robot of another island, as the "
                "list has it",
            )
        if name in ("insert", "brain"):
            action.add_argument(
                "file", metavar="FILE", help="robot file: .yaml, .yml or .pb"
            )
            action.add_argument(
                "--experiment",
                metavar="NAME|FILE.toml",
                help="experiment whose settings to use (default: that in an MJCF "
                "file, else that of the run folder that holds the file, else all "
                "built-in part types)",
            )
        if name == "insert":
            action.add_argument(
                "--place", type=number, nargs=2, metavar=("X", "Y"),
                help="position [m] (default: drawn as for a birth)",
            )  # fmt: skip
        add_shared(action, "--connect")
        action.add_argument(
            "--run", default="", metavar="NAME",
            help="run whose folder is named NAME, else whose folder name ends with "
            "NAME (default: the only run)",
        )  # fmt: skip
        add_count(action, "--island", 0, "island number", least=0)
        add_shared(action, *NETWORK)
    return flags
