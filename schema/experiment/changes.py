"""Settings that change during a run: ``[[changes]]``.

A table has the values of one setting at some points: numbers of births of an off-line
island, or simulated seconds of an arena. Values are functions of the point alone, so
that neither a journal nor a snapshot needs to hold them.
"""

from bisect import bisect_right
from collections.abc import Hashable, Iterator
from functools import lru_cache
from itertools import pairwise
from math import floor
from typing import Annotated, Any, Literal, Protocol, TypeVar

from msgspec import Meta, to_builtins
from msgspec.structs import replace

from schema.errors import ExperimentError, nearest, shown
from schema.experiment.section import NotNegative, Section
from schema.plugins.parameters import read_parameters

CHANGEABLE = (
    "simulation.friction",
    "simulation.torque_factor",
    "simulation.sensor_noise",
    "simulation.actuator_noise",
    "environment.slope_deg",
    "environment.slope_direction_deg",
    "environment.light",
)
"""Settings that may change, beside the parameters of fitness and of arena rules."""
OF_FITNESS, OF_RULES = "fitness.parameters.", "arena.parameters."
LIGHT = "environment.light"

Values = float | tuple[float | tuple[float, ...], ...]
"""A number, a position, or a list of positions. Their bounds are those of the setting:
with a constraint beside a tuple, msgspec 0.22 crashes."""


class SettingChange(Section, frozen=True):
    """Values of one setting over the births of an island, or the time of an arena.

    Attributes:
        setting: dotted key: ``simulation.friction``, ``simulation.torque_factor``,
            ``simulation.sensor_noise``, ``simulation.actuator_noise``,
            ``environment.slope_deg``, ``environment.slope_direction_deg``,
            ``environment.light``, or a parameter of the fitness function or of the
            rules of an arena: ``fitness.parameters.targets``, for example, or
            ``arena.parameters.patch_inflow``.
        at: points, ascending from 0: numbers of births off-line, simulated seconds in
            arenas.
        values: value of the setting from each point on; in place of that in its
            section, also at 0.
        between: ``hold`` each value to the next point, or change it ``linear``ly, at
            whole births or seconds.
        period: the table repeats after so many births or seconds; ``linear`` values
            return to the first one then. Without it the last value stays.
    """

    setting: str
    at: Annotated[tuple[NotNegative, ...], Meta(min_length=1)]
    values: tuple[Values, ...]
    between: Literal["hold", "linear"] = "hold"
    period: Annotated[float, Meta(ge=1, le=1e12)] | None = None


class Changing(Hashable, Protocol):
    """Settings that may have changes: an experiment, or those of a request."""

    @property
    def changes(self) -> tuple[SettingChange, ...]:
        """The section ``changes``."""


S = TypeVar("S", bound=Changing)


def value_at(change: SettingChange, point: float) -> Values:
    """Return the value of a changing setting at a point >= 0 [births or s]."""
    is_linear = change.between == "linear"
    point = floor(point) if is_linear else point
    if change.period is not None:
        point %= change.period
    following = bisect_right(change.at, point)
    start, value = change.at[following - 1], change.values[following - 1]
    end = (*change.at, change.period)[following]
    if not is_linear or end is None:
        return value
    # Beyond the last point is the first one, a period later.
    other = change.values[following % len(change.values)]
    mixed: Values = between(value, other, (point - start) / (end - start))
    return mixed


def between(low: Any, high: Any, share: float) -> Any:  # noqa: ANN401 - ``Values``
    """Return the values at a share of the way between two of one form."""
    if isinstance(low, tuple):
        pairs = zip(low, high, strict=True)
        return tuple(between(one, other, share) for one, other in pairs)
    return low + share * (high - low)


def settings_at(settings: S, point: float) -> S:
    """Return settings with the values at a point [births or s], without changes.

    Equal values give the same object, as long as it is in the cache.
    """
    if not settings.changes:
        return settings
    values = tuple(value_at(change, point) for change in settings.changes)
    changed: S = _with_values(settings, values)
    return changed


