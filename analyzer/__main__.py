"""``revolve analyzer``: breed and vet robots for a coordinator."""

from schema.agent.flags import Flags


def main(arguments: list[str]) -> int:
    """Serve until stopped.

    Returns:
        0 after Ctrl-C or SIGTERM; 130 after a second Ctrl-C.
    """
    from functools import partial

    from analyzer.report import analyze
    from analyzer.service import process
    from coordinator.evolution.newborns import breed
    from schema.agent.command import run_pool

    body = partial(process, partial(breed, vet=analyze))
    return run_pool("analyzer", body, arguments[1:], processes=1)


def parser(_command: str) -> Flags:
    """Return the parser of ``revolve analyzer``."""
    from schema.agent.command import parser as agent

    return agent("analyzer", 1)
