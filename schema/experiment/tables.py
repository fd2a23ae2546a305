"""Conversion of an experiment's tables, which a user wrote, to its sections."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from schema.errors import ExperimentError, check_most, cut, naming, shown
from schema.experiment.document import Experiment, island_count, island_experiments
from schema.experiment.environment import scenery_problem
from schema.experiment.sweep import Point, settings_problem, sweep_points, with_point
from schema.limits import MOST_ISLANDS
from schema.plugins.bounded import parse_toml, text_of
from schema.plugins.parameters import read_parameters

Tables = dict[str, Any]
"""Tables of a TOML text."""
_FLAGS = ("seed", "repeats", "workers", "out")
"""Flags that are easily mistaken for keys."""


def converted(tables: Tables, where: str) -> Experiment:
    """Return the experiment of tables before the checks across their keys.

    Paths of scenery and calibration, relative to that of the document, become what the
    files hold, in place; those of founders become absolute.

    Raises:
        ExperimentError: an unknown key (the nearest is named); a value of a wrong type
            or outside its range; a file that cannot be read.
    """
    if problem := settings_problem(tables):
        raise ExperimentError(f"{where}: {problem}")
    if flag := next((key for key in _FLAGS if key in tables), ""):
        why = f"is a flag of revolve run, --{flag}, not a key of an experiment"
        raise ExperimentError(f"{where}: {flag}: {why}")
    _read_calibration(tables, where)
    _read_scenery(tables, where)
    _anchor_founders(tables, Path(where).parent.absolute())
    experiment = read_parameters(_completed(tables), Experiment, where, ": ")
    count = island_count(experiment)
    check_most(count, MOST_ISLANDS, "islands", where, ExperimentError)
    return experiment


def swept(whole: Experiment, tables: Tables, where: str) -> tuple[Experiment, ...]:
    """Return the experiments of a sweep.

    Raises:
        ExperimentError: as of ``converted``; too many points, or equal ones.
    """
    assert whole.sweep is not None
    with naming(where):
        points = sweep_points(whole.sweep)
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
            equal = f"{known} and {experiment.name} have equal islands"
            why = "[[islands]] replace the swept settings"
            raise ExperimentError(f"{where}: sweep: {equal}: {why}")


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


def _read_calibration(tables: Tables, where: str) -> None:
    """Replace the path of a calibration file by the tables of the file, in place."""
    named = tables.get("calibration")
    if not isinstance(named, str):
        return
    path = Path(where).parent / named
    text = text_of(path, f"{where}: calibration: {named}")
    found = parse_toml(text, str(path))
    if list(found) != ["calibration"]:
        rule = "must hold [[calibration]] tables and nothing else"
        got = ", ".join(map(cut, found)) or "nothing"
        raise ExperimentError(f"{where}: calibration: {named}: {rule}, got {got}")
    tables["calibration"] = found["calibration"]


def _read_scenery(tables: Tables, where: str) -> None:
    """Replace paths of scenery by the text of the files, in place."""
    for holder in (tables, *_tables_of(tables.get("islands"))):
        for environment in _tables_of([holder.get("environment")]):
            scenery = environment.get("scenery")
            if not isinstance(scenery, str) or not scenery:
                continue
            place = f"{where}: environment.scenery"
            if not scenery.lstrip().startswith("<"):
                # It is no MJCF, but the path of a file.
                place += f": {scenery}"
                scenery = text_of(Path(where).parent / scenery, place)
                if not scenery.strip():
                    # An empty text means no scenery.
                    raise ExperimentError(f"{place}: is empty")
            if problem := scenery_problem(scenery):
                raise ExperimentError(f"{place}: {problem}")
            environment["scenery"] = scenery


def _anchor_founders(tables: Tables, place: Path) -> None:
    """Make paths of founders, relative to a place, absolute, in place."""
    for holder in (tables, *_tables_of(tables.get("islands"))):
        for founders in _tables_of([holder.get("founders")]):
            if isinstance(run := founders.get("run"), str):
                founders["run"] = str(place / run)
            if isinstance(files := founders.get("files"), list):
                founders["files"] = [
                    str(place / each) if isinstance(each, str) else each
                    for each in files
                ]


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
