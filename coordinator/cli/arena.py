"""``revolve arena``: inspect and control a running arena."""

import argparse
import sys
from pathlib import Path
from uuid import uuid4

import msgspec

from coordinator.cli.status import ask, ask_status
from schema.agent.command import NETWORK, add_shared
from schema.agent.flags import Flags, add_count, number
from schema.agent.flags import birth_name as flagged_birth
from schema.agent.log import tell_user
from schema.errors import NetworkError, cut
from schema.formats.run_settings import read_with_settings
from schema.limits import MOST_NUMBER
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.operator import (
    MOST_PARENTS,
    ArenaListing,
    InsertRobot,
    ListRobots,
    OperatorAction,
    OperatorReply,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
    birth_name,
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
    "list": (*_ANY, "--json"),
    "pause": _ANY,
    "resume": _ANY,
    "insert": (
        "best.yaml --place 0.5 -1.2 --parents 12 17",
        "wheeled.yaml --experiment mine.toml",
    ),
    "remove": ("17", "0:17 --island 1 --connect runs/archipelago-arenas-seed1"),
    "brain": ("17 best.yaml", "17 best.yaml --island 1"),
    "snapshot": _ANY,
}


def main(arguments: list[str]) -> int:
    """Send one request to a running coordinator; print its reply; 1 if refused."""
    options = parser().parse_args(arguments[1:])
    action = _action(options)
    coordinator, where = coordinator_of(options)
    # The hub of the user may have another run than the one that is meant.
    tell_user(where)
    reply = send(options, action, coordinator)
    if reply.is_refused:
        sys.stderr.write(f"{reply.text}\n")
        return 1
    print(reply.text if reply.arena is None else _listed(reply.arena, options))
    return 0


def send(
    options: argparse.Namespace, action: OperatorAction, coordinator: str
) -> OperatorReply:
    """Return the reply of a coordinator to an action in an arena.

    ``options``: flags of the network, ``run`` and ``island``.

    Raises:
        NetworkError: the coordinator does not answer.
    """
    request = OperatorRequest(uuid4().hex, options.island, action, options.run)
    return ask(options, request, coordinator)[coordinator]


def _listed(arena: ArenaListing, options: argparse.Namespace) -> str:
    if options.json:
        document = {
            "version": 1,
            "island": options.island,
            **msgspec.structs.asdict(arena),
        }
        return msgspec.json.format(msgspec.json.encode(document), indent=2).decode()
    state = "paused" if arena.is_paused else "running"
    about = f"{arena.births} of {arena.wanted} born, {len(arena.robots)} alive"
    names = [birth_name(one.birth, options.island) for one in arena.robots]
    width = max(map(len, ["birth", *names]))
    lines = [
        f"{state} at {arena.sim_time_s:g} s, {about}",
        f"{'birth':>{width}}  rank    age [s]  x, y [m]        fitness",
    ]
    for name, one in zip(names, arena.robots, strict=True):
        place = f"{one.place[0]:.2f}, {one.place[1]:.2f}"
        fitness = "immature" if one.fitness is None else f"{one.fitness:.4f}"
        start = f"{name:>{width}}  {one.rank:4}  {one.age_s:9.1f}"
        lines.append(f"{start}  {place:14}  {fitness}")
    return "\n".join(lines)


def coordinator_of(options: argparse.Namespace) -> tuple[str, str]:
    """Return the coordinator whose run ``--run`` selects, and a line about the run.

    ``options``: flags of the network, and ``run``.

    Raises:
        NetworkError: no coordinator answers, or not exactly one has such a run.
    """
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
        return name, f"arena of {chosen[0] if len(chosen) == 1 else name}"
    raise NetworkError(
        f"{options.connect}: exactly one coordinator must have a run "
        f"{options.run!r}, got {len(folders)} of {len(statuses)}; choose one by "
        f"--run: {cut(', '.join(map(_name, runs)))}"
    )


def _name(run: RunStatus) -> str:
    return Path(run.folder).name


def _action(options: argparse.Namespace) -> OperatorAction:
    if options.action in PLAIN:
        return PLAIN[options.action]
    if options.action == "insert":
        place = tuple(options.place) if options.place else None
        parents = tuple(_birth(each, options) for each in options.parents)
        return InsertRobot(_robot(options), place, parents)
    birth = _birth(options.birth, options)
    if options.action == "remove":
        return RemoveRobot(birth)
    return SetBrain(birth, _robot(options))


def _birth(named: tuple[int | None, int], options: argparse.Namespace) -> BirthId:
    island, birth_number = named
    return BirthId(options.island if island is None else island, birth_number)


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
                type=flagged_birth,
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
            action.add_argument(
                "--parents",
                type=flagged_birth,
                nargs=MOST_PARENTS,
                default=(),
                metavar="BIRTH",
                help="living robots that count as its parents (default: it has none)",
            )
        if name == "list":
            action.add_argument(
                "--json", action="store_true", help="print JSON, one document"
            )
        add_shared(action, "--connect")
        action.add_argument(
            "--run", default="", metavar="NAME",
            help="run whose folder is named NAME, else whose folder name ends with "
            "NAME (default: the only run)",
        )  # fmt: skip
        add_count(action, "--island", 0, "island number", least=0, most=MOST_NUMBER)
        add_shared(action, *NETWORK)
    return flags
