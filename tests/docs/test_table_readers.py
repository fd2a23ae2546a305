"""Lines of docs/tables.md that read the tables with other libraries."""

import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from coordinator.storage.folder import RunFolder
from coordinator.storage.recorder import Recorder
from schema.tables.columns import BIRTHS, EVALUATIONS
from schema.tables.description import RunDetails
from schema.tables.files import read_table
from tests.coordinator.records import make_records

PAGE = Path(__file__).parents[2] / "docs" / "tables.md"
SEEDS = (7, 2**63 + 1)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder above ``runs``, which has two finished runs."""
    top = tmp_path_factory.mktemp("readers [1] ö")
    for seed in SEEDS:
        details = RunDetails("a/b c", 0, seed, "{}")
        folder = top / "runs" / f"[ä-{seed}] {{*}} ?"
        with RunFolder(folder, details):
            recorder = Recorder(folder, details)
            for record in make_records(30):
                recorder.write(record)
            recorder.finish()
    return top


def lines() -> dict[str, str]:
    """Return the code of each library, by the first word before its block."""
    page = PAGE.read_text("utf-8")
    _, _, section = page.partition("## The same frame in every library")
    found = re.findall(r"^(\w+)[^`\n]*(?:`[^`]+`[^`\n]*)?:\n\n```python\n(.*?)^```",
                       section, re.MULTILINE | re.DOTALL)  # fmt: skip
    return {name: code for name, code in found if name != "names"}


def as_arrow(frame: Any, schema: pa.Schema) -> pa.Table:  # noqa: ANN401 - of 4 libraries
    """Return a frame of any library as a table of these types."""
    if isinstance(frame, pa.Table):
        return frame
    for name in ("to_arrow_table", "to_arrow"):
        if hasattr(frame, name):
            return getattr(frame, name)().cast(schema)
    return pa.Table.from_pandas(frame, schema, preserve_index=False)


@pytest.mark.parametrize("table", ["births", "evaluations"])
@pytest.mark.parametrize("name", ["pyarrow", "pandas", "Polars", "DuckDB"])
def test_every_library_gives_the_same_frame(
    runs: Path, monkeypatch: pytest.MonkeyPatch, name: str, table: str
) -> None:
    monkeypatch.chdir(runs)
    code = lines()[name].replace("births", table)
    names: dict[str, Any] = {}
    exec(code, names)  # noqa: S102 - of our page
    schema = {"births": BIRTHS, "evaluations": EVALUATIONS}[table]
    frame = names[table]
    assert list(getattr(frame, "column_names", frame.columns)) == schema.names
    found = as_arrow(frame, schema).sort_by(
        [("seed", "ascending"), ("record", "ascending")]
    )
    folders = [runs / "runs" / f"[ä-{seed}] {{*}} ?" for seed in SEEDS]
    expected = [read_table(folder, table) for folder in folders]
    assert found.equals(pa.concat_tables(expected))
    assert found["seed"].unique().to_pylist() == list(SEEDS)
    assert len(found["run_id"].unique()) == len(SEEDS)
