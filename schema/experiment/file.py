"""Reading and writing of experiments: TOML of users, JSON of the runs table."""

import json
import re
import tomllib
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from schema.errors import ExperimentError, cut, expectation, nearest, shown, unreadable
from schema.experiment.bounded import read_bytes
from schema.experiment.check import check_experiment
from schema.experiment.document import Experiment, island_experiments, references
from schema.experiment.environment import (
    is_mjcf,
    too_long,
    unused_attribute,
)
from schema.experiment.sweep import (
    Point,
    Range,
    sweep_points,
    sweep_problems,
    with_point,
)
from schema.limits import (
    MOST_BRACKETS,
    MOST_DIGITS,
    MOST_ISLAND_TABLES,
    MOST_ISLANDS,
    MOST_KEY_PARTS,
    MOST_LENGTH_M,
    MOST_TEXT_BYTES,
)
from schema.plugins.parameters import read_parameters
from schema.plugins.permission import allow_references

_LISTS = ("islands", "calibration")
"""Keys that are lists of tables."""

# ``tomllib`` stores all beginnings of a dotted key. Possessive: without backtracking.
_KEY_PART = r"""(?:[\w-]++|"(?:[^"\\\n]++|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_NUMBER = re.compile(rf"(?<!\w)[0-9][0-9A-Fa-f_xob]{{{MOST_DIGITS}}}")
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_KEY_PART}){{{MOST_KEY_PARTS}}}")


def read_experiment(source: str) -> Experiment:
    """Return a shipped experiment by its name, or one from a TOML file.

    Args:
        source: ``scenario1``, or a path that ends in ``.toml``.

    Raises:
        ExperimentError: no such experiment or file, or an invalid document.
    """
    text, where = source_text(source)
    return experiment_from_tables(parse_toml(text, where), where)


def _tables(source: str, births: int | None) -> tuple[dict[str, Any], str]:
    """Return the tables of an experiment, with other births, and its path."""
    text, where = source_text(source)
    tables = parse_toml(text, where)
    if births is not None:
        tables["births"] = births
        islands = tables.get("islands")
        for island in islands if isinstance(islands, list) else ():
            if isinstance(island, dict):
                island.pop("births", None)
    return tables, where


def experiments_of(source: str, births: int | None = None) -> tuple[Experiment, ...]:
    """Return the experiments of a document: one, or those of its sweep.

    Args:
        source: as for ``read_experiment``.
        births: of ``--births``, in place of those of the document.

    Raises:
        ExperimentError: as of ``read_experiment``, at any point of the sweep.
    """
    drafts = draft_experiments(source, births)
    where = source if source.endswith(".toml") else f"{source}.toml"
    if births is not None:
        where = f"{where} with --births {births}"
    for draft in drafts:
        with _at_point(draft.sweep.chosen if draft.sweep else {}):
            check_experiment(draft, where)
    return drafts


def source_text(source: str) -> tuple[str, str]:
    """Return the TOML text of an experiment, and its path for ``parse_toml``.

    Args:
        source: as for ``read_experiment``.

    Raises:
        ExperimentError: no such experiment or file.
    """
    if source.endswith(".toml"):
        return _text(source), source
    check_source(source, shipped_experiments())
    folder = resources.files("schema.experiment") / "shipped"
    return (folder / f"{source}.toml").read_text(encoding="utf-8"), f"{source}.toml"


def check_source(source: str, shipped: Collection[str]) -> None:
    """Raise unless a source is the path of a TOML file or a shipped name.

    Raises:
        ExperimentError: neither; the message names the nearest, or says what a path
            of another kind leads to.
    """
    if source.endswith(".toml") or source in shipped:
        return
    path = Path(source)
    if path.is_dir():
        raise ExperimentError(
            f"{source}: is a folder; an experiment is a .toml file or a shipped name"
        )
    beside = f"{source}.toml"
    if path.is_file() or (path.suffix and not Path(beside).is_file()):
        and_missing = "" if path.is_file() else ", and there is no such file"
        raise ExperimentError(
            f"{source}: the file of an experiment must end in .toml, got "
            f"{path.suffix!r}{and_missing}{'' if path.is_file() else _near(path)}"
        )
    near = nearest(source, [*shipped, *([beside] if Path(beside).is_file() else ())])
    raise ExperimentError(
        f"{source}: no such experiment{near}; shipped are {', '.join(shipped)}, or "
        "give a path to a .toml file"
    )


def _near(missing: Path) -> str:
    """Return ``; did you mean 'x'?`` for a TOML file with a similar name beside it."""
    return nearest(str(missing), [str(each) for each in missing.parent.glob("*.toml")])


def shipped_experiments() -> list[str]:
    """Return the names of the experiments that come with the package."""
    folder = resources.files("schema.experiment") / "shipped"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def experiment_from_tables(document: dict[str, Any], where: str) -> Experiment:
    """Return the experiment of the tables of a user's TOML text.

    The modules that it names may be imported by this process from now on.

    Args:
        document: the tables; paths of scenery and calibration become what they hold.
        where: path of the text, for messages, and for relative paths of scenery and
            plug-ins.

    Raises:
        ExperimentError: an unknown key (the nearest is named); a value of a wrong type
            or outside its range; inconsistent values.
    """
    experiment = _converted(document, where)
    allow_references(references(experiment), Path(where).parent)
    check_experiment(experiment, where)
    return experiment


def own_experiment(text: str) -> Experiment:
    """Return the experiment of a run folder that the user named on the command line.

    Installed modules that it names may be imported by this process from now on.

    Raises:
        ExperimentError: not a text of ``experiment_text``.
    """
    experiment = experiment_from_text(text)
    allow_references(references(experiment))
    return experiment


def draft_experiments(source: str, births: int | None = None) -> tuple[Experiment, ...]:
    """Return the experiments of a document before the checks across their keys.

    No plug-in is imported; the modules that they name may be from now on.

    Args:
        source: as for ``read_experiment``.
        births: as for ``experiments_of``.

    Raises:
        ExperimentError: as of ``own_references``.
    """
    document, where = _tables(source, births)
    experiments = _drafts(document, where, births)
    for experiment in experiments:
        allow_references(references(experiment), Path(where).parent)
    return experiments


def _drafts(
    document: dict[str, Any], where: str, births: int | None
) -> tuple[Experiment, ...]:
    """Return the experiments of tables before the checks across their keys."""
    whole = _converted(deepcopy(document), where)
    sweep = whole.sweep
    if sweep is None or sweep.chosen:
        return (whole,)
    if problem := next(sweep_problems(sweep), ""):
        raise ExperimentError(f"{where}: {problem}")
    if births is not None and "births" in sweep.settings:
        raise ExperimentError(f"{where}: --births: the sweep changes births itself")
    try:
        points = sweep_points(sweep)
    except ExperimentError as error:
        raise ExperimentError(f"{where}: {error}") from None
    width = len(str(len(points) - 1))
    experiments = []
    for number, point in enumerate(points):
        name = f"{whole.name}-{number:0{width}}"
        with _at_point(point):
            tables = with_point(document, point, name)
            experiments.append(_converted(tables, where))
    _refuse_equal(experiments, where)
    return tuple(experiments)


def _refuse_equal(experiments: Sequence[Experiment], where: str) -> None:
    """Raise if every island replaces what the experiments of a sweep differ in."""
    first: dict[bytes, str] = {}
    for one in experiments:
        islands = island_experiments(one)
        plain = [replace(each, name="", sweep=None) for each in islands]
        known = first.setdefault(msgspec.json.encode(plain), one.name)
        if known != one.name:
            raise ExperimentError(
                f"{where}: sweep: {known} and {one.name} have equal islands: "
                "[[islands]] replace the swept settings"
            )


@contextmanager
def _at_point(point: Point) -> Iterator[None]:
    """Add the values of a sweep's point to the message of an error."""
    try:
        yield
    except ExperimentError as error:
        if not point:
            raise
        values = ", ".join(f"{key} = {shown(value)}" for key, value in point.items())
        raise ExperimentError(f"{error}; in the sweep at {values}") from error


