"""Reads run folders: finished, unfinished, damaged or of another version.

Everything readable is read; everything else is reported with its folder and the reason.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from msgspec import structs
from pyarrow.parquet import read_schema

from schema.errors import ExperimentError, RunFolderError
from schema.experiment.document import Experiment, SelectionSection, island_experiments
from schema.experiment.file import experiment_from_text, experiment_text
from schema.experiment.fitness_keys import fitness_text
from schema.plugins.source import modules_named
from schema.tables.columns import TABLES, VERSION
from schema.tables.description import DETAILS, STATE, read_description, read_state
from schema.tables.files import finished_path, has_rows, is_sealed, read_table
from schema.tables.learnt import with_learnt
from schema.tables.segments import FINISHED, warn_once

TABLE = "table "
"""Prefix of the name of a table that was left out."""

_FOUNDERS = SelectionSection().population
_NEEDED = (
    "births", "evaluations", "population", "fitness", "deaths", "touches",
    "migrations", "learning",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something that could not be read, measured or drawn."""

    folder: str
    what: str
    why: str


@dataclass(frozen=True, slots=True)
class IslandSettings:
    """Settings of an island that an analysis needs.

    Attributes:
        births: on the island.
        is_online: it is an arena.
        records_touches: it records which robots touch.
        learns: its robots learn.
        founders: size of its first population.
        reevaluation: how re-evaluations of its robots count, ``replace`` or ``mean``;
            empty if there are none.
    """

    births: int
    is_online: bool
    records_touches: bool
    learns: bool = False
    founders: int = _FOUNDERS
    reevaluation: str = ""


def island_settings(island: int, islands: Sequence[IslandSettings]) -> IslandSettings:
    """Return the settings of an island; the last ones if it is not in the document.

    Args:
        island: number of the island.
        islands: settings of the islands of the document.
    """
    return islands[min(island, len(islands) - 1)]


@dataclass(frozen=True, slots=True)
class LoadedRun:
    """A run folder.

    Attributes:
        folder: path of the folder.
        experiment: name of the experiment; that of a sweep for all its runs.
        number: number of the repeat.
        seed: seed of the run.
        state: finished, stopped or running (also if it was killed).
        document: the experiment as JSON.
        islands: settings of each island.
        differs: settings that differ from other runs of the same experiment name, or
            from those of the first experiment.
        measures: of robots, as the experiment names them.
        function: fitness function; empty if the document does not name one.
        fitness: fitness functions as ``fitness_text``, with digests of their sources.
        plugins: digest of the source of each plug-in, by module; "unknown" for runs
            that did not record it.
        point: values of the swept settings, by dotted key; empty without a sweep.
    """

    folder: Path
    experiment: str
    number: int
    seed: int
    state: str
    document: str
    islands: tuple[IslandSettings, ...]
    differs: str = ""
    measures: tuple[str, ...] = ()
    function: str = ""
    fitness: str = ""
    plugins: Mapping[str, str] = field(default_factory=dict)
    point: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_finished(self) -> bool:
        """Whether the run is finished."""
        return self.state == "finished"


def read_runs(roots: Iterable[Path]) -> tuple[list[LoadedRun], list[LeftOut]]:
    """Return the runs in or below some folders, by path, and what was left out.

    Of several folders with the same run (experiment, repeat, seed, settings, sources
    of plug-ins) one is kept: that with the most readable tables, then the finished
    one, then the longest, then the first. The number of planned births may differ:
    the shorter of two such runs is the beginning of the longer one.

    Raises:
        RunFolderError: a folder does not exist, or no readable run is found.
    """
    folders: set[Path] = set()
    for root in roots:
        if not root.is_dir():
            raise RunFolderError(f"{root}: no such folder")
        folders |= {path.parent for path in root.glob(f"**/{DETAILS}")}
        finished = root.glob(f"**/{FINISHED}/experiment=*/run=*")
        folders |= {path.parents[2] for path in finished}
    if not folders:
        names = ", ".join(map(str, roots))
        raise RunFolderError(f"{names}: no run in or below this folder")
    runs: list[LoadedRun] = []
    left_out: list[LeftOut] = []
    for folder in sorted(folders):
        try:
            runs.append(read_run(folder))
        except RunFolderError as error:
            left_out.append(
                LeftOut(str(folder), "run", str(error).removeprefix(f"{folder}/"))
            )
    if not runs:
        first = left_out[0]
        raise RunFolderError(f"no run can be read: {first.folder}: {first.why}")
    return _different(runs, left_out), left_out


