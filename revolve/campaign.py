"""The runs of a folder, such as a campaign, as the Python API has them."""

from collections.abc import Iterator
from contextlib import suppress
from os import PathLike
from pathlib import Path

import pyarrow as pa

from analysis.measures.ancestry import phylogeny
from analysis.measures.load import LoadedRun, read_runs
from revolve.children import run_command
from revolve.runs import Folder, Run, check_table
from schema.agent.log import warn_user
from schema.errors import RevolveError, shown
from schema.tables.description import DETAILS, groups_of
from schema.tables.files import read_table


class Runs:
    """The runs in and below a folder, such as a campaign, and tables over all of them.

    A table has the rows of all runs, run by run, and the columns ``experiment``,
    ``repeat`` and ``seed``. Each access reads the runs as they are now, finished or
    not. Copies of a run are left out, as are folders that cannot be read; a line on
    standard error names each. An iteration yields each ``Run``.

    Attributes:
        folder: path of the folder.
        loaded: the runs as analyses read them, by path.
    """

    def __init__(self, folder: Folder) -> None:
        """Find the runs.

        Raises:
            RunFolderError: no such folder, or no run in it that can be read.
        """
        self.folder = Path(folder)
        self.loaded, left_out = read_runs([self.folder])
        for each in left_out:
            warn_user(f"left out: {each.folder}: {each.why}")

    def __iter__(self) -> Iterator[Run]:
        """Yield the single runs, by path."""
        return (Run(each.folder) for each in self.loaded)

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.loaded)

    births, evaluations, learning = Run.births, Run.evaluations, Run.learning
    population, fitness, poses = Run.population, Run.fitness, Run.poses
    deaths, touches, migrations = Run.deaths, Run.touches, Run.migrations
    meetings, matings, patches = Run.meetings, Run.matings, Run.patches
    audits, drifts, runs = Run.audits, Run.drifts, Run.runs

    def table(self, name: str) -> pa.Table:
        """Return the rows of a table of all runs.

        Args:
            name: such as ``births``.

        Raises:
            RunFolderError: the table of a run is damaged or of another version, or no
                run has such a table; the nearest is named.
        """
        check_table(name)
        tables = ((each, read_table(each.folder, name)) for each in self.loaded)
        return pa.concat_tables(_named(rows, run) for run, rows in tables)

    def phylogeny(self) -> pa.Table:
        """Return the phylogeny of all individuals, in the ALife data standard.

        ``id``, ``ancestor_list``, ``origin_time`` and ``destruction_time`` of each
        individual of all runs; docs/analysis.md has the meaning of the columns.

        Raises:
            RunFolderError: the table of a run is damaged or of another version.
        """
        tables, first = [], 0
        for run in self.loaded:
            births = read_table(run.folder, "births")
            rows = phylogeny(births, read_table(run.folder, "population"), first)
            tables.append(_named(rows, run))
            first += rows.num_rows
        return pa.concat_tables(tables)

    def export(self, out: Folder, to: str, table: str | None = None) -> None:
        """Write all runs to a file, as ``revolve export`` does.

        Args:
            out: file to write.
            to: ``csv``, ``parquet``, ``latex`` or ``phylogeny``.
            table: of ``csv`` and ``parquet``; None: ``births``.

        Raises:
            RunFolderError: as of ``table``; the file cannot be written.
            RevolveError: another format or table; nothing to compare.
        """
        words = [f"--table={table}"] if table is not None else []
        run_command(["export", str(self.folder), f"--to={to}", f"--out={out}", *words])

    def __repr__(self) -> str:
        return f"<Runs: {len(self)} in {self.folder}>"


def read(folder: Folder) -> Run | Runs:
    """Return the run of a folder, finished or not, or all runs in and below it.

    Raises:
        RunFolderError: there is no run, or its description is damaged.
        RevolveError: no path.
    """
    if folder == "" or not isinstance(folder, str | PathLike):
        raise RevolveError(f"folder: must be the path of a run, got {shown(folder)}")
    path, has_several = Path(folder), False
    with suppress(OSError):  # ``Run`` says which
        is_run = (path / DETAILS).exists() or bool(groups_of(path))
        has_several = path.is_dir() and not is_run
    return Runs(path) if has_several else Run(path)


def _named(rows: pa.Table, run: LoadedRun) -> pa.Table:
    """Return rows with the columns that tell the runs of a folder apart."""
    for name, kind, value in (
        ("experiment", pa.string(), run.settings.name),
        ("repeat", pa.int32(), run.number),
        ("seed", pa.uint64(), run.seed),
    ):
        if name not in rows.column_names:
            column = pa.repeat(pa.scalar(value, kind), rows.num_rows)
            rows = rows.append_column(name, column)
    return rows
