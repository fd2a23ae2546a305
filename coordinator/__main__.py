"""Commands of the coordinator: ``run``, ``coordinator``, ``resume``, ``compare``."""

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from coordinator.compare import compare
from coordinator.events import AgentKind
from coordinator.folder import read_details
from coordinator.running import Deployment, resume, start
from schema.agent_command import Flags, add_network_flags, tls_of
from schema.crew import cores
from schema.errors import RunFolderError
from schema.experiment import Experiment
from schema.experiment_check import check_experiment
from schema.experiment_file import (
    experiment_from_text,
    read_experiment,
    shipped_experiments,
)
from schema.settings import fitness_function

_EXAMPLES = {
    "run": "revolve run scenario1 --seed 1 --births 600",
    "coordinator": "revolve coordinator scenario1 --listen tcp/127.0.0.1:7447",
    "resume": "revolve resume runs/scenario1-seed1",
    "compare": "revolve compare runs/a runs/b",
}


def main(arguments: list[str]) -> int:
    """Run one of the coordinator's commands.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done; 1 if ``compare`` found a difference; 130 after Ctrl-C.
    """
    command, words = arguments[0], arguments[1:]
    options = _parser(command).parse_args(words)
    if command == "compare":
        return _compare(options)
    if command == "resume":
        folder = Path(options.folder)
        document = read_details(folder).document
        experiment = experiment_from_text(document)
        return resume(folder, _deployment(options, experiment))
    experiment = read_experiment(options.experiment)
    if options.births is not None:
        experiment = replace(experiment, births=options.births)
        check_experiment(experiment, "--births")
    fitness_function(experiment.fitness)
    default = Path("runs") / f"{experiment.name}-seed{options.seed}"
    folder = Path(options.out) if options.out else default
    return start(folder, experiment, options.seed, _deployment(options, experiment))


def _deployment(options: argparse.Namespace, experiment: Experiment) -> Deployment:
    """Return who does the work; the one place that names the other rooms."""
    import analyzer.jobs
    import analyzer.service
    import worker.jobs
    import worker.service

    # One arena is one process's; single robots spread over processes.
    threads = options.threads or (cores() if experiment.arena else 1)
    answers: dict[AgentKind, Callable[[bytes], bytes]] = {
        "analyzer": analyzer.jobs.answer,
        "worker": worker.jobs.Jobs(threads=threads).answer,
    }
    return Deployment(
        workers=options.workers,
        bodies={
            "analyzer": analyzer.service.process,
            "worker": worker.service.process,
        },
        answers=answers if options.in_process else None,
        listen=options.listen,
        fleet=options.fleet,
        tls=tls_of(options),
        quiet=options.quiet,
        fsync=options.fsync,
        threads=threads,
        speed=options.speed,
    )


def _parser(command: str) -> argparse.ArgumentParser:
    parser = Flags(
        prog=f"revolve {command}",
        description=_DESCRIPTIONS[command],
        epilog=f"for example: {_EXAMPLES[command]}",
        allow_abbrev=False,
    )
    if command == "compare":
        parser.add_argument("first", help="run folder")
        parser.add_argument("second", help="run folder")
        return parser
    if command == "resume":
        parser.add_argument("folder", help="folder of the run")
    else:
        names = ", ".join(shipped_experiments())
        parser.add_argument("experiment", help=f"a .toml file, or one of {names}")
        parser.add_argument("--seed", type=_whole, default=0, help="default: 0")
        parser.add_argument(
            "--births", type=_count, help="instead of the experiment's number"
        )
        parser.add_argument(
            "--out", help="run folder; default: runs/EXPERIMENT-seedSEED"
        )
    if command == "coordinator":
        parser.set_defaults(workers=0, in_process=False, threads=1)
    else:
        parser.add_argument(
            "--workers",
            type=_whole,
            default=cores(),
            help="worker processes to start here; default: one per core",
        )
        parser.add_argument(
            "--threads",
            type=_count,
            help="threads of each worker that advance one arena together; default: "
            "one per core for an arena, else 1",
        )
        parser.add_argument(
            "--in-process",
            action="store_true",
            help="no network and no other process: slower, for debugging",
        )
    parser.add_argument(
        "--listen",
        default="tcp/127.0.0.1:7447" if command == "coordinator" else None,
        metavar="ADDRESS",
        help="where others may connect, as tcp/127.0.0.1:7447",
    )
    add_network_flags(parser)
    parser.add_argument(
        "--speed",
        type=_speed,
        metavar="X",
        help="for watching an arena: at most X simulated seconds per second",
    )
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    parser.add_argument(
        "--fsync", action="store_true", help="survive power loss too; slower"
    )
    return parser


_DESCRIPTIONS = {
    "run": "Evolve an experiment with coordinator, analyzer and workers of its own.",
    "coordinator": "Run an experiment for workers and analyzers that connect.",
    "resume": "Go on with a run that was stopped or killed; nothing is lost.",
    "compare": "Tell whether two runs are equal, row by row, where they should be.",
}


def _whole(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"must be >= 0, got {value}")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be >= 1, got {value}")
    return value


def _speed(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"must be > 0 and finite, got {value}")
    return value


def _compare(options: argparse.Namespace) -> int:
    for folder in (options.first, options.second):
        if not Path(folder).is_dir():
            raise RunFolderError(f"{folder}: no such run folder")
    differences = compare(Path(options.first), Path(options.second))
    for line in differences:
        print(line)
    if not differences:
        print("equal in every column marked repeatable")
    return 1 if differences else 0


if __name__ == "__main__":
    from revolve import main as revolve

    sys.exit(revolve())
