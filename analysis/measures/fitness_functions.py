"""Fitness functions of experiments: which share one, its name, its unit."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

import pyarrow as pa

UNITS = {
    # Path velocity and five times straight velocity, which is how fast no robot moves.
    "locomotion": "weighted velocity",
    "directed-locomotion": "m/s",
    "target": "m/s",
    "light": "brightness",
    "turning": "rad/s",
    "balance": "m",
}
"""Unit of each function that comes with the toolkit."""
MEASURE_UNITS = {
    "path_velocity": "m/s",
    "straight_velocity": "m/s",
    "turning": "rad/s",
    "energy": "J",
    "height": "m",
    "joint_effort": "N m",
}
"""Units of the measures that come with the toolkit and have one."""


def functions_of(runs: pa.Table) -> dict[str, str]:
    """Return the name of each experiment's fitness function, by experiment.

    Names are those of ``fitness_text``, without the digests of sources where that does
    not make different texts equal.
    """
    rows = runs.select(["experiment", "fitness_function"]).to_pylist()
    texts = {row["experiment"]: row["fitness_function"] or "" for row in rows}
    counts = Counter(map(_without_source, set(texts.values())))
    return {
        name: short if counts[short := _without_source(text)] == 1 else text
        for name, text in sorted(texts.items())
    }


def by_function(functions: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the experiments of each fitness function, in order of appearance."""
    groups: dict[str, list[str]] = {}
    for experiment, function in functions.items():
        groups.setdefault(function, []).append(experiment)
    return groups


def measured_apart(runs: pa.Table) -> tuple[list[str], list[str]]:
    """Return the sorted experiments in arenas and off-line, of functions of both."""
    rows = runs.select(["experiment", "simulated_s"]).to_pylist()
    in_arenas = {row["experiment"] for row in rows if row["simulated_s"] is not None}
    online: list[str] = []
    offline: list[str] = []
    for names in by_function(functions_of(runs)).values():
        if in_arenas.isdisjoint(names) or in_arenas.issuperset(names):
            continue
        online += [name for name in names if name in in_arenas]
        offline += [name for name in names if name not in in_arenas]
    return sorted(online), sorted(offline)


def not_compared(runs: pa.Table, name: Callable[[str], str] = str) -> list[str]:
    """Return why fitness cannot be compared in some pairs; empty if it can in all.

    ``name`` returns the label of an experiment.
    """

    def listed(experiments: Iterable[str]) -> str:
        return ", ".join(map(name, experiments))

    lines = []
    groups = by_function(functions_of(runs))
    if len(groups) > 1:
        lists = "; ".join(f"{listed(each)} by {one}" for one, each in groups.items())
        lines.append(
            "fitness is not compared between different fitness functions, because "
            f"their numbers have different meanings: {lists}"
        )
    online, offline = measured_apart(runs)
    if online:
        lines.append(
            f"fitness in arenas ({listed(online)}) is measured in another way than "
            f"off-line ({listed(offline)}): among other robots, after falls, again and "
            "again; a difference does not show which robots are better"
        )
    return lines


def fitness_unit(function: str) -> str:
    """Return the unit of a value of ``functions_of``; empty if it is not known."""
    return UNITS.get(function.partition(" (")[0], "") if " and " not in function else ""


def axis_text(function: str, what: str = "fitness") -> str:
    """Return the label of an axis of fitness, for example ``fitness [m/s]``."""
    unit = fitness_unit(function)
    return f"{what} [{unit}]" if unit else what


def _without_source(text: str) -> str:
    return re.sub(r" \(source \w+\)|, source \w+(?=\))", "", text)
