"""What an experiment's own measures say of themselves: meaning and unit."""

import ast
import json
import re

import pyarrow as pa

from analysis.measures.load import Run
from schema.experiment.bounded import read_bytes
from schema.limits import MOST_PLUGIN_BYTES, printable
from schema.plugins.kept import PLUGINS

_UNIT = re.compile(r"\[([^][]+)\]\W*$")
_UNITS = {
    "path_velocity": "m/s",
    "straight_velocity": "m/s",
    "turning": "rad/s",
    "energy": "J",
    "cost_of_transport": "1",
    "height": "m",
    "body_symmetry": "1",
    "joint_effort": "N m",
    "contact_share": "1",
}
"""Units of the measures that come with the toolkit, as in their docstrings."""


def with_meanings(named: pa.Table, run: Run) -> pa.Table:
    """Return rows of ``named_measures`` with the columns ``unit`` and ``about``.

    Args:
        named: the rows.
        run: whose folder has the sources of its plug-ins; none is imported.
    """
    paths = json.loads(run.document).get("measures", {}).get("names", ())
    own = {path.rpartition(":")[2]: _first_line(run, path) for path in paths}
    names = named["measure"].to_pylist()
    about = [own.get(name, "") for name in names]
    units = [_UNITS.get(name) or _unit(own.get(name, "")) for name in names]
    for column, values in (("unit", units), ("about", about)):
        named = named.append_column(column, pa.array(values, pa.string()))
    return named


def _unit(line: str) -> str:
    found = _UNIT.search(line)
    return found[1] if found else ""


def _first_line(run: Run, path: str) -> str:
    """Return the first line of the docstring of a function; empty if not known."""
    module, _, name = path.rpartition(":")
    file = run.folder.joinpath(PLUGINS, *module.split(".")).with_suffix(".py")
    try:
        tree = ast.parse(read_bytes(file, MOST_PLUGIN_BYTES))
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return ""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return printable((ast.get_docstring(node) or "").partition("\n")[0], 300)
    return ""