def _different(runs: list[LoadedRun], left_out: list[LeftOut]) -> list[LoadedRun]:
    """Return each run once; add its other folders to ``left_out``.

    Args:
        runs: sorted by folder.
        left_out: what was left out.
    """
    copies: dict[tuple[object, ...], list[LoadedRun]] = {}
    for run in runs:
        sources = tuple(run.plugins.items())
        settings = _without_births(run.document)
        name = (run.experiment, run.number, run.seed, settings, sources)
        copies.setdefault(name, []).append(run)
    kept = []
    for group in copies.values():
        # The tables of a run in only one folder are not read here.
        best, *others = sorted(group, key=_flaws) if len(group) > 1 else group
        kept.append(best)
        for run in others:
            damaged = ", and not completely readable" if _flaws(run)[0] else ""
            same = "the same run as" if run.document == best.document else "part of"
            why = f"{same} {best.folder}{damaged}"
            left_out.append(LeftOut(str(run.folder), "run", why))
    return sorted(kept, key=lambda run: run.folder)


def _without_births(document: str) -> str:
    """Return a document without numbers of planned births."""
    experiment = experiment_from_text(document)
    islands = tuple(structs.replace(each, births=None) for each in experiment.islands)
    return experiment_text(structs.replace(experiment, births=1, islands=islands))


def _flaws(run: LoadedRun) -> tuple[int, bool, int]:
    """Return the sort key of folders of the same run, the best first."""
    tables, unread = read_tables(run)
    return len(unread), not run.is_finished, -tables["births"].num_rows


def read_run(folder: Path) -> LoadedRun:
    """Return the run in a folder.

    Raises:
        RunFolderError: the folder has no run, or not the tables of a finished one.
    """
    details = _details(folder)
    try:
        settings = experiment_from_text(details["document"])
    except ExperimentError as error:
        raise RunFolderError(f"{DETAILS}: cannot be read: {error}") from None
    plugins = _plugins(details)
    point = settings.sweep.chosen if settings.sweep else {}
    run = LoadedRun(
        folder=folder,
        experiment=_experiment(details["name"], point),
        number=details["run"],
        seed=details["seed"],
        state=_state(folder, details),
        document=details["document"],
        islands=tuple(map(_settings, island_experiments(settings))),
        measures=settings.measures.names,
        function=settings.fitness.function,
        fitness=fitness_text(settings, plugins),
        plugins=plugins,
        point=point,
    )
    if run.is_finished and not any(has_rows(folder, each) for each in TABLES):
        raise RunFolderError("the run is finished, but its tables are missing")
    return run


def _experiment(name: str, point: Mapping[str, Any]) -> str:
    """Return the name of an experiment, or of the sweep that a run is a point of.

    Points with different settings of fitness are different experiments, as their
    fitness cannot be compared.

    Args:
        name: in the document; of a point, that of the sweep, a hyphen and a number.
        point: settings that the sweep chose; empty if there is no sweep.
    """
    if not point:
        return name
    chosen = [
        # Without spaces, as names of experiments are.
        f"{key.rpartition('.')[2]}={''.join(str(value).split())}"
        for key, value in point.items()
        if key.startswith("fitness.")
    ]
    return "-".join([name.rpartition("-")[0], *chosen])


def _details(folder: Path) -> dict[str, Any]:
    """Return the description of a run: from ``run.json``, or else from its tables."""
    try:
        return structs.asdict(read_description(folder))
    except RunFolderError as error:
        try:
            rows = read_table(folder, "runs").to_pylist()
        except RunFolderError:
            rows = []
        if not rows:
            raise
        warn_once(f"{error}; using its row in the table runs")
        return dict(rows[0])


