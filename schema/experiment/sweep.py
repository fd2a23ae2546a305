"""Sweeps: one document that stands for experiments with different settings."""

import json
import math
import random
from collections.abc import Iterable, Iterator
from copy import deepcopy
from itertools import product
from typing import Any

from msgspec import field

from schema.errors import ExperimentError, check_most, cut, shown
from schema.experiment.section import Count, Parameters, PluginSection, Section, Value
from schema.limits import MOST_SWEEP_POINTS
from schema.plugins.parameters import read_parameters

Point = dict[str, Any]
"""Values of the settings at one point of a sweep, by their dotted keys."""


class Range(Section, frozen=True):
    """Values between two numbers; whole numbers if both are.

    Attributes:
        low: least value.
        high: greatest value.
        steps: number of evenly spaced values, both ends included; without ``samples``
            it must be given. Whole numbers are rounded, and equal ones count once.
        log: space the values evenly in their logarithm.
    """

    low: Value
    high: Value
    steps: Count = 0
    log: bool = False

    def at(self, share: float) -> int | float:
        """Return the value at a share of the way from ``low`` to ``high``."""
        if self.log:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        is_whole = isinstance(self.low, int) and isinstance(self.high, int)
        # Twelve digits: 0.3 instead of 0.30000000000000004 in names and tables.
        return round(value) if is_whole else float(f"{value:.12g}")


class Sweep(PluginSection, frozen=True):
    """Settings of a campaign whose experiments differ in some values.

    Attributes:
        settings: values by the dotted key of each setting, such as
            ``"arena.birth_interval_s"``: a list, or a range ``{low, high, steps}``.
        samples: number of points of a Latin hypercube; 0: every combination.
        seed: random seed of the Latin hypercube; every combination needs none.
        chosen: the values of one experiment of the sweep; ``revolve run`` sets it.
    """

    settings: dict[str, tuple[Any, ...] | Range]
    samples: Count = 0
    seed: Count = 0
    chosen: Parameters = field(default_factory=dict)


def settings_problem(tables: dict[str, Any]) -> str:
    """Return what is wrong with the values of a sweep's settings; empty if nothing is.

    The errors of ``msgspec`` do not name the setting.
    """
    sweep = tables.get("sweep")
    settings = sweep.get("settings") if isinstance(sweep, dict) else None
    for key, value in settings.items() if isinstance(settings, dict) else ():
        name = f"sweep.settings.{json.dumps(cut(key))}"
        if isinstance(value, dict):
            inner, first = next(iter(value.items()), ("", None))
            if isinstance(first, dict | list):
                quoted = f'settings."{key}.{cut(inner)}" = ...'
                return f"{name}: a key with dots must be quoted: {quoted}"
            try:
                read_parameters(value, Range, name)
            except ExperimentError as error:
                return str(error)
        elif not isinstance(value, list):
            rule = "must be a list, or a range such as { low = 1, high = 2, steps = 3 }"
            return f"{name}: {rule}, got {shown(value)}"
    return ""


def sweep_problems(sweep: Sweep) -> Iterator[str]:
    """Yield what is wrong with a sweep."""
    if not sweep.settings:
        yield "sweep.settings: must name at least one setting"
    for key, values in sweep.settings.items():
        where = f'sweep.settings."{key}"'
        if key.split(".")[0] in ("name", "islands", "sweep"):
            yield f"{where}: {key.split('.')[0]} cannot be swept"
        elif isinstance(values, Range):
            yield from (f"{where}: {each}" for each in _range_problems(values, sweep))
        elif not values:
            yield f"{where}: must have at least one value"
        elif any(each in values[:at] for at, each in enumerate(values)):
            yield f"{where}: must have each value once, got {list(values)}"
    if sweep.chosen and set(sweep.chosen) != set(sweep.settings):
        yield "sweep.chosen: must have a value for each of sweep.settings"


def _range_problems(values: Range, sweep: Sweep) -> Iterator[str]:
    if not values.low < values.high or not math.isfinite(values.high - values.low):
        yield f"low must be < high, got {values.low} and {values.high}"
    elif values.log and values.low <= 0:
        yield f"low must be > 0 for log, got {values.low}"
    elif not sweep.samples and values.steps < 2:  # noqa: PLR2004 - both ends
        yield f"steps must be >= 2, got {values.steps or 'none'}"


def sweep_points(sweep: Sweep) -> list[Point]:
    """Return the points of a sweep in the order of its experiments.

    Raises:
        ExperimentError: more points than are allowed.
    """
    settings = sweep.settings.values()
    sizes = (each.steps if isinstance(each, Range) else len(each) for each in settings)
    size = sweep.samples or math.prod(sizes)
    check_most(size, MOST_SWEEP_POINTS, "points", "sweep", ExperimentError)
    if sweep.samples:
        rows: Iterable[tuple[Any, ...]] = zip(*_latin_hypercube(sweep), strict=True)
    else:
        rows = product(*map(_values, sweep.settings.values()))
    return [dict(zip(sweep.settings, row, strict=True)) for row in rows]


def _values(values: tuple[Any, ...] | Range) -> list[Any]:
    if not isinstance(values, Range):
        return list(values)
    shares = [step / (values.steps - 1) for step in range(values.steps)]
    # Whole numbers may coincide.
    return list(dict.fromkeys(map(values.at, shares)))


def _latin_hypercube(sweep: Sweep) -> Iterator[list[Any]]:
    """Yield the values of each setting: one in each of ``samples`` equal parts.

    Source: McKay, Beckman, Conover 1979.
    """
    stream = random.Random(sweep.seed)  # noqa: S311 - no secret
    for values in sweep.settings.values():
        # Of this generator only random() is the same in all versions of Python.
        order = sorted(range(sweep.samples), key=lambda _: stream.random())
        shares = [(part + stream.random()) / sweep.samples for part in order]
        if isinstance(values, Range):
            yield [values.at(share) for share in shares]
        else:
            yield [values[int(share * len(values))] for share in shares]


def with_point(document: dict[str, Any], point: Point, name: str) -> dict[str, Any]:
    """Return a copy of a document's tables at a point of its sweep.

    Raises:
        ExperimentError: a key leads through a value that is no table.
    """
    changed = deepcopy(document)
    for key, value in point.items():
        *sections, last = key.split(".")
        table = changed
        for section in sections:
            table = table.setdefault(section, {})
            if not isinstance(table, dict):
                raise ExperimentError(f'sweep.settings."{key}": no such key')
        table[last] = value
    changed["name"] = name
    changed["sweep"]["chosen"] = point
    return changed
