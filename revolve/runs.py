"""Runs as the Python API has them: start, resume and read them."""

import html
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from revolve.arguments import in_order, is_silent, whole_number
from revolve.children import run_command
from revolve.experiment import Experiment, document_of
from revolve.robot import Robot, as_experiment, of_plain, plain
from schema.agent.supervisor import most_processes
from schema.errors import RevolveError, RunFolderError, nearest, rounded, shown
from schema.experiment.document import (
    UNNAMED,
    island_experiment,
    island_experiments,
)
from schema.experiment.file import experiment_from_text
from schema.limits import MOST_SEED
from schema.plugins.permission import allowed
from schema.robot.archive import RobotOrigin
from schema.robot.ids import BirthId
from schema.tables.columns import TABLES
from schema.tables.description import (
    allow_plugins_of,
    read_description,
    read_state,
    run_columns,
)
from schema.tables.files import born_as, read_table
from schema.tables.last_populations import (
    Row,
    archive_at,
    best_ever,
    best_of,
    fittest,
    last_populations,
)
from schema.tables.learnt import with_learnt
from schema.wire.born import birth_point, robot_of_birth
from schema.wire.protobuf import encode_robot
from schema.wire.updates import individual, read_birth

Folder = str | Path

_OF_ROBOTS = ("island", "birth", "genome", "robot")
"""Columns of births that robots are made from, of any run."""


def _table(name: str) -> property:
    rows = TABLES[name].metadata[b"description"].decode()
    return property(lambda run: run.table(name), doc=f"Each row is {rows}.")


