"""``revolve analyzer``: vet bodies for a coordinator."""

from schema.agent.flags import Flags


def main(arguments: list[str]) -> int:
    """Serve until stopped.

    Returns:
        0 after Ctrl-C or SIGTERM; 130 after a second Ctrl-C.
    """
    from analyzer.service import process
    from schema.agent.command import run_pool

    return run_pool("analyzer", process, arguments[1:], processes=1)


def parser(_command: str) -> Flags:
    """Return the parser of ``revolve analyzer``."""
    from schema.agent.command import parser as agent

    return agent("analyzer", 1)
