"""Reads what runs left behind: finished, unfinished, damaged or of another version.

What can be read is read. What cannot is named, with its folder and the reason.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow.parquet import read_schema

from schema.errors import RunFolderError
from schema.tables.columns import TABLES, VERSION
from schema.tables.files import FINISHED, has_rows, read_table

TABLE = "table "
"""How what was left out starts if it is a table, before its name."""

_DETAILS = "run.json"
_STATE = "state"
_NEEDED = (
    "births", "evaluations", "population", "fitness", "deaths", "touches", "migrations"
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What could not be read or measured: whose, what, why."""

    folder: str
    what: str
    why: str


@dataclass(frozen=True, slots=True)
class Settings:
    """What an analysis asks of an island's settings."""

    births: int
    is_online: bool
    records_touches: bool


@dataclass(frozen=True, slots=True)
class Run:
    """A run that was found.

    Attributes:
        folder: where.
        experiment: its name.
        number: of the repeat.
        seed: of the run.
        state: finished, stopped or running, which may have died since.
        document: the experiment, as JSON.
        islands: settings of each island.
        differs: how, if the name is not its own: others have it, with other settings.
    """

    folder: Path
    experiment: str
    number: int
    seed: int
    state: str
    document: str
    islands: tuple[Settings, ...]
    differs: str = ""

    @property
    def is_finished(self) -> bool:
        """Whether all its births are there."""
        return self.state == "finished"


def read_runs(roots: Iterable[Path]) -> tuple[list[Run], list[LeftOut]]:
    """Return the runs at or below some folders, by path, and what is no run.

    Two folders that hold the same run (experiment, repeat, seed, settings) count as
    one: the one of which most tables can be read; of several the finished, else the
    longest, else the first.

    Raises:
        RunFolderError: a folder that is not there, or no run in any of them that can
            be read.
    """
    folders: set[Path] = set()
    for root in roots:
        if not root.is_dir():
            raise RunFolderError(f"{root}: no such folder")
        folders |= {path.parent for path in root.glob(f"**/{_DETAILS}")}
        finished = root.glob(f"**/{FINISHED}/experiment=*/run=*")
        folders |= {path.parents[2] for path in finished}
    if not folders:
        names = ", ".join(map(str, roots))
        raise RunFolderError(f"{names}: no run is there or below")
    runs: list[Run] = []
    left_out: list[LeftOut] = []
    for folder in sorted(folders):
        try:
            runs.append(_read_run(folder))
        except RunFolderError as error:
            left_out.append(LeftOut(str(folder), "run", str(error)))
    if not runs:
        first = left_out[0]
        raise RunFolderError(f"no run can be read: {first.folder}: {first.why}")
    return _different(runs, left_out), left_out


def _different(runs: list[Run], left_out: list[LeftOut]) -> list[Run]:
    """Return runs, each once; add to ``left_out`` the others."""
    copies: dict[tuple[str, int, int, str], list[Run]] = {}
    for run in runs:
        name = (run.experiment, run.number, run.seed, run.document)
        copies.setdefault(name, []).append(run)
    kept = []
    for group in copies.values():
        if len(group) == 1:  # nothing to choose: its tables are not read yet
            kept += group
            continue
        (_, best), *others = sorted(
            ((_flaws(run), run) for run in group),
            key=lambda one: (one[0], one[1].folder),
        )
        kept.append(best)
        for (unread, *_), run in others:
            broken = ", and not all of it can be read" if unread else ""
            why = f"the same run as {best.folder}{broken}"
            left_out.append(LeftOut(str(run.folder), "run", why))
    return sorted(kept, key=lambda run: run.folder)


def _flaws(run: Run) -> tuple[int, bool, int]:
    """Return what of several copies the best has least of, the gravest first."""
    tables, unread = read_tables(run)
    return len(unread), not run.is_finished, -tables["births"].num_rows