class Run:
    """A run folder: its description and its tables, as they are now.

    Each access reads the table from disk, so a run in progress can be watched.
    docs/tables.md has the columns. In a notebook a run shows a summary.

    Attributes:
        folder: path of the folder.
        name: of the experiment.
        number: of the repeat, from 0.
        seed: random seed.
        run_id: identifier, another for each run; a column of all tables, as ``seed``.
        experiment: all settings.
    """

    def __init__(self, folder: Folder) -> None:
        """Open a run folder for reading.

        Raises:
            RunFolderError: there is no run, or its description is damaged.
        """
        self.folder = Path(folder)
        details = read_description(self.folder)
        self.name, self.number, self.seed = details.name, details.run, details.seed
        self.run_id = run_columns(self.folder)["run_id"]
        document = experiment_from_text(details.document, is_own=True)
        self.experiment = Experiment(document)

    def __fspath__(self) -> str:
        return str(self.folder)

    @property
    def state(self) -> str:
        """``finished``, ``stopped``, or ``running`` (also after a kill)."""
        return read_state(self.folder)

    births = _table("births")
    evaluations = _table("evaluations")
    learning = _table("learning")
    population = _table("population")
    fitness = _table("fitness")
    poses = _table("poses")
    deaths = _table("deaths")
    touches = _table("touches")
    meetings = _table("meetings")
    matings = _table("matings")
    patches = _table("patches")
    migrations = _table("migrations")
    audits = _table("audits")
    drifts = _table("drifts")
    runs = _table("runs")

    def table(self, name: str) -> pa.Table:
        """Return a table.

        Args:
            name: such as ``births``.

        Raises:
            RunFolderError: the table is damaged or of another version, or no run has
                such a table; the nearest is named.
        """
        check_table(name)
        return read_table(self.folder, name)

    def robot(self, number: int, island: int = 0) -> Robot:
        """Return the robot of a birth.

        Its ``origin`` has its greatest fitness on the island where it was born.

        Args:
            number: of the birth on its island, from 0.
            island: where it was born.

        Raises:
            RunFolderError: there is no such birth.
            RevolveError: a number or an island that is no whole number >= 0.
        """
        birth = BirthId(whole_number("island", island), whole_number("number", number))
        judged = next(best_ever(self.folder, birth), {"fitness": None})
        return self._born(birth, island, judged["fitness"])

    def _born(self, birth: BirthId, home: int, fitness: float | None) -> Robot:
        """Return the robot of a birth, with its origin and one island's settings."""
        row = read_table(self.folder, "births", where=born_as(birth))
        if not row.num_rows:
            raise RunFolderError(
                f"{self.folder}: has no birth {birth.number} on island {birth.island}"
            )
        (robot,) = self._robots(row, [home])
        parents = read_birth(row.to_pylist()[0], 0).parents
        origin = RobotOrigin(str(self.run_id), birth, parents, fitness)
        return of_plain(plain(robot), robot.experiment, origin)

    def robots(self, births: pa.Table | None = None) -> list[Robot]:
        """Return the robots of some births, with the brains that they have learnt.

        Args:
            births: rows of the table ``births``; None: all of them.

        Raises:
            RunFolderError: the table is damaged.
            RevolveError: not a ``pyarrow.Table``, or without a column that is needed.
        """
        rows = self.births if births is None else births
        islands = island_experiments(document_of(self.experiment))
        needs_time = any(own.arena and own.changes for own in islands)
        _check_births(rows, (*_OF_ROBOTS, "sim_time_s") if needs_time else _OF_ROBOTS)
        return self._robots(rows, rows["island"].to_pylist())

    def _robots(self, births: pa.Table, homes: Sequence[int]) -> list[Robot]:
        """Return the robots of some births, with the settings of one island each.

        Settings that change have the values of the birth.
        """
        allow_plugins_of(self.folder)
        learning = read_table(self.folder, "learning", ["island", "birth", "robot"])
        rows = with_learnt(births, learning)
        documents = {
            island: island_experiment(document_of(self.experiment), island)
            for island in set(homes)
        }
        own = {island: Experiment(each) for island, each in documents.items()}
        # Only changes of an arena need the time.
        named = [name for name in rows.column_names if name in ("birth", "sim_time_s")]
        points = map(birth_point, rows.select(named).to_pylist())
        columns = (rows[name].to_pylist() for name in ("genome", "robot"))
        return [
            of_plain(
                robot_of_birth(genome, stored, documents[island]),
                own[island].at(point) if documents[island].changes else own[island],
            )
            for island, genome, stored, point in zip(
                homes, *columns, points, strict=True
            )
        ]

    def best(self, count: int = 1) -> list[Robot]:
        """Return the fittest robots of the last population, of all islands together.

        The first of a finished run is that of ``best.yaml``. Each has the settings of
        the island on which it had its fitness.

        Args:
            count: number of robots, >= 0; fewer if there are no more.

        Raises:
            RunFolderError: a table is damaged.
            RevolveError: another count.
        """
        return self._first(fittest(last_populations(self.folder)), count)

    def best_ever(self, count: int = 1) -> list[Robot]:
        """Return the fittest robots that were ever evaluated, as ``best`` does.

        They may be dead. Robots of arenas count with the best sample (table
        ``fitness``) while they were mature.
        """
        return self._first(best_ever(self.folder), count)

    def _first(self, rows: Iterable[Row], count: int) -> list[Robot]:
        most = whole_number("count", count)
        chosen: dict[BirthId, Row] = {}
        for row in rows:
            if len(chosen) == most:
                break
            chosen.setdefault(individual(row), row)
        return [
            self._born(birth, row["island"], row["fitness"])
            for birth, row in chosen.items()
        ]

    def archive(self, at: int | None = None) -> list[tuple[Row, Robot]]:
        """Return what the archives of all islands held, by island and entry.

        Args:
            at: births on each island at which to look; None: the last.

        Returns:
            Rows of the table ``archive``, with ``replaced_at``, and their robots.

        Raises:
            RunFolderError: a table is damaged.
            RevolveError: another number.
        """
        rows = archive_at(self.folder, None if at is None else whole_number("at", at))
        is_wanted = pc.field("birth").isin([row["birth"] for row in rows])
        table = read_table(self.folder, "births", where=is_wanted)
        places = {individual(row): at for at, row in enumerate(table.to_pylist())}
        born = table.take(
            pa.array([places[individual(row)] for row in rows], pa.int64())
        )
        robots = self._robots(born, [row["island"] for row in rows])
        return list(zip(rows, robots, strict=True))

    def __repr__(self) -> str:
        return f"<Run {self.name}, seed {self.seed}: {self.state}, {self.folder}>"

    def _repr_html_(self) -> str:
        """Return the summary that a notebook shows."""
        best = best_of(last_populations(self.folder))
        ever = next(best_ever(self.folder), None)
        document = document_of(self.experiment)
        born = read_table(self.folder, "births", ["record"]).num_rows
        planned = sum(own.births for own in island_experiments(document))
        rows: dict[str, Any] = {
            "folder": self.folder,
            "experiment": self.name,
            "repeat": self.number,
            "seed": self.seed,
            "state": self.state,
            "births": f"{born} of {planned}",
            "best of the last population": _named(best),
            "best ever": _named(ever),
        }
        cells = (
            f"<tr><th>{key}</th><td>{html.escape(str(value))}</td></tr>"
            for key, value in rows.items()
        )
        return f"<table>{''.join(cells)}</table>"


def _named(row: Row | None) -> str:
    return f"{individual(row).name}, fitness {rounded(row['fitness'])}" if row else "-"


def _check_births(rows: object, needed: Sequence[str]) -> None:
    """Raise unless an argument has rows of the table ``births``."""
    if not isinstance(rows, pa.Table):
        kind = type(rows).__name__
        raise RevolveError(f"births: must be a pyarrow.Table, got a {kind}")
    missing = [name for name in needed if name not in rows.column_names]
    if missing:
        raise RevolveError(
            "births: must be rows of the table births with the columns "
            f"{', '.join(needed)}, has no {', '.join(missing)}"
        )