@lru_cache(maxsize=256)
def _with_values(settings: Any, values: tuple[Values, ...]) -> Any:  # noqa: ANN401
    changed = replace(settings, changes=())
    for change, value in zip(settings.changes, values, strict=True):
        changed = with_value(changed, change.setting, value)
    return changed


def with_value(settings: Any, key: str, value: Any) -> Any:  # noqa: ANN401
    """Return settings with another value of the setting with a dotted key."""
    section, _, name = key.partition(".")
    known = getattr(settings, section)
    if key.startswith((OF_FITNESS, OF_RULES)):
        parameter = name.removeprefix("parameters.")
        name, value = "parameters", {**known.parameters, parameter: value}
    return replace(settings, **{section: replace(known, **{name: value})})


def change_points(change: SettingChange, end: float) -> Iterator[float]:
    """Yield the points after 0 and below an end at which a table has a value."""
    start = 0.0
    while start < end:
        yield from (start + at for at in change.at if 0 < start + at < end)
        if change.period is None:
            return
        start += change.period


def change_problems(settings: Any) -> Iterator[str]:  # noqa: ANN401 - as ``Changing``
    """Yield what is wrong with changes; each check relies on those before it.

    Parameters of functions and rules, which may be plug-ins, are checked elsewhere.
    """
    known: set[str] = set()
    for number, change in enumerate(settings.changes):
        where, key = f"changes[{number}]", change.setting
        if key.startswith(OF_RULES) and getattr(settings, "arena", None) is None:
            yield f"{where}.setting: {shown(key)} needs [arena]"
        is_known = key in CHANGEABLE or key.startswith((OF_FITNESS, OF_RULES))
        if not is_known:
            allowed = ", ".join((*CHANGEABLE, f"{OF_FITNESS}NAME", f"{OF_RULES}NAME"))
            allowed = f"one of {allowed}"
            got = f"got {shown(key)}{nearest(key, CHANGEABLE)}"
            yield f"{where}.setting: must be {allowed}, {got}"
        if key in known:
            yield f"{where}.setting: two changes are of {shown(key)}"
        known.add(key)
        yield from (f"{where}.{problem}" for problem in _table_problems(change))
        if key == LIGHT:
            yield from _light_problems(settings, where)
        if key in CHANGEABLE:
            yield from _value_problems(settings, change, where)


def _table_problems(change: SettingChange) -> Iterator[str]:
    points, values, period = change.at, change.values, change.period
    if points[0] != 0:
        yield f"at: must begin with 0, got {points[0]:g}"
    for before, after in pairwise(points):
        if not before < after:
            yield f"at: must be ascending, got {after:g} after {before:g}"
    if len(values) != len(points):
        yield f"values: must be {len(points)}, one for each of at, got {len(values)}"
    if period is not None and period <= points[-1]:
        yield f"period: must be > {points[-1]:g}, the last of at, got {period:g}"
    if change.between == "linear" and len(set(map(_form, values))) > 1:
        yield "values: must have the same number of coordinates for 'linear'"


def _form(value: Values) -> object:
    return tuple(map(_form, value)) if isinstance(value, tuple) else 1


def _light_problems(settings: Any, where: str) -> Iterator[str]:  # noqa: ANN401
    arena = getattr(settings, "arena", None)
    if arena is not None and arena.light is not None:
        yield f"{where}.setting: needs {LIGHT} in place of arena.light"
    elif settings.environment.light is None:
        yield f"{where}.setting: needs {LIGHT} = [x, y, z], got none"


def _value_problems(
    settings: Any,  # noqa: ANN401
    change: SettingChange,
    where: str,
) -> Iterator[str]:
    """Yield which value the section of its setting does not allow."""
    section, _, name = change.setting.partition(".")
    kind = type(getattr(settings, section))
    for number, value in enumerate(change.values):
        place = f"{where}.values[{number}]"
        try:
            read_parameters({name: to_builtins(value)}, kind, place, ": ")
        except ExperimentError as error:
            yield str(error)
