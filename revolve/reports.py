"""Analyses of runs as the Python API has them."""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet

from revolve.arguments import is_silent
from revolve.children import run_command
from revolve.runs import Run, check_table
from schema.errors import RunFolderError


class Analysis:
    """Folder that ``analyze`` has written: tables of measures, figures, a report.

    Attributes:
        folder: path of the folder.
        report: path of the report, an HTML file with all figures.
        names: of the tables of measures; docs/analysis.md has their meaning.
    """

    def __init__(self, folder: str | Path) -> None:
        """Open the folder of an analysis.

        Raises:
            RunFolderError: there is no analysis.
        """
        self.folder = Path(folder)
        self.report = self.folder / "report.html"
        files = sorted((self.folder / "measures").glob("*.parquet"))
        if not (files and self.report.is_file()):
            raise RunFolderError(f"{folder}: no analysis is there")
        self.names = tuple(file.stem for file in files)

    def table(self, name: str) -> pa.Table:
        """Return a table of measures.

        Raises:
            RunFolderError: no such table; the nearest is named.
        """
        check_table(name, self.names)
        return pa.parquet.read_table(self.folder / "measures" / f"{name}.parquet")

    def __repr__(self) -> str:
        return f"<Analysis {self.folder}: {len(self.names)} tables, {self.report}>"


def analyze(
    *runs: Run | str | Path,
    out: str | Path = "report",
    figures: Iterable[str] = (),
    width: str = "page",
    format: Iterable[str] = ("pdf", "png"),  # noqa: A002 - as the flag
    style: str = "light",
    colours: Iterable[str] = (),
    progress: bool | None = None,
) -> Analysis:
    """Measure runs, draw the figures and write a report, as ``revolve analyze`` does.

    Args:
        runs: runs, or folders that contain some.
        out: folder to write to.
        figures: numbers of those to draw, such as ``["6.3", "H"]``; empty: all.
        width: of figures: ``page``, 7.2 inches, or a paper's ``column``, 3.5 inches.
        format: of the files of figures, of ``pdf``, ``png`` and ``svg``.
        style: look of figures and report: ``light``, ``dark`` or ``print``.
        colours: of the experiments in the order of legends, or the name of a colour
            map of matplotlib; empty: those of the thesis.
        progress: show progress on standard error, and the findings; None: in
            notebooks.

    Raises:
        RunFolderError: no run is found, or the folder cannot be written.
        RevolveError: a library is missing, and the message says how to install it; no
            such figure, width, format, style or colour.
    """
    words = ["analyze", *(str(getattr(each, "folder", each)) for each in runs)]
    words += ["--out", str(out), "--width", str(width), "--style", str(style)]
    lists = {"--figures": figures, "--format": format, "--colours": colours}
    for flag, names in lists.items():
        if text := ",".join(map(str, names)):
            words += [flag, text]
    run_command(words, is_quiet=is_silent(progress=progress))
    return Analysis(out)
