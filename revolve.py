"""The command ``revolve``: names the rooms' commands, nothing else."""

import io
import os
import signal
import sys
from collections.abc import Iterable
from importlib import import_module

_COORDINATOR = "coordinator.__main__"
COMMANDS = {
    "run": (_COORDINATOR, "evolve experiments on this machine"),
    "resume": (_COORDINATOR, "go on with a run or campaign after any crash"),
    "coordinator": (_COORDINATOR, "run experiments for remote workers"),
    "status": ("coordinator.cli.status", "tell how far runs are"),
    "arena": ("coordinator.cli.arena", "give orders to a running arena"),
    "compare": (_COORDINATOR, "tell whether two runs are equal"),
    "worker": ("worker.__main__", "simulate robots for a coordinator"),
    "analyzer": ("analyzer.__main__", "vet bodies for a coordinator"),
    "robot": ("schema.__main__", "check, convert or show a robot file"),
    "robot random": ("coordinator.cli.robot", "make up a robot"),
    "robot render": ("analysis.__main__", "draw the robot of a file"),
    "robot simulate": ("worker.robot_command", "judge the robot of a file"),
    "view": ("analysis.__main__", "watch a run, live or again"),
    "analyze": ("analysis.__main__", "tables to measures, figures and a report"),
    "bench": ("worker.bench.command", "measure this machine"),
    "bench dispatch": (_COORDINATOR, "measure how far a coordinator reaches"),
}
"""Module whose ``main`` takes the words, the command first; and what it does.

A command of two words goes before the command of the first one, which is another
room's; its module is told both in one.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: without the program's name; those of the process by default.

    Returns:
        0 if done, 1 if nobody reads on, 2 for a user's error and for output that
        cannot be written (one line on stderr), 130 after Ctrl-C.
    """
    if sys.stdout is None:
        # A file of the command would take its place, and be written into.
        print("revolve: standard output is closed", file=sys.stderr)
        return 2
    _keep_what_fails()
    try:
        try:
            return _obey(sys.argv[1:] if arguments is None else arguments)
        finally:
            sys.stdout.flush()
    except OSError:
        trouble = _trouble_of_output()
        if trouble is None:
            raise
        if isinstance(trouble, BrokenPipeError):
            return 1
        why = str(trouble.strerror)
        print(f"revolve: standard output: {why[:1].lower()}{why[1:]}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except ImportError as error:
        if not _is_interrupted(error):
            raise
        return 130
    finally:
        if arguments is None:
            # This process ends: whoever presses again shall not see how.
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _obey(words: list[str]) -> int:
    """Run the command that words begin with and return its exit code."""
    if not words or words[0] in ("-h", "--help"):
        print(_overview())
        return 0
    name = " ".join(words[:2])
    if name in COMMANDS:
        words = [name, *words[2:]]
    if words[0] not in COMMANDS:
        near = import_module("schema.experiment.file").nearest(words[0], COMMANDS)
        print(
            f"revolve: no command {words[0]!r}{near}; allowed: {', '.join(COMMANDS)}",
            file=sys.stderr,
        )
        return 2
    # Before NumPy is first imported: a robot's arithmetic must not depend on cores.
    import_module("schema.agent.supervisor").prepare_process()
    error_type = import_module("schema.errors").RevolveError
    try:
        room = import_module(COMMANDS[words[0]][0])
        return int(room.main(words))
    except error_type as error:
        print(f"revolve: {error}", file=sys.stderr)
        return 2
    finally:
        if words[1:] in (["-h"], ["--help"]):
            print(_also(words[0]), end="")


def _is_interrupted(error: BaseException | None) -> bool:
    """Return whether a Ctrl-C is what an engine could not be loaded for."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _keep_what_fails() -> None:
    """Give standard output a buffer: what could not be written is found in it."""
    if isinstance(getattr(sys.stdout, "buffer", None), io.RawIOBase):
        sys.stdout = open(  # noqa: SIM115 - as long as the process
            sys.stdout.fileno(),
            "w",
            buffering=1,
            encoding=sys.stdout.encoding,
            errors=sys.stdout.errors,
            closefd=False,
        )


def _trouble_of_output() -> OSError | None:
    """Return why standard output cannot be written, or None if it can."""
    try:
        sys.stdout.flush()
    except OSError as error:
        # Or the interpreter would complain of it once more when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return error
    return None


def _also(command: str) -> str:
    """Return the lines on commands of two words that begin with this one."""
    names = [name for name in COMMANDS if name.startswith(f"{command} ")]
    return f"\nalso:\n{_lines(names)}\n" if names else ""


def _lines(names: Iterable[str]) -> str:
    width = max(map(len, COMMANDS))
    return "\n".join(f"  {name:{width}}  {COMMANDS[name][1]}" for name in names)


def _overview() -> str:
    return "\n".join(
        [
            "Evolve robots, bodies and brains, on one machine or on many.",
            "",
            "usage: revolve COMMAND ...    (revolve COMMAND --help explains one)",
            "",
            _lines(COMMANDS),
            "",
            "for example: revolve run scenario1 --seed 1 --births 600",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
