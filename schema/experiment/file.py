"""The way in for experiments: TOML of users, and JSON that run folders hold."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from schema.errors import ExperimentError, shown
from schema.experiment.check import check_experiment
from schema.experiment.document import Experiment, island_experiments, references
from schema.experiment.sources import parse_toml, source_text
from schema.experiment.sweep import Point, sweep_points, sweep_problems, with_point
from schema.experiment.tables import Tables, converted, known_keys
from schema.plugins.permission import allow_references


class Draft(NamedTuple):
    """Experiments of a document before the checks across their keys.

    No plug-in is imported, so that plug-ins can be checked in another process first.

    Attributes:
        experiments: one, or those of the document's sweep.
        where: path of the document, for messages.
    """

    experiments: tuple[Experiment, ...]
    where: str

    @property
    def references(self) -> list[str]:
        """The ``module:attribute`` that the experiments name, each once."""
        named = [path for each in self.experiments for path in references(each)]
        return list(dict.fromkeys(named))

    def allowed(self) -> tuple[Experiment, ...]:
        """Return the experiments; this process may import what they name.

        Raises:
            ExperimentError: a file beside the document has the name of another module.
        """
        allow_references(self.references, Path(self.where).parent)
        return self.experiments

    def checked(self) -> tuple[Experiment, ...]:
        """Return the experiments after the checks across their keys.

        Raises:
            ExperimentError: inconsistent values, at any point of the sweep.
        """
        for experiment in self.allowed():
            with _at_point(experiment.sweep.chosen if experiment.sweep else {}):
                check_experiment(experiment, self.where)
        return self.experiments


def read_draft(
    source: str | Tables, births: int | None = None, where: str = ""
) -> Draft:
    """Return the experiments of a document.

    Args:
        source: a shipped name such as ``scenario1``, a path that ends in ``.toml``, or
            the tables of a TOML text, which are not changed.
        births: of ``--births``, in place of those of the document.
        where: path of the text whose tables are given.

    Raises:
        ExperimentError: no such experiment or file; an unknown key (the nearest is
            named); a value of a wrong type or outside its range; a wrong sweep.
    """
    if isinstance(source, str):
        text, where = source_text(source)
        tables = parse_toml(text, where)
    else:
        tables = deepcopy(source)
    place = where
    if births is not None:
        place = f"{where} with --births {births}"
        tables = _with_births(tables, births)
    whole = converted(tables, where)
    if whole.sweep is None:
        return Draft((whole,), place)
    if problem := next(sweep_problems(whole.sweep), ""):
        raise ExperimentError(f"{where}: {problem}")
    if whole.sweep.chosen:
        return Draft((whole,), place)
    if births is not None and "births" in whole.sweep.settings:
        raise ExperimentError(f"{where}: --births: the sweep changes births itself")
    return Draft(_swept(whole, tables, where), place)


def read_experiment(source: str | Tables, where: str = "") -> Experiment:
    """Return the checked experiment of a document that is no sweep.

    The modules that it names may be imported by this process from now on.

    Args:
        source: as for ``read_draft``.
        where: as for ``read_draft``.

    Raises:
        ExperimentError: as of ``read_draft`` and ``Draft.checked``; a sweep.
    """
    draft = read_draft(source, where=where)
    first = draft.experiments[0]
    if first.sweep is not None and len(draft.experiments) > 1:
        raise ExperimentError(
            f"{draft.where}: sweep: stands for several experiments; only revolve run "
            "and revolve check take all of them"
        )
    return draft.checked()[0]


def experiment_text(experiment: Experiment) -> str:
    """Return an experiment as one line of JSON with all defaults."""
    return msgspec.json.encode(experiment).decode()


def experiment_from_text(
    text: str, *, is_own: bool = False, is_resumed: bool = False
) -> Experiment:
    """Return the experiment that ``experiment_text`` wrote, in any version.

    Args:
        text: of a run folder or a message.
        is_own: the user named the folder: installed modules that the experiment names
            may be imported by this process from now on.
        is_resumed: the run goes on: all its keys must be known. Otherwise keys that
            no longer exist are left out.

    Raises:
        ExperimentError: another text.
    """
    experiment = _stored(text, is_resumed=is_resumed)
    if is_own:
        allow_references(references(experiment))
    return experiment


@lru_cache(maxsize=256)
def _stored(text: str, *, is_resumed: bool) -> Experiment:
    try:
        tables = msgspec.json.decode(text.encode())
        known = tables if is_resumed else known_keys(tables, Experiment)
        return msgspec.convert(known, Experiment)
    # A UnicodeError is a ValueError: an escape may be half a character.
    except (ValueError, RecursionError) as error:
        raise ExperimentError(f"experiment of a run: {error}") from None


def _with_births(tables: Tables, births: int) -> Tables:
    """Return tables in which all islands have another number of births."""
    changed = {**tables, "births": births}
    if isinstance(islands := tables.get("islands"), list):
        changed["islands"] = [
            {key: value for key, value in each.items() if key != "births"}
            if isinstance(each, Mapping)
            else each
            for each in islands
        ]
    return changed


def _swept(whole: Experiment, tables: Tables, where: str) -> tuple[Experiment, ...]:
    """Return the experiments of a sweep."""
    assert whole.sweep is not None
    try:
        points = sweep_points(whole.sweep)
    except ExperimentError as error:
        raise ExperimentError(f"{where}: {error}") from None
    width = len(str(len(points) - 1))
    experiments = []
    for number, point in enumerate(points):
        with _at_point(point):
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
def _at_point(point: Point) -> Iterator[None]:
    """Add the values of a sweep's point to the message of an error."""
    try:
        yield
    except ExperimentError as error:
        if not point:
            raise
        values = ", ".join(f"{key} = {shown(value)}" for key, value in point.items())
        raise ExperimentError(f"{error}; in the sweep at {values}") from error
