"""Reads run folders: finished, unfinished, damaged or of another version.

Everything readable is read; everything else is reported with its folder and the reason.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from msgspec import structs
from pyarrow.parquet import read_schema

from schema.errors import ExperimentError, RunFolderError
from schema.experiment.document import Experiment, island_experiments
from schema.experiment.file import experiment_from_text, experiment_text
from schema.experiment.fitness_keys import fitness_text
from schema.experiment.identity import WHOLE
from schema.plugins.source import modules_named
from schema.tables.columns import TABLES, VERSION
from schema.tables.description import (
    DETAILS,
    STATE,
    check_folder,
    groups_of,
    read_description,
    read_state,
)
from schema.tables.files import finished_path, has_rows, is_sealed, read_table
from schema.tables.learnt import with_learnt
from schema.tables.segments import FINISHED, warn_once

TABLE = "table "
"""Prefix of the name of a table that was left out."""

_NEEDED = (
    "births", "evaluations", "population", "fitness", "deaths", "touches",
    "migrations", "learning", "matings", "patches",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something that could not be read, measured or drawn."""

    folder: str
    what: str
    why: str


def island_settings(island: int, islands: Sequence[Experiment]) -> Experiment:
    """Return an island's settings; the last ones if it is not in the document."""
    return islands[min(island, len(islands) - 1)]


def has_rules(island: Experiment) -> bool:
    """Return whether an island is an arena with other rules than the thesis's."""
    return island.arena is not None and island.arena.rules != "thesis"


def records_touches(island: Experiment) -> bool:
    """Return whether an island is an arena that records which robots touch."""
    return island.arena is not None and island.arena.record_touches


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
        settings: the experiment.
        differs: settings that differ from other runs of the same experiment name, or
            from those of the first experiment.
        fitness: fitness functions as ``fitness_text``, with digests of their sources.
        plugins: digest of the source of each plug-in, by module; "unknown" for runs
            that did not record it.
    """

    folder: Path
    experiment: str
    number: int
    seed: int
    state: str
    document: str
    settings: Experiment
    differs: str = ""
    fitness: str = ""
    plugins: Mapping[str, str] = field(default_factory=dict)

    @property
    def islands(self) -> tuple[Experiment, ...]:
        """Settings of each island."""
        return island_experiments(self.settings)

    @property
    def point(self) -> Mapping[str, Any]:
        """Values of the swept settings, by dotted key; empty without a sweep."""
        return self.settings.sweep.chosen if self.settings.sweep else {}

    @property
    def is_finished(self) -> bool:
        """Whether the run is finished."""
        return self.state == "finished"


def read_runs(roots: Iterable[Path]) -> tuple[list[LoadedRun], list[LeftOut]]:
    """Return the runs in or below some folders, by path, and what was left out.

    All groups of islands of an archipelago are one run, that of the folder above them.

    Of several folders with the same run (experiment, repeat, seed, settings, sources
    of plug-ins) one is kept: that with the most readable tables, then the finished
    one, then the longest, then the first. The number of planned births may differ:
    the shorter of two such runs is the beginning of the longer one.

    Raises:
        RunFolderError: a folder does not exist, or no readable run is found.
    """
    folders: set[Path] = set()
    for root in roots:
        check_folder(root)
        folders |= {path.parent for path in root.glob(f"**/{DETAILS}")}
        finished = root.glob(f"**/{FINISHED}/experiment=*/run=*")
        folders |= {path.parents[2] for path in finished}
    if not folders:
        names = ", ".join(map(str, roots))
        raise RunFolderError(f"{names}: no run in or below this folder")
    runs: list[LoadedRun] = []
    left_out: list[LeftOut] = []
    for folder in sorted({*map(_whole, folders)}):
        try:
            runs.append(read_run(folder))
        except RunFolderError as error:
            why = str(error).removeprefix(str(folder)).lstrip("/: ")
            left_out.append(LeftOut(str(folder), "run", why))
    if not runs:
        first = left_out[0]
        raise RunFolderError(f"no run can be read: {first.folder}: {first.why}")
    return _different(runs, left_out), left_out


def _whole(folder: Path) -> Path:
    """Return the folder that holds a group and all others, or else a run's own."""
    try:
        return folder if read_description(folder).group == WHOLE else folder.parent
    except RunFolderError:
        return folder  # ``read_run`` says why


def _different(runs: list[LoadedRun], left_out: list[LeftOut]) -> list[LoadedRun]:
    """Return each of the sorted runs once; add its other folders to ``left_out``."""
    copies: dict[tuple[object, ...], list[LoadedRun]] = {}
    for run in runs:
        sources = tuple(run.plugins.items())
        settings = _without_births(run.settings)
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


def _without_births(experiment: Experiment) -> str:
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
        raise RunFolderError(f"{folder / DETAILS}: cannot be read: {error}") from None
    plugins = _plugins(details)
    run = LoadedRun(
        folder=folder,
        experiment=details["name"],
        number=details["run"],
        seed=details["seed"],
        state=_state(folder, details),
        document=details["document"],
        settings=settings,
        fitness=fitness_text(settings, plugins),
        plugins=plugins,
    )
    if run.is_finished and not any(has_rows(folder, each) for each in TABLES):
        why = "the run is finished, but its tables are missing"
        raise RunFolderError(f"{folder}: {why}")
    return replace(run, experiment=_swept(run)) if run.point else run


def _swept(run: LoadedRun) -> str:
    """Return the name of the sweep that a run is a point of.

    Points with different settings of fitness are different experiments, as their
    fitness cannot be compared. The document names the sweep, a hyphen and a number.
    """
    chosen = [
        # Without spaces, as names of experiments are.
        f"{key.rpartition('.')[2]}={''.join(str(value).split())}"
        for key, value in run.point.items()
        if key.startswith("fitness.")
    ]
    return "-".join([run.experiment.rpartition("-")[0], *chosen])


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
    known = details.get("plugins") or {}
    names = modules_named(details["document"].encode())
    return {name: known[name].digest if name in known else "unknown" for name in names}


def _state(folder: Path, details: dict[str, Any]) -> str:
    """Return a run's state; that of a run without the file is in its table."""
    if not ((folder / STATE).exists() or groups_of(folder)):
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


def read_tables(run: LoadedRun) -> tuple[dict[str, pa.Table], list[LeftOut]]:
    """Return the tables of a run that its measures need.

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
    online = np.array([island.arena is not None for island in run.islands])
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
    arenas = [island.arena is not None for island in run.islands]
    expected = {
        "evaluations": not all(arenas),
        "fitness": any(arenas),
        "deaths": any(arenas),
        "touches": any(map(records_touches, run.islands)),
        "migrations": len(run.islands) > 1,
        "learning": any(island.learning for island in run.islands),
        # Rules of an arena may have neither.
        "matings": False,
        "patches": False,
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
