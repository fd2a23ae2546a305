"""The command ``revolve``: dispatches to the commands of all rooms."""

import codecs
import errno
import io
import os
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from types import ModuleType

from revolve.cli.commands import COMMANDS, actions
from revolve.strangers import stranger

_TOLD = {
    errno.EMFILE: "too many open files: raise the limit (ulimit -n)",
    errno.ENAMETOOLONG: "{}: the name is longer than the system allows",
}
"""Messages for errors of the operating system, by error number; {} is the file."""
_UNDECODED = (
    "a name of a file or folder must be text in this locale's encoding, "
    f"{sys.getfilesystemencoding()}: rename it, or set PYTHONUTF8=1"
)


def main(
    arguments: list[str] | None = None, tell: Callable[[Exception], None] | None = None
) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: without the program's name; default: those of the process.
        tell: called with a user's error; default: writes it to standard error.

    Returns:
        The command's exit code; 1 if the reader closed standard output, 2 for a
        user's error or output that cannot be written (one line on stderr), 130 after
        a stop signal.
    """
    # Without standard output the next file to be opened would get its descriptor.
    problem = "standard output is closed" if sys.stdout is None else stranger()
    if problem:
        print(f"revolve: {problem}", file=sys.stderr)
        return 2
    stopping = None
    if arguments is None:
        _accept_all_text()
        _separate_engine_log()
        stopping = import_module("schema.agent.stopping")
        stopping.prepare_stop(sys.argv[1:])
    try:
        try:
            words = sys.argv[1:] if arguments is None else arguments
            return _run(words, tell or _tell)
        finally:
            _flush()
    except OSError:
        output_error = _output_error()
        if output_error is None:
            raise
        if isinstance(output_error, BrokenPipeError):
            return 1
        why = str(output_error.strerror)
        print(f"revolve: standard output: {why[:1].lower()}{why[1:]}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except ImportError as error:
        if not _is_interrupted(error):
            raise
        return 130
    finally:
        if stopping is not None:
            # The process ends now: another Ctrl-C must not print a traceback.
            stopping.finish_stop()


def _tell(error: Exception) -> None:
    message = import_module("schema.errors").one_line(error)
    import_module("schema.agent.log").tell_error(f"revolve: {message}")


def _run(words: list[str], tell: Callable[[Exception], None]) -> int:
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    if not words or words[0] in ("-h", "--help"):
        print(_overview())
        return 0
    if words[0] == "--version":
        print(import_module("revolve.cli.version").version_text())
        return 0
    name = " ".join(words[:2])
    if name in COMMANDS:
        words = [name, *words[2:]]
    if words[0] not in COMMANDS:
        allowed = ["help", *COMMANDS]
        near = import_module("schema.errors").nearest(words[0], allowed)
        print(
            f"revolve: no command {words[0]!r}{near}; allowed: {', '.join(allowed)}",
            file=sys.stderr,
        )
        return 2
    _show_start(words)
    return _run_command(words, tell)


def _run_command(words: list[str], tell: Callable[[Exception], None]) -> int:
    # Before NumPy is first imported: a robot's arithmetic must not depend on cores.
    import_module("schema.agent.supervisor").prepare_process()
    error_type = import_module("schema.errors").RevolveError
    try:
        room = import_module(COMMANDS[words[0]][0])
        if line := _unknown_action(words, room):
            print(line, file=sys.stderr)
            return 2
        return int(room.main(words))
    except error_type as error:
        tell(error)
        return 2
    except OSError as error:
        if error.errno not in _TOLD:
            raise
        file = import_module("schema.errors").cut(str(error.filename))
        tell(error_type(_TOLD[error.errno].format(file)))
        return 2
    except UnicodeEncodeError as error:
        if "surrogates" not in error.reason:
            raise
        tell(error_type(f"{error.object}: {_UNDECODED}"))
        return 2
    finally:
        if words[1:] in (["-h"], ["--help"]):
            print(_also(words[0]), end="")


def _show_start(words: list[str]) -> None:
    """Show on a terminal that a run starts: its imports alone take half a second.

    The next line that is written to the terminal replaces this one.
    """
    is_shown = words[0] in ("run", "resume") and "--quiet" not in words
    if is_shown and sys.stderr is not None and sys.stderr.isatty():
        print("starting ...", end="\r", file=sys.stderr, flush=True)


def _unknown_action(words: list[str], room: ModuleType) -> str:
    """Return a line about an unknown second word; empty if it is known.

    A parser does not know the commands of two words, which other modules have.
    """
    others = [name.split()[1] for name in COMMANDS if name.startswith(f"{words[0]} ")]
    if not others or words[1:2] == [] or words[1].startswith("-"):
        return ""
    allowed = [*actions(room.parser(words[0])), *others]
    if words[1] in allowed:
        return ""
    near = import_module("schema.errors").nearest(words[1], allowed)
    what = f"no action {words[1]!r}{near}; allowed: {', '.join(allowed)}"
    return f"revolve {words[0]}: {what} (see revolve {words[0]} --help)"


def _is_interrupted(error: BaseException | None) -> bool:
    """Return whether Ctrl-C caused an import to fail."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _accept_all_text() -> None:
    """Let standard output take any text; ``?`` is what its encoding does not have.

    Names of files that are not text in that encoding are written byte by byte.
    """

    def replaced(error: UnicodeError) -> tuple[bytes, int]:
        if not isinstance(error, UnicodeEncodeError):
            raise error
        text = error.object[error.start : error.end]
        escaped = "".join(c if "\udc80" <= c <= "\udcff" else "?" for c in text)
        return escaped.encode("ascii", "surrogateescape"), error.end

    is_default = sys.stdout.errors in ("strict", "surrogateescape")
    if is_default and isinstance(sys.stdout, io.TextIOWrapper):
        codecs.register_error("revolve", replaced)
        sys.stdout.reconfigure(errors="revolve")


