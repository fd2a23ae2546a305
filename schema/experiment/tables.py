"""Conversion of an experiment's tables, which a user wrote, to its sections."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from schema.errors import ExperimentError, cut, expectation, nearest, shown
from schema.experiment.bounded import near_files, parse_toml, text_of
from schema.experiment.document import Experiment, island_count, island_experiments
from schema.experiment.environment import is_mjcf, scenery_problem
from schema.experiment.sweep import Point, settings_problem, sweep_points, with_point
from schema.limits import MOST_ISLANDS

Tables = dict[str, Any]
"""Tables of a TOML text."""

_LISTS = ("islands", "calibration")
"""Keys that are lists of tables."""
_UNKNOWN = re.compile("Object contains unknown field `(.*)`")


def converted(tables: Tables, where: str) -> Experiment:
    """Return the experiment of tables before the checks across their keys.

    Args:
        tables: of a TOML text; paths of scenery and calibration become what the files
            hold, in place.
        where: path of the text, for messages and relative paths.

    Raises:
        ExperimentError: an unknown key (the nearest is named); a value of a wrong type
            or outside its range; a file that cannot be read.
    """
    if problem := settings_problem(tables):
        raise ExperimentError(f"{where}: {problem}")
    for path, number in _numbers(tables):
        if not isfinite(number):
            raise ExperimentError(f"{where}: {path}: must be finite, got {number}")
    _read_calibration(tables, where)
    _read_scenery(tables, where)
    complete = _completed(tables)
    try:
        experiment = msgspec.convert(complete, type=Experiment)
    except msgspec.ValidationError as error:
        raise ExperimentError(f"{where}: {_explain(error, complete)}") from None
    if island_count(experiment) > MOST_ISLANDS:
        raise ExperimentError(
            f"{where}: islands: must be <= {MOST_ISLANDS} islands, got "
            f"{island_count(experiment)}"
        )
    return experiment


def swept(whole: Experiment, tables: Tables, where: str) -> tuple[Experiment, ...]:
    """Return the experiments of a sweep.

    Args:
        whole: the converted document, with the sweep.
        tables: of the document.
        where: as of ``converted``.

    Raises:
        ExperimentError: as of ``converted``; too many points, or equal ones.
    """
    assert whole.sweep is not None
    try:
        points = sweep_points(whole.sweep)
    except ExperimentError as error:
        raise ExperimentError(f"{where}: {error}") from None
    width = len(str(len(points) - 1))
    experiments = []
    for number, point in enumerate(points):
        with at_point(point):
            name = f"{whole.name}-{number:0{width}}"
            experiments.append(converted(with_point(tables, point, name), where))
    _refuse_equal(experiments, where)
    return tuple(experiments)


def _refuse_equal(experiments: Sequence[Experiment], where: str) -> None:
    """Raise if every island replaces what the experiments of a sweep differ in."""
    first: dict[bytes, str] = {}
    for experiment in experiments:
        islands = island_experiments(experiment)
        plain = [replace(each, name="", sweep=None) for each in islands]
        known = first.setdefault(msgspec.json.encode(plain), experiment.name)
        if known != experiment.name:
            raise ExperimentError(
                f"{where}: sweep: {known} and {experiment.name} have equal islands: "
                "[[islands]] replace the swept settings"
            )


@contextmanager
def at_point(point: Point) -> Iterator[None]:
    """Add the values of a sweep's point to the message of an error."""
    try:
        yield
    except ExperimentError as error:
        if not point:
            raise
        values = ", ".join(f"{key} = {shown(value)}" for key, value in point.items())
        raise ExperimentError(f"{error}; in the sweep at {values}") from error


def known_keys(value: Any, kind: Any) -> Any:  # noqa: ANN401 - any tree of plain values
    """Return a value of a stored document without keys that its sections lack.

    Args:
        value: of a key of the annotation ``kind``.
        kind: a section, or any annotation.
    """
    section = _section(kind)
    if isinstance(value, list):
        return [known_keys(each, kind) for each in value]
    if section is None or not isinstance(value, dict):
        return value
    kinds = {field.encode_name: field.type for field in msgspec.structs.fields(section)}
    return {
        key: known_keys(each, kinds[key]) for key, each in value.items() if key in kinds
    }


