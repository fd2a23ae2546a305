"""Runs and documents that commit 3063df1 wrote: today's code opens and resumes them.

``tests/data/runs-3063df1/README.md`` says how they were made. Tables are compared with
pyarrow alone: column names, and which of them repeat, are those of the old files.
"""

import os
import re
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pyarrow as pa
import pytest
from pyarrow.parquet import ParquetFile

from tests.system.stage import PATIENCE_S, Stage

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

Once = Callable[[str, Callable[[Stage], object]], Path]

ROOT = Path(__file__).parents[2]
RUNS = ROOT / "tests" / "data" / "runs-3063df1"
DOCUMENTS = ROOT / "tests" / "data" / "documents-3063df1"
FOLDERS = ("undisturbed", "killed")
BIRTHS = {"off-line": 72, "arena": 24, "archipelago": 74}
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
}
"""Tables with rows, of each undisturbed run."""

# A drift is allowed and without effect where the platform is the recorded one. An arena
# that drifts waits half a minute for a worker of its own platform first.
RESUME = ("--workers", "1", "--threads", "1", "--quiet", "--allow-drift")

each_run = pytest.mark.parametrize("name", list(BIRTHS))


def unpack(name: str, folder: Path) -> None:
    """Write the folders ``killed`` and ``undisturbed`` of a run into a folder."""
    with ZipFile(RUNS / f"{name}.zip") as archive:
        archive.extractall(folder)


def tables(folder: Path) -> dict[str, pa.Table]:
    """Return the tables of a finished run by name, as they are in its files."""
    files = sorted((folder / "tables").glob("*/*/*.parquet"))
    return {file.stem: ParquetFile(file).read() for file in files}


def repeatable(schema: pa.Schema) -> list[str]:
    return [
        field.name
        for field in schema
        if (field.metadata or {}).get(b"repeatable") == b"true"
    ]


