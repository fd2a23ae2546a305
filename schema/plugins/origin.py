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

from schema.errors import ExperimentError, error_text

_CONSTANTS = (bool, int, float, complex, str, bytes, tuple, frozenset, type(None))


def where_defined(plugin: object) -> str:
    """Return the file and line of a plug-in's code, such as ``my_lab.py:12``.

    A wrapped or partial function counts as the function inside. An object that is
    neither function nor class is found by the assignment that names it in its module,
    or else by its class.

    Args:
        plugin: function, class or object.

    Returns:
        Name of the file and line of the definition; without a line if the source is
        not there; module and name if there is no file.
    """
    found = inspect.unwrap(plugin) if callable(plugin) else plugin
    while isinstance(found, partial):
        found = inspect.unwrap(found.func)
    if not (inspect.isclass(found) or inspect.isroutine(found)):
        if assigned := _where_assigned(found):
            return assigned
        found = type(found)
    try:
        file = Path(inspect.getsourcefile(found) or inspect.getfile(found)).name
    except TypeError:
        return f"{found.__module__}:{found.__qualname__}"
    try:
        return f"{file}:{inspect.getsourcelines(found)[1]}"
    except OSError:
        return file


def where_named(module: ModuleType, name: str) -> str:
    """Return file and line of a name in a plug-in's module.

    Args:
        module: that was imported.
        name: of one of its attributes, or one that is not there.

    Returns:
        As of ``where_defined``; without a line for a name that is not assigned at the
        top of the module.
    """
    value = getattr(module, name, None)
    if inspect.isclass(value) or inspect.isroutine(value):
        return where_defined(value)
    file = Path(str(module.__file__)).name
    line = _assignment(module, name)
    return f"{file}:{line}" if line else file


def where_raised(error: BaseException, file: str) -> str:
    """Return the line of a plug-in's file in which an error was raised; or empty.

    Args:
        error: with its traceback.
        file: name of the file, without its folder.
    """
    lines = [
        f"{file}:{frame.lineno}"
        for frame in extract_tb(error.__traceback__)
        if Path(frame.filename).name == file
    ]
    return lines[-1] if lines else ""


def raised_text(error: BaseException, where: str) -> str:
    """Return an error of a plug-in as one line, and where it was raised.

    Args:
        error: with its traceback.
        where: the plug-in is defined, as of ``where_defined``.
    """
    line = where_raised(error, where.partition(":")[0])
    return error_text(error) + (f" ({line})" if line else "")


@contextmanager
def naming_plugin(plugin: object, key: str) -> Iterator[None]:
    """Say where a plug-in is defined, what it raised, and where, if it raises.

    Args:
        plugin: function, class or object that is called.
        key: of the experiment, which names it.

    Raises:
        ExperimentError: for any error of its code, ``exit`` included.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        where = where_defined(plugin)
        story = raised_text(error, where)
        raise ExperimentError(f"{key}: {where}: raised {story}") from error


def _where_assigned(value: object) -> str:
    """Return file and line of the assignment of a module's object; or empty."""
    # Equal constants of different modules may be one object; a module is imported by
    # many, each of whose sources would be parsed.
    if isinstance(value, (*_CONSTANTS, ModuleType)):
        return ""
    for module in list(sys.modules.values()):
        # A snapshot: the import of another thread may change it.
        names = dict(getattr(module, "__dict__", {}))
        for name, each in names.items():
            if each is value and (line := _assignment(module, name)):
                return f"{Path(str(module.__file__)).name}:{line}"
    return ""


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
        if any(isinstance(each, ast.Name) and each.id == name for each in targets):
            return line.lineno
    return 0