def _plugins(details: dict[str, Any]) -> dict[str, str]:
    """Return the digest of the source of each plug-in of a run, by module."""
    known = details.get("plugins") or {}
    names = modules_named(details["document"].encode())
    return {name: known[name].digest if name in known else "unknown" for name in names}


def _state(folder: Path, details: dict[str, Any]) -> str:
    """Return a run's state; that of a run without the file is in its table."""
    if not (folder / STATE).exists():
        return str(details.get("state", "running"))
    try:
        state = read_state(folder)
        is_true = state != "finished" or is_sealed(folder)
    except RunFolderError as error:
        warn_once(f"{error}; the run counts as unfinished")
        return "stopped"
    if not is_true:
        warn_once(f"{folder / STATE}: damaged: is {state!r}, but the tables are not")
        return "stopped"
    return state


def _settings(island: Experiment) -> IslandSettings:
    """Return what an analysis needs of the settings of an island."""
    arena, again = island.arena, island.selection.reevaluation
    return IslandSettings(
        births=island.births,
        is_online=arena is not None,
        records_touches=arena is not None and arena.record_touches,
        learns=island.learning is not None,
        founders=island.selection.population,
        reevaluation="" if again is None else again.fitness,
    )


def read_tables(run: LoadedRun) -> tuple[dict[str, pa.Table], list[LeftOut]]:
    """Return the tables of a run that its measures need.

    Args:
        run: the run.

    Returns:
        Tables by name, and the tables that could not be read. An unreadable table, or
        one that such a run does not have, is empty. ``births`` has robots with the
        brains that they have learnt, ``birth_island`` is never null,
        and ``population`` has ``is_online``: whether the individual lives in an arena.
    """
    tables: dict[str, pa.Table] = {}
    left_out: list[LeftOut] = []
    for name in _NEEDED:
        try:
            _check_there(run, name)
            _check_version(run.folder, name)
            tables[name] = _named(read_table(run.folder, name))
        except (RunFolderError, pa.ArrowException, OSError) as error:
            tables[name] = _named(TABLES[name].empty_table())
            left_out.append(LeftOut(str(run.folder), TABLE + name, str(error)))
    tables["births"] = with_learnt(tables["births"], tables["learning"])
    online = np.array([island.is_online for island in run.islands], np.bool_)
    islands = np.asarray(tables["population"]["island"], np.int64)
    # An island that is not in the document has the settings of the last one.
    here = online[np.minimum(islands, len(online) - 1)]
    tables["population"] = tables["population"].append_column("is_online", [here])
    return tables, left_out


def read_duration_s(folder: Path) -> float | None:
    """Return the time from a run's start to its end [s]; None if not recorded."""
    try:
        rows = read_table(folder, "runs", ["start", "end"]).to_pylist()
    except (RunFolderError, pa.ArrowException, OSError):
        return None
    start, end = (rows[0]["start"], rows[0]["end"]) if rows else (None, None)
    return None if start is None or end is None else (end - start).total_seconds()


def _named(table: pa.Table) -> pa.Table:
    """Return a table with the island of birth filled in, also for natives."""
    if "birth_island" not in table.column_names:
        return table
    index = table.schema.get_field_index("birth_island")
    full = pc.coalesce(table["birth_island"], table["island"])
    return table.set_column(index, "birth_island", full)


def _check_there(run: LoadedRun, name: str) -> None:
    """Raise if a table of a finished run is missing."""
    online = [island.is_online for island in run.islands]
    expected = {
        "evaluations": not all(online),
        "fitness": any(online),
        "deaths": any(online),
        "touches": any(island.records_touches for island in run.islands),
        "migrations": len(run.islands) > 1,
        "learning": any(island.learns for island in run.islands),
    }
    is_expected = run.is_finished and expected.get(name, True)
    if is_expected and not has_rows(run.folder, name):
        raise RunFolderError("missing, although the run is finished")


def _check_version(folder: Path, name: str) -> None:
    """Raise if a finished table has another schema version than this program."""
    if path := finished_path(folder, name):
        metadata = read_schema(path).metadata or {}
        version = metadata.get(b"revolve.schema_version", b"none").decode()
        if version != str(VERSION):
            raise RunFolderError(
                f"has version {version}, but this program reads version {VERSION}; "
                "use the release that wrote it"
            )