def own_references(source: str, births: int | None = None) -> list[str]:
    """Return the ``module:attribute`` that an experiment names; nothing is imported.

    Args:
        source: as for ``read_experiment``; a shipped one has none of its own.
        births: as for ``experiments_of``.

    Raises:
        ExperimentError: the file cannot be read, or has an unknown key or a value of a
            wrong type.
    """
    if not source.endswith(".toml"):
        return []
    drafts = _drafts(*_tables(source, births), births)
    return list(dict.fromkeys(path for each in drafts for path in references(each)))


def _converted(document: dict[str, Any], where: str) -> Experiment:
    """Return the experiment of tables before the checks across its keys."""
    _read_calibration(document, where)
    _read_sweep(document, where)
    _refuse_unknown(document, Experiment, where, "")
    _refuse_many_islands(document, where)
    _read_scenery(document, where)
    complete = _completed(document)
    try:
        return msgspec.convert(complete, type=Experiment)
    except msgspec.ValidationError as error:
        raise ExperimentError(f"{where}: {_explain(error, complete)}") from None


def _read_sweep(document: dict[str, Any], where: str) -> None:
    """Raise for a value that no setting of a sweep can have.

    ``msgspec`` does not name the setting.
    """
    sweep = document.get("sweep")
    settings = sweep.get("settings") if isinstance(sweep, dict) else None
    for key, value in settings.items() if isinstance(settings, dict) else ():
        name = f"{where}: sweep.settings.{json.dumps(cut(key))}"
        if isinstance(value, dict):
            inner, each = next(iter(value.items()), ("", None))
            if isinstance(each, dict | list):
                raise ExperimentError(
                    f"{name}: a key with dots must be quoted: "
                    f'settings."{key}.{cut(inner)}" = ...'
                )
            read_parameters(value, Range, name)
        elif not isinstance(value, list):
            raise ExperimentError(
                f"{name}: must be a list, or a range such as {{ low = 1, high = 2, "
                f"steps = 3 }}, got {shown(value)}"
            )