def differences(old: pa.Table, new: pa.Table) -> list[str]:
    """Return the repeatable columns of an old table that a new one has otherwise.

    A difference is a missing column or another value. Floats are compared by their
    text: to the last bit, and a NaN equals itself.
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


def births_said(status: str, name: str) -> int:
    """Return how many births ``revolve status`` counts in a run."""
    (said,) = {
        int(births)
        for births, wanted in re.findall(r"(\d+) of (\d+)", status)
        if int(wanted) == BIRTHS[name]
    }
    return said


@pytest.fixture(scope="session")
def resumed(once: Once) -> Callable[[str], Path]:
    """Return a function name -> folders of a run; the killed run is resumed."""

    def make(name: str) -> Path:
        def build(stage: Stage) -> None:
            unpack(name, stage.folder)
            stage.run("resume", "killed", *RESUME)

        return once(f"old-{name}", build)

    return make


@each_run
def test_a_killed_run_resumes_to_the_tables_of_the_undisturbed_one(
    resumed: Callable[[str], Path], name: str
) -> None:
    folder = resumed(name)
    old, new = tables(folder / "undisturbed"), tables(folder / "killed")
    assert {table for table, rows in old.items() if rows.num_rows} == FILLED[name]
    assert old["births"].num_rows == BIRTHS[name]
    assert old.keys() <= new.keys()
    if platform(old) != platform(new):
        pytest.skip(f"only promised on the platform of the data, {platform(old)}")
    assert {table: differences(old[table], new[table]) for table in old} == {
        table: [] for table in old
    }
    assert new["drifts"].num_rows == 0


@each_run
def test_the_comparison_sees_what_differs(
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


@each_run
def test_commands_read_runs_as_they_were_left(stage: Stage, name: str) -> None:
    unpack(name, stage.folder)
    born = births_said(stage.run("status", "killed"), name)
    assert 0 < born < BIRTHS[name]
    assert births_said(stage.run("status", "undisturbed"), name) == BIRTHS[name]
    assert f"births: {born} rows against {BIRTHS[name]}" in stage.run(
        "compare", "killed", "undisturbed", code=1
    )
    for kind in ("killed", "undisturbed"):
        stage.run("view", kind, "--save", f"{kind}.rrd")
        assert (stage.folder / f"{kind}.rrd").stat().st_size
    # Finished is finished: nothing is begun again.
    before = tables(stage.folder / "undisturbed")
    stage.run("resume", "undisturbed", *RESUME)
    after = tables(stage.folder / "undisturbed")
    assert all(before[table].equals(after[table]) for table in before)


@each_run
def test_compare_reads_a_resumed_run(
    resumed: Callable[[str], Path], stage: Stage, name: str
) -> None:
    folder = resumed(name)
    if len({platform(tables(folder / kind)) for kind in FOLDERS}) > 1:
        pytest.skip("runs of two platforms may differ")
    stage.run("compare", *(str(folder / kind) for kind in FOLDERS))


@pytest.mark.slow
def test_they_are_analysed(resumed: Callable[[str], Path], stage: Stage) -> None:
    """The archipelago has islands of both kinds."""
    folder = resumed("archipelago")
    report = ("--out", "report", "--processes", "1")
    stage.run("analyze", str(folder / "killed"), *report)
    assert (stage.folder / "report" / "report.html").stat().st_size
    measures = {path.stem: path for path in stage.folder.glob("report/*/*.parquet")}
    runs = ParquetFile(measures["runs"]).read()
    assert sum(runs["births"].to_pylist()) == BIRTHS["archipelago"]


@pytest.mark.slow
def test_an_arena_resumes_on_another_platform(stage: Stage) -> None:
    """The run continues and the drift is recorded; equality ends there."""
    unpack("arena", stage.folder)
    (stage.folder / "sitecustomize.py").write_text(
        "import platform\nplatform.machine = lambda: 'another'\n"
    )
    path = os.pathsep.join([str(stage.folder), str(ROOT)])
    process = stage.start("resume", "killed", *RESUME, environment={"PYTHONPATH": path})
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, out + err
    old, new = (tables(stage.folder / kind) for kind in FOLDERS)
    assert platform(old) != platform(new)
    assert new["drifts"].num_rows == 1
    assert new["births"].num_rows == BIRTHS["arena"]


@pytest.mark.parametrize("robot", ["parts.yaml", "robogen-parts.yaml", "fitness.xml"])
def test_robot_files_load(stage: Stage, robot: str) -> None:
    experiment = DOCUMENTS / Path(robot).with_suffix(".toml")
    words = (str(DOCUMENTS / robot), "--experiment", str(experiment))
    assert "16 parts" in stage.run("robot", "check", *words)


@pytest.mark.parametrize("name", ["parts", "robogen-parts", "fitness"])
def test_documents_run(stage: Stage, name: str) -> None:
    """Every plug-in name of a document is resolved by a run of a few births."""
    document = str(DOCUMENTS / f"{name}.toml")
    stage.run("run", document, "--in-process", "--quiet", "--out", "run")
    found = tables(stage.folder / "run")
    (text,) = found["runs"]["document"].to_pylist()
    for path in named(Path(document).read_text("utf-8")):
        assert f'"{path}"' in text


def test_a_robot_of_before_is_judged_by_the_function_that_its_file_names(
    stage: Stage,
) -> None:
    said = stage.run("robot", "simulate", str(DOCUMENTS / "fitness.xml"))
    assert "fitness:" in said


def test_documents_name_what_recorded_ones_may_name() -> None:
    """The public import paths, each with all its names."""
    texts = [path.read_text("utf-8") for path in DOCUMENTS.glob("*.toml")]
    found = {path.partition(":")[0] for text in texts for path in named(text)}
    assert found == {"schema.parts", "schema.robogen_parts", "worker.fitness"}


def named(text: str) -> list[str]:
    """Return the paths of code that a document names."""
    return [match[1] for match in re.finditer(r'"([\w.]+:\w+)"', text)]
