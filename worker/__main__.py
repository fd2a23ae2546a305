"""``revolve worker`` and ``revolve bench``: serve jobs, and benchmark this machine."""

from schema.agent.flags import Flags
from schema.agent.supervisor import cores


def main(arguments: list[str]) -> int:
    """Run one of the worker's commands and return its exit code.

    Returns:
        ``worker``: 0 after Ctrl-C or SIGTERM, 130 after a second Ctrl-C; ``bench``: 0
        if the measurement meets its requirement, 1 if not.
    """
    if arguments[0] == "bench":
        return _bench(arguments)
    from schema.agent.command import run_pool
    from worker.serve.service import process

    return run_pool("worker", process, arguments[1:], processes=cores())


def parser(command: str) -> Flags:
    """Return the parser of ``worker`` or ``bench``."""
    if command == "bench":
        from worker.bench.command import parser as bench

        return bench()
    from schema.agent.command import parser as agent

    return agent("worker", cores())


def _bench(arguments: list[str]) -> int:
    """Benchmark with robots from the other rooms' generator and analyzer."""
    from analyzer.report import analyze
    from coordinator.evolution.generation import generate
    from worker.bench.arena_bench import RobotSource
    from worker.bench.command import main as bench

    return bench(arguments, RobotSource(generate, analyze))
