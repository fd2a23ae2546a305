"""Tests of PyArrow without pandas; in a process of their own, as it is for each."""

import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).parents[3]
SCRIPT = """
import sys
import pyarrow as pa
from schema.tables.arrow import skip_pandas

skip_pandas()
table = pa.table({"a": pa.array([1, None]), "b": pa.array(["x", "y"])})
print("pandas" in sys.modules, len(sys.meta_path))
frame = table.to_pandas()
print(type(frame).__module__.partition(".")[0], frame["b"].tolist())
print(pa.Table.from_pandas(frame)["b"].to_pylist(), pa.array(frame["a"]).null_count)
"""


def test_pandas_is_imported_only_when_it_is_needed() -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; print(len(sys.meta_path)){SCRIPT}"],
        cwd=TOP,
        capture_output=True,
        text=True,
        check=True,
    )
    finders, state, frame, again = done.stdout.splitlines()
    assert state == f"False {finders}"
    assert frame == "pandas ['x', 'y']"
    # Once PyArrow has pandas, it reads NaN of a Series as null.
    assert again == "['x', 'y'] 1"