def check_table(name: str, tables: Iterable[str] = tuple(TABLES)) -> None:
    """Raise ``RunFolderError`` unless a table is one of some; the nearest is named."""
    if name not in tables:
        near, allowed = nearest(str(name), tables), ", ".join(tables)
        raise RunFolderError(f"no table {shown(name)}{near}; tables: {allowed}")


def run(
    experiment: Experiment | Folder,
    *,
    seed: int = 0,
    births: int | None = None,
    founders: Run | Folder | Iterable[Robot | Folder] | None = None,
    out: Folder | None = None,
    workers: int | None = None,
    connect: str | None = None,
    plugins: Iterable[str] = (),
    progress: bool | None = None,
) -> Run:
    """Run an experiment to its end, as ``revolve run`` does, with the same births.

    Args:
        experiment: shipped name, path of a TOML file, or ``Experiment``.
        seed: random seed.
        births: number of births on each island; None: the experiment's.
        founders: a run, or its folder, whose last population the run starts from; or
            robots and robot files, in order; None: those of the experiment.
        out: run folder; None: ``runs/NAME-seedSEED``.
        workers: worker processes; None: one per core, or none with ``connect``. No
            result depends on it.
        connect: address of a hub whose workers do the work.
        plugins: modules or ``.py`` files that may be imported, beside those that the
            experiment names.
        progress: show progress on standard error, and the summary; None: in
            notebooks only.

    Raises:
        ExperimentError: an invalid experiment.
        RunFolderError: the folder is used, or the disk fails.
        NetworkError: no hub answers.
        RevolveError: the run stopped before its end; ``resume`` continues it.
        KeyboardInterrupt: after Ctrl-C; ``resume`` continues the run.
    """
    seed = whole_number("seed", seed, most=MOST_SEED)
    births = births if births is None else whole_number("births", births, 1)
    document = document_of(experiment)
    folder = Path(out or Path("runs") / f"{document.name}-seed{seed}")
    words = ["--seed", str(seed), "--out", str(folder)]
    for flag, value in (("--births", births), ("--connect", connect)):
        words += [] if value is None else [flag, str(value)]
    words += _common(workers, (*allowed(is_new=True), *plugins), progress=progress)
    with tempfile.TemporaryDirectory() as place:
        if founders is not None:
            given = _given(founders, Path(place))
            experiment = as_experiment(experiment).replace(founders=given)
        source = experiment
        if isinstance(experiment, Experiment):
            source = Path(place) / "experiment.toml"
            source.write_text(experiment.to_toml(), encoding="utf-8")
        return _done(("run", str(source), *words), folder, progress=progress)


def _given(
    founders: Run | Folder | Iterable[Robot | Folder], place: Path
) -> dict[str, Any]:
    """Return the keys of ``[founders]``; robots are written to files in a folder."""
    keys: dict[str, Any] = dict.fromkeys(("files", "run", "genomes"))
    if isinstance(founders, Run | str | Path):
        return keys | {"run": str(getattr(founders, "folder", founders))}
    files: list[str] = []
    for number, each in enumerate(in_order("founders", founders)):
        file = each
        if not isinstance(file, str | Path):
            file = place / f"{number}{UNNAMED}"
            file.write_bytes(encode_robot(plain(each)))
        files.append(str(file))
    return keys | {"files": files}


def resume(
    folder: Run | Folder,
    *,
    births: int | None = None,
    workers: int | None = None,
    plugins: Iterable[str] = (),
    progress: bool | None = None,
) -> Run:
    """Continue a run to its end, as ``revolve resume`` does.

    Args:
        folder: of the run; or the run.
        births: new number of births on each island, for finished runs, too: the run
            becomes equal to one that was begun with it; None: as begun.
        workers: as for ``run``.
        plugins: as for ``run``.
        progress: as for ``run``.

    Raises:
        RunFolderError: there is no run, another process has it, or it is damaged.
        RevolveError: as for ``run``.
        KeyboardInterrupt: as for ``run``.
    """
    read_description(Path(folder))
    words = _common(workers, plugins, progress=progress)
    if births is not None:
        words += ["--births", str(whole_number("births", births, 1))]
    return _done(("resume", str(folder), *words), Path(folder), progress=progress)


def _common(
    workers: int | None, plugins: Iterable[str], *, progress: bool | None
) -> list[str]:
    words = [word for entry in dict.fromkeys(plugins) for word in ("--plugins", entry)]
    if workers is not None:
        most = most_processes()
        words += ["--workers", str(whole_number("workers", workers, 0, most))]
    return [*words, "--quiet"] if is_silent(progress=progress) else words


def _done(words: tuple[str, ...], folder: Path, *, progress: bool | None) -> Run:
    run_command(words, is_quiet=is_silent(progress=progress))
    finished = Run(folder)
    if finished.state != "finished":
        raise RevolveError(f"{folder}: not finished: revolve.resume continues it")
    return finished