def _numbers(value: Any, path: str = "") -> Iterator[tuple[str, float]]:  # noqa: ANN401
    """Yield path and value of each float in a tree of plain values."""
    if isinstance(value, float):
        yield path, value
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from _numbers(each, f"{path}.{cut(key)}" if path else cut(key))
    elif isinstance(value, list):
        for at, each in enumerate(value):
            yield from _numbers(each, f"{path}[{at}]")


def _read_calibration(tables: Tables, where: str) -> None:
    """Replace the path of a calibration file by the tables of the file, in place."""
    named = tables.get("calibration")
    if not isinstance(named, str):
        return
    path = Path(where).parent / named
    text = text_of(path, f"{where}: calibration: {named}", near_files(path))
    found = parse_toml(text, str(path))
    if list(found) != ["calibration"]:
        raise ExperimentError(
            f"{where}: calibration: {named}: must hold [[calibration]] tables and "
            f"nothing else, got {', '.join(map(cut, found)) or 'nothing'}"
        )
    tables["calibration"] = found["calibration"]


def _read_scenery(tables: Tables, where: str) -> None:
    """Replace paths of scenery by the text of the files, in place."""
    for holder in (tables, *_tables_of(tables.get("islands"))):
        for environment in _tables_of([holder.get("environment")]):
            scenery = environment.get("scenery")
            if not isinstance(scenery, str) or not scenery:
                continue
            place = f"{where}: environment.scenery"
            if not is_mjcf(scenery):
                place += f": {scenery}"
                scenery = text_of(Path(where).parent / scenery, place)
                if not scenery.strip():
                    # An empty text means no scenery.
                    raise ExperimentError(f"{place}: is empty")
            if problem := scenery_problem(scenery):
                raise ExperimentError(f"{place}: {problem}")
            environment["scenery"] = scenery


def _completed(tables: Tables) -> Tables:
    """Return tables whose ``islands`` have all keys of the sections that they name."""
    islands = tables.get("islands")
    if not isinstance(islands, list) or len(_tables_of(islands)) < len(islands):
        return tables
    complete = [
        {
            key: {**shared, **own}
            if isinstance(own, dict) and isinstance(shared := tables.get(key, {}), dict)
            else own
            for key, own in each.items()
        }
        for each in islands
    ]
    return {**tables, "islands": complete}


def _tables_of(value: object) -> list[Tables]:
    """Return the tables in a list; none if it is another value."""
    found = value if isinstance(value, list) else []
    return [each for each in found if isinstance(each, dict)]


def _section(kind: Any) -> type[Struct] | None:  # noqa: ANN401 - any annotation
    """Return the section type of an annotation; None if it is a plain value."""
    if isinstance(kind, type) and issubclass(kind, Struct):
        return kind
    inner = () if get_origin(kind) is dict else get_args(kind)
    return next(filter(None, map(_section, inner)), None)


def _explain(error: msgspec.ValidationError, tables: Tables) -> str:
    """Return the message of msgspec as ``key: expected, got value``."""
    message, _, path = str(error).partition(" - at `$.")
    key = path.rstrip("`")
    value: Any = tables
    kind: Any = Experiment
    for name in key.split(".") if key else ():
        word, *places = name.replace("]", "").split("[")
        fields = _fields(kind)
        value = value.get(word) if isinstance(value, dict) else None
        kind = fields.get(word)
        for place in places:
            value = value[int(place)] if isinstance(value, list) else None
    if unknown := _UNKNOWN.fullmatch(message):
        return _no_such_key(unknown[1], key, list(_fields(kind)))
    message = expectation(message)
    if not key:
        return message
    if key in _LISTS and isinstance(value, dict):
        return f"{key}: must be [[{key}]], got [{key}]"
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    if not choices:
        return f"{key}: {message.partition(', got ')[0]}, got {shown(value)}"
    allowed = ", ".join(map(repr, choices))
    return (
        f"{key}: must be one of {allowed}, got {shown(value)}{nearest(value, choices)}"
    )


def _no_such_key(unknown: str, section: str, known: list[str]) -> str:
    prefix = f"{section}." if section else ""
    own = f"; those of a plug-in are in [{prefix}parameters]"
    return (
        f"{prefix}{cut(unknown)}: no such key{nearest(unknown, known)}; allowed: "
        f"{', '.join(known)}{own if 'parameters' in known else ''}"
    )


def _fields(kind: Any) -> dict[str, Any]:  # noqa: ANN401 - any annotation
    """Return the annotations of a section's keys; none if it is no section."""
    section = _section(kind)
    fields = msgspec.structs.fields(section) if section else ()
    return {field.encode_name: field.type for field in fields}
