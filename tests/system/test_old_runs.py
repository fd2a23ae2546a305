"""Checks that finished runs, documents and robots of commit 3063df1 are read.

``tests/data/runs-3063df1/README.md`` describes how they were made.
"""

import re
from pathlib import Path
from zipfile import ZipFile

import pyarrow as pa
import pytest
from pyarrow.parquet import ParquetFile

from schema.tables.columns import TABLES
from schema.tables.files import read_table
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
DOCUMENTS = DATA / "documents-3063df1"
BIRTHS = {"off-line": 72, "arena": 24, "archipelago": 74}
FILLED = {
    "off-line": {"births", "evaluations", "population", "runs"},
    "arena": {"births", "deaths", "fitness", "population", "poses", "runs", "touches"},
    "archipelago": {*TABLES}
    - {"audits", "archive", "drifts", "learning", "touches"}
    - {"meetings", "matings", "patches"},
}
"""Tables that have rows in each run."""

each_run = pytest.mark.parametrize("name", list(BIRTHS))


def unpacked(name: str, folder: Path) -> Path:
    """Extract a finished run into a folder; return the path of the run."""
    with ZipFile(DATA / "runs-3063df1" / f"{name}.zip") as archive:
        archive.extractall(folder)
    return (folder / "undisturbed").rename(folder / "run")


def tables(folder: Path) -> dict[str, pa.Table]:
    """Return the tables in the files of a finished run by name."""
    files = sorted((folder / "tables").glob("*/*/*.parquet"))
    return {file.stem: ParquetFile(file).read() for file in files}


def repeatable(schema: pa.Schema) -> list[str]:
    return [
        field.name
        for field in schema
        if (field.metadata or {}).get(b"repeatable") == b"true"
    ]


def differences(old: pa.Table, new: pa.Table) -> list[str]:
    """Return the repeatable columns of an old table that differ in a new one.

    A difference is a missing column or another value. Floats are compared as text, that
    is, exactly, and NaN equals NaN.
    """
    return [
        name
        for name in repeatable(old.schema)
        if name not in new.column_names
        or repr(old[name].to_pylist()) != repr(new[name].to_pylist())
    ]


@each_run
def test_tables_of_a_finished_run_are_read(tmp_path: Path, name: str) -> None:
    """Columns that came later are null, or have the value of older rows."""
    folder = unpacked(name, tmp_path)
    stored = tables(folder)
    found = {table: read_table(folder, table) for table in TABLES}
    assert {table for table, rows in found.items() if rows.num_rows} == FILLED[name]
    assert found["births"].num_rows == BIRTHS[name]
    for table, rows in stored.items():
        old = found[table].select(rows.column_names)
        assert repr(old.to_pylist()) == repr(rows.to_pylist()), table


@each_run
def test_commands_read_a_finished_run(workspace: Workspace, name: str) -> None:
    folder = unpacked(name, workspace.folder)
    births = {
        int(have)
        for have, wanted in re.findall(
            r"(\d+) of (\d+)", workspace.run("status", "run")
        )
        if int(wanted) == BIRTHS[name]
    }
    assert births == {BIRTHS[name]}
    workspace.run("compare", "run", "run")
    workspace.run("view", "run", "--save", "run.rrd")
    assert (workspace.folder / "run.rrd").stat().st_size
    before = tables(folder)
    assert "already finished" in workspace.run("resume", "run")
    assert tables(folder) == before


@each_run
def test_a_new_run_has_the_rows_of_the_old_one(workspace: Workspace, name: str) -> None:
    """Births of an experiment and seed never change on one platform."""
    old = tables(unpacked(name, workspace.folder))
    document = str(DATA / "runs-3063df1" / f"{name}.toml")
    flags = ("--seed", "7", "--in-process", "--quiet", "--out", "new")
    workspace.run("run", document, *flags)
    new = tables(workspace.folder / "new")
    platforms = [each["runs"]["platform"].to_pylist() for each in (old, new)]
    if platforms[0] != platforms[1]:
        pytest.skip(f"only promised on the platform of the data, {platforms[0]}")
    # The document of the new run has more keys.
    rows = {table: each for table, each in old.items() if table != "runs"}
    assert {table: differences(each, new[table]) for table, each in rows.items()} == {
        table: [] for table in rows
    }


def test_an_unfinished_run_is_refused_in_one_line(workspace: Workspace) -> None:
    folder = unpacked("off-line", workspace.folder)
    (folder / "state").write_text("stopped")
    (line,) = workspace.run("resume", "run", code=2).splitlines()
    assert "Revolve Islands 0.2 began this run" in line
    assert "revolve-islands==0.2.*" in line


@pytest.mark.long
@pytest.mark.slow
def test_a_finished_archipelago_is_analysed(workspace: Workspace) -> None:
    """Analyze the archipelago, which has islands of both kinds."""
    unpacked("archipelago", workspace.folder)
    workspace.run("analyze", "run", "--out", "report", "--processes", "1")
    assert (workspace.folder / "report" / "report.html").stat().st_size
    measures = {path.stem: path for path in workspace.folder.glob("report/*/*.parquet")}
    runs = ParquetFile(measures["runs"]).read()
    assert sum(runs["births"].to_pylist()) == BIRTHS["archipelago"]


@pytest.mark.parametrize("robot", ["parts.yaml", "robogen-parts.yaml", "fitness.xml"])
def test_old_robot_files_load(workspace: Workspace, robot: str) -> None:
    experiment = DOCUMENTS / Path(robot).with_suffix(".toml")
    words = (str(DOCUMENTS / robot), "--experiment", str(experiment))
    assert "16 parts" in workspace.run("robot", "check", *words)


@pytest.mark.parametrize("name", ["parts", "robogen-parts", "fitness"])
def test_old_documents_run(workspace: Workspace, name: str) -> None:
    """Resolve all names of a document in a run of a few births."""
    document = str(DOCUMENTS / f"{name}.toml")
    workspace.run("run", document, "--in-process", "--quiet", "--out", "run")
    found = tables(workspace.folder / "run")
    (text,) = found["runs"]["document"].to_pylist()
    for path in import_paths(Path(document).read_text("utf-8")):
        assert f'"{path}"' in text


def test_old_robot_is_evaluated_with_the_function_of_its_file(
    workspace: Workspace,
) -> None:
    output = workspace.run("robot", "simulate", str(DOCUMENTS / "fitness.xml"))
    assert "fitness:" in output


def test_old_documents_contain_all_permanent_import_paths() -> None:
    """Check the set of import paths that must not change."""
    texts = [path.read_text("utf-8") for path in DOCUMENTS.glob("*.toml")]
    found = {path.partition(":")[0] for text in texts for path in import_paths(text)}
    assert found == {"schema.parts", "schema.robogen_parts", "worker.fitness"}


def import_paths(text: str) -> list[str]:
    """Return the import paths in a document."""
    return [match[1] for match in re.finditer(r'"([\w.]+:\w+)"', text)]
