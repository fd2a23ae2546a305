"""Commands ``revolve check`` and ``revolve plugins``; what an evaluation takes."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.metadata import entry_points
from pkgutil import iter_modules
from typing import NamedTuple

from coordinator.plugins.checks import BIRTHS, FROM, HERE, check_apart, check_here
from schema.agent.flags import Flags, add_plugins, positive_number
from schema.errors import RevolveError, one_line, rounded
from schema.experiment.document import Experiment, steps_of
from schema.experiment.file import read_draft
from schema.experiment.kinds import Kind, offered
from schema.plugins.load import load_module, place_of
from schema.plugins.origin import where_named
from schema.plugins.permission import GROUP, allow, allowed
from schema.plugins.source import digest_of

BUILT_IN = "built-in"


class Listed(NamedTuple):
    """A plug-in of the list.

    Attributes:
        kind: of plug-in; empty for a module that cannot be loaded.
        name: as experiments give it.
        defined: file and line, or why the module cannot be loaded.
        digest: of the module's source; "built-in" for one that ships.
    """

    kind: str
    name: str
    defined: str
    digest: str


def check(
    arguments: list[str],
    kinds: Sequence[Kind],
    read_founders: Callable[[Sequence[Experiment]], object],
) -> int:
    """Run ``revolve check``; return 0 if all plug-ins are in order, else 1.

    ``read_founders`` reads those that experiments are given, and raises.
    """
    options = check_flags(kinds).parse_args(arguments)
    allow(options.plugins)
    if options.here:
        is_fine = check_here(
            options.plugin,
            kinds,
            options.kind,
            sys.stdout,
            options.here,
            read=partial(read_draft, births=options.births, run=options.founders),
            read_founders=read_founders,
        )
        return 0 if is_fine else 1
    words = [*options.plugin, *(("--kind", options.kind) if options.kind else ())]
    problems = check_apart(words, print, warn=print)
    for problem in problems:
        print(problem)
    return 1 if problems else 0


def list_plugins(arguments: list[str], kinds: Sequence[Kind]) -> int:
    """Run ``revolve plugins``; return 0, or 1 if a module cannot be loaded."""
    options = list_flags().parse_args(arguments)
    allow(options.plugins)
    rows = list(_offered(kinds))
    if options.json:
        print(json.dumps([row._asdict() for row in rows], indent=1))
    else:
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for row in rows:
            print("  ".join(map(str.ljust, row, widths)).rstrip())
    return 0 if all(row.kind for row in rows) else 1


def _offered(kinds: Sequence[Kind]) -> Iterator[Listed]:
    """Yield built-in plug-ins, then those of packages and modules of ``--plugins``."""
    for kind in kinds:
        for name, plugin in kind.built_in.items():
            yield Listed(kind.name, name, place_of(name, plugin), BUILT_IN)
    installed = [entry.module for entry in entry_points(group=GROUP)]
    entries = [entry.partition("=")[0] for entry in allowed()]
    named = [entry.rpartition("/")[2].removesuffix(".py") for entry in entries]
    names = list(dict.fromkeys([*installed, *named]))
    for name in names:
        try:
            module = load_module(name, "revolve plugins")
        except RevolveError as error:
            yield Listed("", name, one_line(error), digest_of(name))
            continue
        inside = getattr(module, "__path__", ())
        names += [f"{name}.{each.name}" for each in iter_modules(inside)]
        for kind, attribute in offered(module, kinds):
            place = where_named(module, attribute)
            yield Listed(kind.name, f"{name}:{attribute}", place, digest_of(name))


def check_flags(kinds: Sequence[Kind]) -> Flags:
    """Return the parser of ``revolve check``."""
    flags = Flags(
        prog="revolve check",
        description="Check plug-ins as a run does before its first birth: one line for "
        "each; exit code 1 if one is refused.",
        examples=(
            "revolve check my_lab.py:wheel",
            "revolve check mine.toml",
            "revolve check my_lab:walk --kind fitness --plugins my_lab",
        ),
    )
    flags.add_argument(
        "plugin",
        nargs="+",
        metavar="PLUGIN",
        help="MODULE:NAME, FILE.py:NAME, or an experiment (.toml), whose plug-ins are "
        "checked with its parameters",
    )
    flags.add_argument(
        "--kind",
        choices=[kind.name for kind in kinds],
        help="kind of the plug-ins (default: detected)",
    )
    flags.add_argument(HERE, type=positive_number, help=argparse.SUPPRESS)
    flags.add_argument(BIRTHS, type=int, help=argparse.SUPPRESS)
    flags.add_argument(FROM, dest="founders", help=argparse.SUPPRESS)
    add_plugins(flags)
    return flags


def list_flags() -> Flags:
    """Return the parser of ``revolve plugins``."""
    flags = Flags(
        prog="revolve plugins",
        description="List the plug-ins of every kind, built-in or found, with file, "
        "line and digest of the source.",
        examples=("revolve plugins", "revolve plugins --plugins my_lab.py --json"),
    )
    flags.add_argument("--json", action="store_true", help="print JSON, one list")
    add_plugins(flags)
    return flags


_LONG_S, _LARGE_MB = 60.0, 500.0
"""From there on a run says what an evaluation takes."""
_STEP_S = 1e-5
"""Of a physics step, or of a brain tick."""


def evaluation_cost(experiment: Experiment) -> tuple[float, float]:
    """Return CPU time [s] and memory [MB] of an evaluation, or of a fitness window.

    Measured with robots of 14 parts; others take a few times as much or as little.
    """
    clock, space = experiment.simulation, experiment.space
    steps = clock.evaluation_steps
    if clock.evaluation_s is not None:
        steps = steps_of(clock.evaluation_s[1], clock)
    ticks, samples = steps / clock.brain_steps, clock.window_steps / clock.pose_steps
    draws = 1 if experiment.robust is None else experiment.robust.draws
    states = space.max_outputs + space.max_hidden
    weights = 8 * states * (space.max_inputs + states)
    waves = 0.0 if experiment.arena is not None else ticks * (100 + 16 * states)
    return draws * (steps + ticks) * _STEP_S, (weights + waves + samples * 150) / 1e6


def cost_line(experiment: Experiment) -> str:
    """Return a line about long or large evaluations of an island, or an empty text."""
    time_s, memory_mb = evaluation_cost(experiment)
    if time_s < _LONG_S and memory_mb < _LARGE_MB:
        return ""
    takes = f"{rounded(time_s, 2)} s of CPU time and {rounded(memory_mb, 2)} MB"
    return f"{experiment.name}: one evaluation takes about {takes} of memory"
