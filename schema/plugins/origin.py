"""Where plug-ins are defined, for messages."""

import ast
import inspect
import sys
from functools import partial
from pathlib import Path
from types import ModuleType


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


def _where_assigned(value: object) -> str:
    """Return file and line of the assignment of a module's object; or empty."""
    for module in list(sys.modules.values()):
        # A snapshot: the import of another thread may change it.
        names = dict(vars(module)) if isinstance(module, ModuleType) else {}
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