def _separate_engine_log() -> None:
    """Lead what Zenoh writes to descriptor 1 to standard error.

    Standard output gets a descriptor of its own, so that it holds the command's results
    only. Zenoh has no other setting for the destination of its log.
    """
    if sys.stderr is None:
        return
    try:
        standard_output, standard_error = sys.stdout.fileno(), sys.stderr.fileno()
    except OSError:
        return  # replaced by an object without a descriptor
    sys.stdout.flush()
    own = _Output(os.dup(standard_output), "w")
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(own),
        encoding=sys.stdout.encoding,
        errors=sys.stdout.errors,
        line_buffering=bool(sys.stdout.line_buffering),
    )
    os.dup2(standard_error, standard_output)


class _Output(io.FileIO):
    """Standard output that remembers why it could not be written.

    A failed write of more than the buffer holds is not repeated at the next flush.
    """

    error: OSError | None = None

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        """Write bytes, and remember the error if that fails."""
        try:
            return super().write(data)
        except OSError as error:
            self.error = error
            raise


def _flush() -> None:
    """Flush standard output; raise earlier errors, which argparse ignores, too."""
    sys.stdout.flush()
    if (error := _first_write_error()) is not None:
        raise error


def _first_write_error() -> OSError | None:
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw.error if isinstance(raw, _Output) else None


def _output_error() -> OSError | None:
    """Return why standard output cannot be written, or None if it can."""
    error = _first_write_error()
    try:
        sys.stdout.flush()
    except OSError as newest:
        error = newest
    if error is not None:
        # The interpreter flushes once more at exit, and must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return error


def _also(command: str) -> str:
    """Return help lines of the two-word commands that start with this one."""
    names = [name for name in COMMANDS if name.startswith(f"{command} ")]
    return f"\nalso:\n{_lines(names)}\n" if names else ""


def _lines(names: Iterable[str]) -> str:
    width = max(map(len, COMMANDS))
    return "\n".join(f"  {name:{width}}  {COMMANDS[name][1]}" for name in names)


def _overview() -> str:
    return (
        "Evolve the bodies and brains of robots, on one machine or on many.\n\n"
        "usage: revolve COMMAND ...    (help: revolve help COMMAND)\n"
        "       revolve --version\n\n"
        f"{_lines(COMMANDS)}\n\n"
        "examples:\n"
        "  revolve run scenario1 --seed 1 --births 600\n"
        "  revolve view runs/scenario1-seed1 --robot best\n"
        "  revolve analyze runs/scenario1-seed1"
    )
