"""Checks that the current code reads and resumes runs and documents of commit 3063df1.

``tests/data/runs-3063df1/README.md`` describes how they were made. Tables are compared
with pyarrow only: the old files determine the columns and which of them are repeatable.

The run of a later commit in ``tests/data/runs-b68fda16`` has contacts that no longer
count.
"""

import os
import re
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pyarrow as pa
import pytest
from pyarrow.parquet import ParquetFile

from tests.system.workspace import PATIENCE_S, Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

Once = Callable[[str, Callable[[Workspace], object]], Path]

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
DOCUMENTS = DATA / "documents-3063df1"
FOLDERS = ("undisturbed", "killed")
BIRTHS = {"off-line": 72, "arena": 24, "archipelago": 74}
LATER = {"arena-gap": 12}
FILLED = {
    "off-line": {"births", "evaluations", "population", "runs"},
    "arena": {"births", "deaths", "fitness", "population", "poses", "runs", "touches"},
    "archipelago": {
        "births",
        "deaths",
        "evaluations",
        "fitness",
        "migrations",
        "population",
        "poses",
        "runs",
    },
    "arena-gap": {"births", "deaths", "fitness", "population", "runs"},
}
"""Tables that have rows in each undisturbed run."""

# --allow-drift has no effect on the recorded platform. On another platform an arena
# first waits half a minute for a worker of the recorded one.
RESUME = ("--workers", "1", "--threads", "1", "--quiet", "--allow-drift")

each_run = pytest.mark.parametrize("name", list(BIRTHS))


def unpack(name: str, folder: Path) -> None:
    """Extract the folders ``killed`` and ``undisturbed`` of a run into a folder."""
    (file,) = DATA.glob(f"runs-*/{name}.zip")
    with ZipFile(file) as archive:
        archive.extractall(folder)


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


def platform(found: dict[str, pa.Table]) -> str:
    """Return the platform tag of the coordinator that finished a run."""
    (tag,) = found["runs"]["platform"].to_pylist()
    return str(tag)


def births_in_status(status: str, name: str) -> int:
    """Return the number of births of a run in the output of ``revolve status``."""
    (count,) = {
        int(births)
        for births, wanted in re.findall(r"(\d+) of (\d+)", status)
        if int(wanted) == BIRTHS[name]
    }
    return count


@pytest.fixture(scope="session")
def resumed(once: Once) -> Callable[[str], Path]:
    """Return a function that resumes a killed run and returns the parent folder."""

    def make(name: str) -> Path:
        def build(workspace: Workspace) -> None:
            unpack(name, workspace.folder)
            workspace.run("resume", "killed", *RESUME)

        return once(f"old-{name}", build)

    return make


@pytest.mark.parametrize("name", [*BIRTHS, *LATER])
def test_killed_run_resumes_to_the_tables_of_the_undisturbed_run(
    resumed: Callable[[str], Path], name: str
) -> None:
    folder = resumed(name)
    old, new = tables(folder / "undisturbed"), tables(folder / "killed")
    assert {table for table, rows in old.items() if rows.num_rows} == FILLED[name]
    assert old["births"].num_rows == (BIRTHS | LATER)[name]
    assert old.keys() <= new.keys()
    if platform(old) != platform(new):
        pytest.skip(f"only promised on the platform of the data, {platform(old)}")
    assert {table: differences(old[table], new[table]) for table in old} == {
        table: [] for table in old
    }
    assert new["drifts"].num_rows == 0


@each_run
def test_comparison_detects_differences(
    resumed: Callable[[str], Path], name: str
) -> None:
    births = tables(resumed(name) / "undisturbed")["births"]
    assert len(repeatable(births.schema)) > 10
    last = births.num_rows - 1
    shorter = births.slice(0, last)
    repeated = pa.concat_tables([shorter, births.slice(last - 1, 1)])
    assert differences(births, births) == []
    assert differences(births, shorter) == repeatable(births.schema)
    assert "birth" in differences(births, repeated)
    assert differences(births, births.drop_columns(["rank"])) == ["rank"]


@pytest.mark.long
@each_run
def test_commands_read_old_runs_without_a_resume(
    workspace: Workspace, name: str
) -> None:
    unpack(name, workspace.folder)
    births = births_in_status(workspace.run("status", "killed"), name)
    assert 0 < births < BIRTHS[name]
    assert (
        births_in_status(workspace.run("status", "undisturbed"), name) == BIRTHS[name]
    )
    assert f"births: {births} rows against {BIRTHS[name]}" in workspace.run(
        "compare", "killed", "undisturbed", code=1
    )
    for kind in ("killed", "undisturbed"):
        workspace.run("view", kind, "--save", f"{kind}.rrd")
        assert (workspace.folder / f"{kind}.rrd").stat().st_size
    # Resuming a finished run does not change its tables.
    before = tables(workspace.folder / "undisturbed")
    workspace.run("resume", "undisturbed", *RESUME)
    after = tables(workspace.folder / "undisturbed")
    assert all(before[table].equals(after[table]) for table in before)


@each_run
def test_compare_reads_a_resumed_run(
    resumed: Callable[[str], Path], workspace: Workspace, name: str
) -> None:
    folder = resumed(name)
    if len({platform(tables(folder / kind)) for kind in FOLDERS}) > 1:
        pytest.skip("runs of two platforms may differ")
    workspace.run("compare", *(str(folder / kind) for kind in FOLDERS))


@pytest.mark.long
@pytest.mark.slow
def test_resumed_archipelago_is_analysed(
    resumed: Callable[[str], Path], workspace: Workspace
) -> None:
    """Analyze the archipelago, which has islands of both kinds."""
    folder = resumed("archipelago")
    report = ("--out", "report", "--processes", "1")
    workspace.run("analyze", str(folder / "killed"), *report)
    assert (workspace.folder / "report" / "report.html").stat().st_size
    measures = {path.stem: path for path in workspace.folder.glob("report/*/*.parquet")}
    runs = ParquetFile(measures["runs"]).read()
    assert sum(runs["births"].to_pylist()) == BIRTHS["archipelago"]


@pytest.mark.long
@pytest.mark.slow
def test_arena_resumes_on_another_platform(workspace: Workspace) -> None:
    """The run continues without bitwise equality and records the drift."""
    unpack("arena", workspace.folder)
    (workspace.folder / "sitecustomize.py").write_text(
        "import platform\nplatform.machine = lambda: 'another'\n"
    )
    path = os.pathsep.join([str(workspace.folder), str(ROOT)])
    process = workspace.start(
        "resume", "killed", *RESUME, environment={"PYTHONPATH": path}
    )
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, out + err
    old, new = (tables(workspace.folder / kind) for kind in FOLDERS)
    assert platform(old) != platform(new)
    assert new["drifts"].num_rows == 1
    assert new["births"].num_rows == BIRTHS["arena"]


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
