"""``revolve arena``: look into a running arena, and give it orders."""

import argparse
import sys
from pathlib import Path
from uuid import uuid4

from coordinator.cli.status import ask_status
from coordinator.network.client_service import ask_coordinators
from schema.agent.command import add_network_flags, tls_of
from schema.errors import InvalidRobot, NetworkError
from schema.flags import Flags, number, whole_number
from schema.formats.files import read_robot
from schema.robot.ids import BirthId
from schema.wire.codec import encode_robot
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
    decode_operator_reply,
    encode_operator_request,
)

ACTIONS = {
    "list": "tell who lives there",
    "pause": "let it stand still, at its next decision",
    "resume": "let it go on",
    "insert": "put the robot of a file in",
    "remove": "take a robot out",
    "brain": "give a robot the brain of the robot of a file",
    "snapshot": "keep its state in the run folder",
}

PLAIN: dict[str, OperatorAction] = {
    "list": ListRobots(),
    "pause": PauseArena(),
    "resume": ResumeArena(),
    "snapshot": SaveSnapshot(),
}


def main(arguments: list[str]) -> int:
    """Ask one thing of a running coordinator.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done, 1 if refused.

    Raises:
        NetworkError: no coordinator is there, or it does not answer.
        InvalidRobot: a file that holds no robot.
    """
    options = _parser().parse_args(arguments[1:])
    action = _action(options)
    coordinator = _coordinator(options)
    request = OperatorRequest(uuid4().hex, options.island, action, options.run)
    data = ask_coordinators(
        encode_operator_request(request),
        connect=options.connect,
        fleet=options.fleet,
        tls=tls_of(options),
        only=coordinator,
    )[coordinator]
    reply = decode_operator_reply(data)
    stream = sys.stderr if reply.is_refused else sys.stdout
    stream.write(f"{reply.text}\n")
    return 1 if reply.is_refused else 0


def _coordinator(options: argparse.Namespace) -> str:
    """Return whose run is meant.

    Raises:
        NetworkError: not exactly one coordinator has such a run.
    """
    told = ask_status(options)
    names = [
        name
        for name, status in told.items()
        if any(Path(run.folder).name.endswith(options.run) for run in status.runs)
    ]
    if len(names) == 1:
        return names[0]
    raise NetworkError(
        f"{options.connect}: there must be one coordinator with a run "
        f"{options.run or 'at all'}, got {len(names)} of {len(told)}; name one by --run"
    )


def _action(options: argparse.Namespace) -> OperatorAction:
    if options.action in PLAIN:
        return PLAIN[options.action]
    if options.action == "insert":
        place = tuple(options.place) if options.place else None
        return InsertRobot(encode_robot(read_robot(_file(options.file))), place)
    birth = BirthId(options.island, options.birth)
    if options.action == "remove":
        return RemoveRobot(birth)
    return SetBrain(birth, encode_robot(read_robot(_file(options.file))))


def _file(name: str) -> Path:
    path = Path(name)
    if not path.is_file():
        raise InvalidRobot(f"{path}: no such file")
    return path


def _parser() -> argparse.ArgumentParser:
    parser = Flags(
        prog="revolve arena",
        description="Look into a running arena, and give it orders.",
        epilog="for example: revolve arena list --connect tcp/127.0.0.1:7447",
        allow_abbrev=False,
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, what in ACTIONS.items():
        action = actions.add_parser(
            name, help=what, description=what, allow_abbrev=False
        )
        if name in ("remove", "brain"):
            action.add_argument("birth", type=whole_number(0), help="its number")
        if name in ("insert", "brain"):
            action.add_argument("file", help="robot: .yaml, .yml or .pb")
        if name == "insert":
            action.add_argument(
                "--place", type=number, nargs=2, metavar=("X", "Y"),
                help="where [m]; drawn as for a birth if not given",
            )  # fmt: skip
        action.add_argument(
            "--connect", required=True, metavar="ADDRESS",
            help="the coordinator's address, as in the run folder's file 'address'",
        )  # fmt: skip
        action.add_argument(
            "--run", default="", metavar="NAME",
            help="end of its folder's name, where there are several",
        )  # fmt: skip
        action.add_argument(
            "--island", type=whole_number(0), default=0, help="default: 0"
        )
        add_network_flags(action)
    return parser
