"""Where plug-ins are defined, and where they raise, for messages."""

import ast
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

from schema.errors import (
    ExperimentError,
    InvalidRobot,
    RevolveError,
    error_text,
    one_line,
)


def where_defined(plugin: object) -> str:
    """Return the file and line of a plug-in's code, such as ``my_lab.py:12``.

    A wrapped or partial function counts as the function inside, an object that is
    neither function nor class as its class.

    Without its source there is no line; without a file, module and name.
    """
    code = _code(plugin)
    if not _is_code(code):
        code = type(code)
    try:
        file = Path(inspect.getsourcefile(code) or inspect.getfile(code)).name
    except TypeError:
        return f"{code.__module__}:{code.__qualname__}"
    try:
        return f"{file}:{inspect.getsourcelines(code)[1]}"
    except OSError:
        return file


def where_named(module: ModuleType, name: str) -> str:
    """Return file and line of a name in a plug-in's module.

    There is no line of a name that is not assigned at the top of the module.
    """
    value = _code(getattr(module, name, None))
    if _is_code(value):
        return where_defined(value)
    file = Path(str(module.__file__)).name
    line = _assignment(module, name)
    return f"{file}:{line}" if line else file


def where_raised(error: BaseException, file: str) -> str:
    """Return the line of a plug-in's file in which an error was raised; or empty."""
    lines = [
        f"{file}:{frame.lineno}"
        for frame in extract_tb(error.__traceback__)
        if Path(frame.filename).name == file
    ]
    return lines[-1] if lines else ""


@contextmanager
def naming_plugin(key: str, plugin: object, path: str = "") -> Iterator[None]:
    """Say in one line which plug-in raised, where it is defined, and where it raised.

    An ``InvalidRobot`` is what an attempt at a birth comes to, and passes.

    ``path`` is the ``module:attribute`` of a plug-in that is neither function nor
    class.

    Raises:
        ExperimentError: for any error of its code, ``exit`` included.
    """
    try:
        yield
    except InvalidRobot:
        raise
    except (Exception, SystemExit) as error:
        module, _, name = path.partition(":")
        known = sys.modules.get(module)
        where = where_named(known, name) if known and name else where_defined(plugin)
        raise ExperimentError(_story(error, key, where)) from error


def _story(error: BaseException, key: str, where: str) -> str:
    """Return an error as one line with key, file and line, each of them once."""
    file = where.partition(":")[0]
    story = f"raised {error_text(error)}"
    if isinstance(error, RevolveError):
        story = one_line(error).removeprefix(f"{key}: ")
    if story.startswith(f"{key.partition('.')[0]}."):
        # Of another key, such as the plug-in's parameters: not in its file.
        return story
    if line := where_raised(error, file):
        story += f" ({line})"
    elif f"{file}:" in story:
        return f"{key}: {story}"
    return f"{key}: {where}: {story}"


def _code(plugin: object) -> Any:  # noqa: ANN401 - of any type
    """Return the function inside wrappers, or what is no function."""
    code = inspect.unwrap(plugin) if callable(plugin) else plugin
    while isinstance(code, partial):
        code = inspect.unwrap(code.func)
    return code


def _is_code(value: object) -> bool:
    return inspect.isclass(value) or inspect.isroutine(value)


def _assignment(module: ModuleType, name: str) -> int:
    """Return the line of an assignment at the top of a module; 0 if there is none."""
    try:
        tree = ast.parse(inspect.getsource(module))
    except (OSError, TypeError, SyntaxError):
        return 0
    for line in tree.body:
        targets: list[ast.expr] = []
        if isinstance(line, ast.Assign):
            targets = line.targets
        elif isinstance(line, ast.AnnAssign):
            targets = [line.target]
        nodes = (node for target in targets for node in ast.walk(target))
        if any(isinstance(node, ast.Name) and node.id == name for node in nodes):
            return line.lineno
    return 0
