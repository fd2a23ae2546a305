"""Command line flags of the coordinator's commands."""

import argparse
import re

from coordinator.storage.campaign import shipped_campaigns
from schema.agent.address import FORMS, HUB
from schema.agent.command import LIMITS, NETWORK, add_shared, tls_files
from schema.agent.flags import (
    Flags,
    add_count,
    add_plugins,
    add_seed,
    positive_number,
    share,
)
from schema.experiment.file import shipped_experiments
from schema.experiment.identity import WHOLE, Group

_COMMANDS = {
    "run": (
        "Evolve experiments with coordinator, analyzer and workers on this machine.",
        (
            "revolve run scenario1 --seed 1 --births 600",
            "revolve run mine.toml --births 100 --out runs/first --workers 2",
            "revolve run scenario1 no-selection --repeats 5    # a campaign",
            "revolve run mine.toml --from runs/first --out runs/second",
        ),
    ),
    "coordinator": (
        "Run experiments on workers and analyzers that connect.",
        (
            "revolve coordinator scenario1 --seed 1    # then: revolve worker",
            "revolve coordinator thesis --repeats 30 --connect hub",
            "revolve coordinator mine.toml --listen tcp/127.0.0.1:7447",
            "revolve coordinator archipelago-ring --group 0/4 --connect hub",
        ),
    ),
    "resume": (
        "Resume a run or campaign that was stopped or killed, or make it longer.",
        (
            "revolve resume runs/scenario1-seed1",
            "revolve resume runs/scenario1-seed1 --births 1500",
            "revolve resume runs/thesis-seed1 --workers 2 --quiet",
        ),
    ),
    "compare": (
        "Compare two runs, or the runs of two campaigns, in all repeatable columns.",
        (
            "revolve compare runs/a runs/b",
            "revolve compare runs/before runs/after    # two campaigns",
        ),
    ),
}
"""Description and examples of each command."""


_KEPT = (
    *("--workers", "--listen", "--connect", "--fleet", "--access"),
    *("--tls-ca", "--tls-certificate", "--tls-key", "--speed", "--threads"),
    "--arena-workers",
    *("--cpu-limit", "--wait-limit", "--give-up-after", "--audit", "--on-quarantine"),
    *("--in-process", "--allow-drift", "--fsync", "--oversubscribe"),
)
"""Flags of agents, limits and checks, in the order in which they are advised."""
_ADDRESS = re.compile(r"(?:(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):)?([0-9]{1,5})")
_GROUP = re.compile(r"([0-9]{1,5})/([0-9]{1,5})")
_LAST_PORT = 65535
_LOOPBACK = "127.0.0.1"


def parser(command: str) -> Flags:
    """Return the parser of a command's arguments."""
    description, examples = _COMMANDS[command]
    flags = Flags(prog=f"revolve {command}", description=description, examples=examples)
    if command == "compare":
        flags.add_argument("first", metavar="FOLDER", help="run or campaign folder")
        flags.add_argument("second", metavar="FOLDER", help="run or campaign folder")
        return flags
    if command == "resume":
        flags.add_argument("folder", metavar="FOLDER", help="run or campaign folder")
        add_count(
            flags,
            "--births",
            None,
            "number of births; each run, finished or not, becomes equal to one "
            "begun with it (default: as begun)",
            most=10**9,
        )
    else:
        _add_experiments(flags)
    if command == "coordinator":
        _add_group(flags)
    elif command == "run":
        add_count(
            flags,
            "--coordinators",
            None,
            "number of coordinators, each with a group of the experiment's islands "
            "(default: one with all islands)",
        )
    flags.set_defaults(command=command)
    _add_deployment(flags, command)
    return flags


def resume_flags(options: argparse.Namespace) -> list[str]:
    """Return the flags with which ``revolve resume`` does what the command does.

    They are those of agents, limits and checks.
    """
    named = vars(options).items()
    values: dict[str, object] = {f"--{k.replace('_', '-')}": v for k, v in named}
    if not options.in_process:
        values |= tls_files(options)
    if options.command == "coordinator":
        # It starts no workers and has no flags for them.
        values["--threads"] = None
        if not options.connect:
            values["--listen"] = options.listen or HUB
    resume = parser("resume")
    words: list[str] = []
    for flag in _KEPT:
        value = values.get(flag)
        if value is True:
            words.append(flag)
        elif value not in (None, resume.get_default(flag[2:].replace("-", "_"))):
            is_real = isinstance(value, float)
            words += [flag, f"{value:.12g}" if is_real else str(value)]
    return words


def _group(text: str) -> Group:
    """Return the group of a flag's value."""
    match = _GROUP.fullmatch(text)
    if match is None or int(match[1]) >= int(match[2]):
        raise argparse.ArgumentTypeError(
            f"must be K/N in whole numbers with 0 <= K < N, got {text[:80]!r}"
        )
    return Group(number=int(match[1]), of=int(match[2]))


