"""``revolve worker``: evaluate robots for a coordinator, local or remote."""

import sys

from schema.agent.supervisor import cores, prepare_process


def main(arguments: list[str]) -> int:
    """Serve until stopped.

    Args:
        arguments: the command's name first.

    Returns:
        0 after Ctrl-C or SIGTERM; 130 after a second Ctrl-C.
    """
    prepare_process()  # before anything imports numpy
    from schema.agent.command import run_pool
    from worker.serve.service import process

    return run_pool("worker", process, arguments[1:], processes=cores())


if __name__ == "__main__":
    sys.exit(main(["worker", *sys.argv[1:]]))
