"""The way in for experiments: TOML of users, and JSON that run folders hold."""

from collections.abc import Collection, Mapping
from copy import deepcopy
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import msgspec

from schema.errors import ExperimentError, near_files, nearest
from schema.experiment.check import check_experiment
from schema.experiment.document import Experiment, references
from schema.experiment.sweep import sweep_problems
from schema.experiment.tables import Tables, at_point, converted, swept
from schema.plugins.bounded import parse_toml, text_of
from schema.plugins.parameters import known_keys
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
            with at_point(experiment.sweep.chosen if experiment.sweep else {}):
                check_experiment(experiment, self.where)
        return self.experiments


def read_draft(
    source: str | Tables,
    births: int | None = None,
    where: str = "",
    run: str | None = None,
) -> Draft:
    """Return the experiments of a document.

    It is a shipped name such as ``scenario1``, a path that ends in ``.toml``, or the
    tables of a TOML text at ``where``, which are not changed. Births and run are those
    of ``--births`` and ``--from``, in place of the document's.

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
    if run is not None:
        known = tables.get("founders")
        changed = {"files": [], "genomes": [], "run": str(Path(run).absolute())}
        tables["founders"] = {
            **(known if isinstance(known, Mapping) else {}),
            **changed,
        }
    whole = converted(tables, where)
    if whole.sweep is None:
        return Draft((whole,), place)
    if problem := next(sweep_problems(whole.sweep), ""):
        raise ExperimentError(f"{where}: {problem}")
    if whole.sweep.chosen:
        return Draft((whole,), place)
    if births is not None and "births" in whole.sweep.settings:
        raise ExperimentError(f"{where}: --births: the sweep changes births itself")
    return Draft(swept(whole, tables, where), place)


def read_experiment(source: str | Tables, where: str = "") -> Experiment:
    """Return the checked experiment of a document that is no sweep.

    The modules that it names may be imported by this process from now on.

    Arguments as of ``read_draft``.

    Raises:
        ExperimentError: as of ``read_draft`` and ``Draft.checked``; a sweep.
    """
    draft = read_draft(source, where=where)
    first = draft.experiments[0]
    if first.sweep is not None and len(draft.experiments) > 1:
        why = "stands for several experiments: only revolve run and check take them"
        raise ExperimentError(f"{draft.where}: sweep: {why}")
    return draft.checked()[0]


def source_text(source: str) -> tuple[str, str]:
    """Return the TOML text of an experiment, and its path for ``parse_toml``.

    Raises:
        ExperimentError: no such experiment or file.
    """
    if source.endswith(".toml"):
        path = Path(source)
        is_shipped = path.stem in shipped_experiments()
        near = f"; did you mean {path.stem!r}, which is shipped?" * is_shipped
        return text_of(path, source, near), source
    check_source(source, shipped_experiments())
    folder = resources.files("schema.experiment") / "shipped"
    return (folder / f"{source}.toml").read_text(encoding="utf-8"), f"{source}.toml"


def check_source(source: str, shipped: Collection[str]) -> None:
    """Raise, with the nearest name, unless a source is a TOML path or ships."""
    if source.endswith(".toml") or source in shipped:
        return
    path, beside = Path(source), Path(f"{source}.toml")
    if path.is_dir():
        what = "an experiment is a .toml file or a shipped name"
        raise ExperimentError(f"{source}: is a folder; {what}")
    if path.is_file() or (path.suffix and not beside.is_file()):
        rule = f"the file of an experiment must end in .toml, got {path.suffix!r}"
        missing = f", and there is no such file{near_files(path, '*.toml')}"
        raise ExperimentError(f"{source}: {rule}{'' if path.is_file() else missing}")
    near = nearest(source, [*shipped, *([str(beside)] if beside.is_file() else ())])
    known = f"shipped are {', '.join(shipped)}, or give a path to a .toml file"
    raise ExperimentError(f"{source}: no such experiment{near}; {known}")


def shipped_experiments() -> list[str]:
    """Return the names of the experiments that come with the package."""
    folder = resources.files("schema.experiment") / "shipped"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def experiment_text(experiment: Experiment) -> str:
    """Return an experiment as one line of JSON with all defaults."""
    return msgspec.json.encode(experiment).decode()


def experiment_from_text(
    text: str, *, is_own: bool = False, is_resumed: bool = False
) -> Experiment:
    """Return the experiment that ``experiment_text`` wrote, in any version.

    ``is_own``: the user named the folder, so installed modules that the experiment
    names may be imported by this process from now on. ``is_resumed``: the run goes on,
    so all its keys must be known; otherwise keys that no longer exist are left out.

    Raises:
        ExperimentError: another text.
    """
    experiment = _stored(text, is_resumed=is_resumed)
    if is_own:
        allow_references(references(experiment))
    return experiment


def with_births(text: str, births: int, where: str) -> Experiment:
    """Return the experiment of a run with another number of births on each island.

    ``text`` is that of its folder, which ``where`` names in messages.

    Raises:
        ExperimentError: the number is not allowed, or a sweep changes it.
    """
    tables = _with_births(msgspec.json.decode(text.encode()), births)
    experiment = _stored(msgspec.json.encode(tables).decode(), is_resumed=True)
    if experiment.sweep is not None and "births" in experiment.sweep.settings:
        raise ExperimentError(f"{where}: --births: the sweep changes births itself")
    check_experiment(experiment, f"{where} with --births {births}")
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