def _add_group(flags: argparse.ArgumentParser) -> None:
    flags.add_argument(
        "--group",
        type=_group,
        default=WHOLE,
        metavar="K/N",
        help="run only the islands i with i modulo N = K; the other groups' "
        "coordinators connect to the same hub (default: all islands)",
    )
    flags.add_argument(
        "--archipelago",
        metavar="NAME",
        help="name of the archipelago that the groups of islands form, for a second "
        "copy of it at the same hub (default: made of experiment, seed and N)",
    )


def _host_and_port(text: str) -> tuple[str, int]:
    """Return host and port of a flag's value; a port alone is of this machine."""
    match = _ADDRESS.fullmatch(text)
    if match is None or int(match[2]) > _LAST_PORT:
        raise argparse.ArgumentTypeError(
            f"must be PORT or HOST:PORT, got {text[:200]!r}"
        )
    return match[1] or _LOOPBACK, int(match[2])


def _add_experiments(flags: argparse.ArgumentParser) -> None:
    names = ", ".join([*shipped_experiments(), *shipped_campaigns()])
    flags.add_argument(
        "experiments",
        nargs="+",
        metavar="EXPERIMENT",
        help=f"a .toml file, or one of {names}; several make a campaign",
    )
    add_seed(flags, default=0)
    add_count(flags, "--repeats", None, "repeat each experiment N times, as a campaign")
    add_count(
        flags,
        "--first-repeat",
        None,
        "number of the campaign's first repeat, to add repeats or to divide them among "
        "machines (default: 0)",
        least=0,
    )
    add_count(flags, "--births", None, "number of births (default: the experiment's)")
    flags.add_argument(
        "--from",
        dest="founders",
        metavar="RUN",
        help="run folder whose last population are the founders; the document's "
        "[founders] may say which (default: random robots, or those of [founders])",
    )
    flags.add_argument(
        "--out",
        metavar="FOLDER",
        help="folder to write to, a run's or a campaign's (default: "
        "runs/NAME-seedSEED)",
    )


def _add_deployment(flags: argparse.ArgumentParser, command: str) -> None:
    """Add the flags of processes and network; none of them changes a birth."""
    if command == "coordinator":
        flags.set_defaults(workers=0, in_process=False, threads=1)
    else:
        add_count(
            flags,
            "--workers",
            None,
            "number of workers, started on this machine (default: one per core, none "
            "with --connect)",
            least=0,
        )
        add_shared(flags, "--oversubscribe")
        add_count(
            flags,
            "--threads",
            None,
            "number of threads that advance one arena together, in each worker "
            "(default: one per core for an arena, else 1)",
        )
        flags.add_argument(
            "--in-process",
            action="store_true",
            help="run everything in one process without network; slower, for debugging",
        )
    listen = "hub" if command == "coordinator" else "only a socket of its own"
    flags.add_argument(
        "--listen",
        metavar="ADDRESS",
        help=f"address to listen on, {FORMS} (default: {listen})",
    )
    flags.add_argument(
        "--connect",
        metavar="ADDRESS",
        help=f"address of the hub, {FORMS}, or the folder of an active run; the "
        "workers of that hub are shared (default: start a hub)",
    )
    add_shared(flags, "--access", *NETWORK)
    flags.add_argument(
        "--speed",
        type=positive_number,
        metavar="X",
        help="limit arenas to X simulated seconds per second; refused if there is no "
        "arena (default: no limit)",
    )
    add_count(
        flags,
        "--arena-workers",
        None,
        "number of workers that advance one arena together, as far as there are; "
        "results do not depend on it (default: as many as pay)",
    )
    flags.add_argument(
        "--view", action="store_true", help="open a viewer, as revolve view does"
    )
    add_shared(flags, *LIMITS)
    add_plugins(flags)
    add_shared(flags, "--give-up-after")
    flags.add_argument(
        "--audit",
        type=share,
        default=0.0,
        metavar="SHARE",
        help="repeat this share of evaluations, from 0 to 1, on a second worker; stop "
        "the run if the results differ (default: 0)",
    )
    flags.add_argument(
        "--on-quarantine",
        choices=("go-on", "pause"),
        default="go-on",
        help="whether to continue or stop the run when an evaluation has crashed its "
        "worker process three times; it then counts as failed (default: go-on)",
    )
    flags.add_argument(
        "--allow-drift",
        action="store_true",
        help="let an arena continue on a worker of another platform if no worker of "
        "the same platform has been connected for 30 s; this is recorded and changes "
        "the results",
    )
    flags.add_argument("--quiet", action="store_true", help="show no progress")
    add_shared(flags, "--log-json")
    flags.add_argument(
        "--metrics",
        type=_host_and_port,
        metavar="ADDRESS",
        help="serve metrics for Prometheus at PORT of this machine, or at HOST:PORT, "
        "where every host that reaches it can read them (default: no metrics)",
    )
    flags.add_argument(
        "--fsync", action="store_true", help="survive power loss, too; slower"
    )
