"""What may be said on the command line of the coordinator's commands."""

import argparse

from coordinator.storage.campaign import shipped_campaigns
from schema.agent.command import add_cpu_limit, add_network_flags
from schema.experiment.file import shipped_experiments
from schema.flags import Flags, positive_number, share, whole_number

LISTEN = "tcp/127.0.0.1:7447"
"""Where ``revolve coordinator`` listens unless it is told."""

_EXAMPLES = {
    "run": "revolve run scenario1 --seed 1 --births 600",
    "coordinator": "revolve coordinator scenario1 --listen tcp/127.0.0.1:7447",
    "resume": "revolve resume runs/scenario1-seed1",
    "compare": "revolve compare runs/a runs/b",
    "bench dispatch": "revolve bench dispatch",
}

_DESCRIPTIONS = {
    "run": "Evolve experiments with coordinator, analyzer and workers of its own.",
    "coordinator": "Run experiments for workers and analyzers that connect.",
    "resume": "Go on with a run or campaign that was stopped or killed.",
    "compare": "Tell whether two runs are equal, row by row, where they should be.",
    "bench dispatch": "Measure what jobs cost a coordinator; simulate large fleets.",
}


def parser(command: str) -> argparse.ArgumentParser:
    """Return what understands the words after a command."""
    flags = Flags(
        prog=f"revolve {command}",
        description=_DESCRIPTIONS[command],
        epilog=f"for example: {_EXAMPLES[command]}",
        allow_abbrev=False,
    )
    if command == "compare":
        flags.add_argument("first", help="run folder")
        flags.add_argument("second", help="run folder")
        return flags
    if command == "bench dispatch":
        _add_bench(flags)
        return flags
    if command == "resume":
        flags.add_argument("folder", help="folder of the run or campaign")
    else:
        _add_science(flags)
    flags.set_defaults(command=command)
    _add_deployment(flags, command)
    return flags


def _add_bench(flags: argparse.ArgumentParser) -> None:
    flags.add_argument(
        "--seconds",
        type=positive_number,
        default=5.0,
        metavar="S",
        help="of each measurement through the network (default: 5)",
    )
    flags.add_argument(
        "--workers",
        type=whole_number(),
        default=8,
        help="that take 40 ms, and no processor time, for an evaluation (default: 8)",
    )
    flags.add_argument(
        "--births",
        type=whole_number(),
        default=1500,
        help="without physics (default: 1500)",
    )


def _add_science(flags: argparse.ArgumentParser) -> None:
    """Add what decides which births there are."""
    names = ", ".join([*shipped_experiments(), *shipped_campaigns()])
    flags.add_argument(
        "experiments",
        nargs="+",
        metavar="experiment",
        help=f"a .toml file, or one of {names}; several are a campaign",
    )
    flags.add_argument("--seed", type=_seed, default=0, help="default: 0")
    flags.add_argument(
        "--repeats",
        type=whole_number(),
        metavar="N",
        help="do each experiment so often, all in one campaign",
    )
    flags.add_argument(
        "--births", type=whole_number(), help="instead of each experiment's number"
    )
    flags.add_argument(
        "--out",
        metavar="FOLDER",
        help="of the run or campaign; default: runs/NAME-seedSEED",
    )


def _add_deployment(flags: argparse.ArgumentParser, command: str) -> None:
    """Add where and by whom, which decides about no birth."""
    if command == "coordinator":
        flags.set_defaults(workers=0, in_process=False, threads=1)
    else:
        flags.add_argument(
            "--workers",
            type=whole_number(0),
            help="worker processes to start here; default: one per core, none with "
            "--connect",
        )
        flags.add_argument(
            "--threads",
            type=whole_number(),
            help="threads of each worker that advance one arena together; default: "
            "one per core for an arena, else 1",
        )
        flags.add_argument(
            "--in-process",
            action="store_true",
            help="no network and no other process: slower, for debugging",
        )
    flags.add_argument(
        "--listen",
        metavar="ADDRESS",
        help="where others may connect; default: "
        + (LISTEN if command == "coordinator" else "a free port of this machine"),
    )
    flags.add_argument(
        "--connect",
        metavar="ADDRESS",
        help="share the workers of a hub that is there already: of another "
        "coordinator, or of a Zenoh router",
    )
    add_network_flags(flags)
    flags.add_argument(
        "--speed",
        type=positive_number,
        metavar="X",
        help="for watching an arena: at most X simulated seconds per second",
    )
    flags.add_argument(
        "--view", action="store_true", help="open a viewer's window, see revolve view"
    )
    add_cpu_limit(flags)
    flags.add_argument(
        "--audit",
        type=share,
        default=0.0,
        metavar="SHARE",
        help="have this share of evaluations, from 0 to 1, done by two workers; the "
        "run stops if they do not agree (default: 0)",
    )
    flags.add_argument(
        "--on-quarantine",
        choices=("go-on", "pause"),
        default="go-on",
        help="what a run does when a robot's evaluation has ended its own process "
        "three times: it counts as failed either way (default: go-on)",
    )
    flags.add_argument(
        "--allow-drift",
        action="store_true",
        help="let an arena go on by a worker of another platform, after half a minute "
        "without one of its own; this is recorded and makes it another run",
    )
    flags.add_argument("--quiet", action="store_true", help="show no progress")
    flags.add_argument(
        "--fsync", action="store_true", help="survive power loss too; slower"
    )


def _seed(text: str) -> int:
    """Return a seed that messages and tables have room for."""
    value = whole_number(0)(text)
    if value >> 64:
        raise argparse.ArgumentTypeError(f"must be < 2^64, got {text!r}")
    return value