def _text(source: str) -> str:
    """Return the text of a TOML file."""
    path = Path(source)
    try:
        # With the byte order mark of editors of Windows, as scenery and calibrations.
        return read_bytes(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        near = ""
        if isinstance(error, FileNotFoundError):
            is_shipped = path.stem in shipped_experiments()
            name = f"; did you mean {path.stem!r}, which is shipped?"
            near = name if is_shipped else _near(path)
        raise ExperimentError(f"{source}: {unreadable(error)}{near}") from None


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the document of a TOML text.

    Raises:
        ExperimentError: not TOML, too long, nested too deeply, or a key of too many
            parts.
    """
    if len(text) > MOST_TEXT_BYTES:
        raise ExperimentError(
            f"{where}: must have <= {MOST_TEXT_BYTES} characters, got {len(text)}"
        )
    if (brackets := text.count("[")) > MOST_BRACKETS:
        raise ExperimentError(
            f"{where}: must have <= {MOST_BRACKETS} lists and tables, got {brackets}"
        )
    if _LONG_KEY.search(text):
        raise ExperimentError(f"{where}: a key must have <= {MOST_KEY_PARTS} parts")
    if _LONG_NUMBER.search(text):
        raise ExperimentError(f"{where}: a number must have <= {MOST_DIGITS} digits")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ExperimentError(f"{where}: not valid TOML: nested too deeply") from None
    except ValueError as error:
        # Too long an integer is no TOMLDecodeError.
        reason = str(error).partition(";")[0]
        raise ExperimentError(f"{where}: not valid TOML: {reason}") from None


def _refuse_many_islands(document: dict[str, Any], where: str) -> None:
    tables = document.get("islands", ())
    counts = [table.get("count", 1) for table in tables]
    whole = sum(count for count in counts if isinstance(count, int))
    if len(tables) > MOST_ISLAND_TABLES or whole > MOST_ISLANDS:
        raise ExperimentError(
            f"{where}: islands: must be <= {MOST_ISLANDS} islands in <= "
            f"{MOST_ISLAND_TABLES} tables, got {shown(whole)} in {len(tables)}"
        )


def _read_scenery(document: dict[str, Any], where: str) -> None:
    """Replace paths of scenery by the text of the files, in place."""
    for table in (document, *document.get("islands", ())):
        environment = table.get("environment", {})
        named = environment.get("scenery", "")
        if not isinstance(named, str) or not named:
            continue
        if is_mjcf(named):
            _check_scenery(named, where)
            continue
        path = Path(where).parent / named
        try:
            text = read_bytes(path).decode("utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise ExperimentError(
                f"{where}: environment.scenery: {named}: {unreadable(error)}"
            ) from None
        if not text.strip():
            # An empty text means no scenery.
            raise ExperimentError(f"{where}: environment.scenery: {named}: is empty")
        environment["scenery"] = text
        _check_scenery(text, f"{where}: {named}")


def _check_scenery(scenery: str, where: str) -> None:
    """Raise for attributes that scenery must not have."""
    if name := unused_attribute(scenery):
        raise ExperimentError(
            f"{where}: environment.scenery: <geom {name}=...> is not allowed: it has "
            "no effect here"
        )
    if found := too_long(scenery):
        raise ExperimentError(
            f"{where}: environment.scenery: {cut(found)}: lengths must be <= "
            f"{MOST_LENGTH_M:g} m"
        )


def _read_calibration(document: dict[str, Any], where: str) -> None:
    """Replace the path of a calibration file by the tables of the file, in place."""
    named = document.get("calibration")
    if not isinstance(named, str):
        return
    path = Path(where).parent / named
    try:
        tables = parse_toml(read_bytes(path).decode("utf-8-sig"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise ExperimentError(
            f"{where}: calibration: {named}: {unreadable(error)}{_near(path)}"
        ) from None
    if list(tables) != ["calibration"]:
        raise ExperimentError(
            f"{where}: calibration: {named}: must hold [[calibration]] tables and "
            f"nothing else, got {', '.join(map(cut, tables)) or 'nothing'}"
        )
    document["calibration"] = tables["calibration"]


def _completed(document: dict[str, Any]) -> dict[str, Any]:
    """Return tables whose ``islands`` have all keys of the sections that they name."""
    islands = [
        {
            key: {**document.get(key, {}), **own} if isinstance(own, dict) else own
            for key, own in each.items()
        }
        for each in document.get("islands", ())
    ]
    return {**document, "islands": islands} if islands else document


def experiment_text(experiment: Experiment) -> str:
    """Return an experiment as one line of JSON with all defaults."""
    return msgspec.json.encode(experiment).decode()


def experiment_from_text(text: str) -> Experiment:
    """Return the experiment that ``experiment_text`` wrote.

    Raises:
        ExperimentError: another text.
    """
    try:
        return msgspec.json.decode(text.encode(), type=Experiment)
    # A UnicodeError is a ValueError: an escape may be half a character.
    except (ValueError, RecursionError) as error:
        raise ExperimentError(f"experiment of a run: {error}") from None


def _refuse_unknown(
    document: dict[str, Any], kind: type[Struct], where: str, prefix: str
) -> None:
    """Raise for an unknown key or a number that is not finite."""
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    for key, value in document.items():
        if key not in fields:
            own = f"; those of a plug-in are in [{prefix}parameters]"
            raise ExperimentError(
                f"{where}: {prefix}{cut(key)}: no such key{nearest(key, fields)}; "
                f"allowed: {', '.join(fields)}{own if 'parameters' in fields else ''}"
            )
        for number in value if isinstance(value, list) else (value,):
            if isinstance(number, float) and not isfinite(number):
                raise ExperimentError(
                    f"{where}: {prefix}{key}: must be finite, got {number}"
                )
        inner = _section(fields[key].type)
        if inner is None:
            continue
        if key in _LISTS and isinstance(value, dict):
            raise ExperimentError(f"{where}: {key}: must be [[{key}]], got [{key}]")
        if key in _LISTS and isinstance(value, list):
            tables = {f"{prefix}{key}[{at}]": each for at, each in enumerate(value)}
        else:
            tables = {f"{prefix}{key}": value}
        for name, table in tables.items():
            if not isinstance(table, dict):
                raise ExperimentError(f"{where}: {name}: must be a table")
            _refuse_unknown(table, inner, where, f"{name}.")


def _section(kind: Any) -> type[Struct] | None:  # noqa: ANN401 - any annotation
    """Return the section type of an annotation; None if it is a plain value."""
    for each in (kind, *get_args(kind)):
        if isinstance(each, type) and issubclass(each, Struct):
            return each
    return None


def _explain(error: msgspec.ValidationError, document: dict[str, Any]) -> str:
    """Return the message of msgspec as ``key: expected, got value``."""
    message, _, path = str(error).partition(" - at `$.")
    key = path.rstrip("`")
    value: Any = document
    kind: Any = Experiment
    for name in key.split(".") if key else ():
        word, *places = name.replace("]", "").split("[")
        value = value.get(word) if isinstance(value, dict) else None
        kind = _type_of(kind, word)
        for place in places:
            value = value[int(place)] if isinstance(value, list) else None
    message = expectation(message)
    if not key:
        return message
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    if not choices:
        return f"{key}: {message.partition(', got ')[0]}, got {shown(value)}"
    allowed = ", ".join(map(repr, choices))
    return (
        f"{key}: must be one of {allowed}, got {shown(value)}{nearest(value, choices)}"
    )


def _type_of(kind: Any, key: str) -> Any:  # noqa: ANN401 - any annotation
    """Return the annotation of a key of a section, given the section's own."""
    section = _section(kind)
    fields = msgspec.structs.fields(section) if section else ()
    return next((field.type for field in fields if field.name == key), None)