def _read_run(folder: Path) -> Run:
    details = _details(folder)
    try:
        document = json.loads(details["document"])
        islands = tuple(_settings(document))
        name, number, seed = details["name"], details["run"], details["seed"]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        story = f"{type(error).__name__}: {error}"
        raise RunFolderError(f"{_DETAILS}: cannot be understood: {story}") from None
    run = Run(
        folder=folder,
        experiment=str(name),
        number=int(number),
        seed=int(seed),
        state=_state(folder, details),
        document=str(details["document"]),
        islands=islands,
    )
    if run.is_finished and not any(has_rows(folder, each) for each in TABLES):
        raise RunFolderError("is finished, but its tables are gone: none is there")
    return run


def _details(folder: Path) -> dict[str, Any]:
    """Return what is run in a folder: from its own file, or else from its tables."""
    try:
        entries = json.loads((folder / _DETAILS).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        try:
            rows = read_table(folder, "runs").to_pylist()
        except RunFolderError:
            rows = []
        if not rows:
            raise RunFolderError(f"{_DETAILS}: cannot be read: {error}") from None
        return dict(rows[0])
    if not isinstance(entries, dict):
        raise RunFolderError(f"{_DETAILS}: must be an object")
    return entries


def _state(folder: Path, details: dict[str, Any]) -> str:
    try:
        return (folder / _STATE).read_text(encoding="utf-8").strip()
    except (OSError, ValueError):
        return str(details.get("state", "running"))


def _settings(document: dict[str, Any]) -> Iterable[Settings]:
    """Yield each island's settings; older documents do not know of islands."""
    for entry in document.get("islands") or [{}]:
        arena = entry.get("arena") or document.get("arena")
        births = int(entry.get("births") or document["births"])
        touches = bool(arena and arena.get("record_touches"))
        for _ in range(int(entry.get("count", 1))):
            yield Settings(births, arena is not None, touches)


def read_tables(run: Run) -> tuple[dict[str, pa.Table], list[LeftOut]]:
    """Return the tables of a run that its measures are made of.

    Args:
        run: which.

    Returns:
        Tables by name; one that cannot be read is empty, and named in the list. One
        that such a run has no rows for may be lacking: it is empty, too.
        ``birth_island`` says of everybody where it was born, and ``is_online`` in
        ``population`` whether it lives in an arena.
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
    online = np.array([island.is_online for island in run.islands], np.bool_)
    islands = np.asarray(tables["population"]["island"], np.int64)
    # An island that the document does not know of is like the last that it does.
    here = online[np.minimum(islands, len(online) - 1)]
    tables["population"] = tables["population"].append_column("is_online", [here])
    return tables, left_out


def _named(table: pa.Table) -> pa.Table:
    """Return a table that names everybody by where it was born, natives too."""
    if "birth_island" not in table.column_names:
        return table
    index = table.schema.get_field_index("birth_island")
    full = pc.coalesce(table["birth_island"], table["island"])
    return table.set_column(index, "birth_island", full)


def _check_there(run: Run, name: str) -> None:
    """Raise if a finished run has lost a table: no rows would be taken for none."""
    online = [island.is_online for island in run.islands]
    expected = {
        "evaluations": not all(online),
        "fitness": any(online),
        "deaths": any(online),
        "touches": any(island.records_touches for island in run.islands),
        "migrations": len(run.islands) > 1,
    }
    is_expected = run.is_finished and expected.get(name, True)
    if is_expected and not has_rows(run.folder, name):
        raise RunFolderError("is not there, though the run is finished")


def _check_version(folder: Path, name: str) -> None:
    """Raise if a finished table is of another version than ours."""
    for path in (folder / FINISHED).glob(f"*/*/{name}.parquet"):
        metadata = read_schema(path).metadata or {}
        version = metadata.get(b"revolve.schema_version", b"none").decode()
        if version != str(VERSION):
            raise RunFolderError(
                f"is of version {version}, and this program reads {VERSION}: read it "
                "with the one that wrote it"
            )
