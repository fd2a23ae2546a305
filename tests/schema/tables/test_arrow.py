"""PyArrow without the import of pandas."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
from schema.tables.arrow import skip_pandas
skip_pandas()
import pyarrow as pa
numbers = pa.array([1, 2])
assert "pandas" not in sys.modules
assert numbers.to_pandas().sum() == 3
assert "pandas" in sys.modules
"""


def test_arrays_are_made_without_pandas_and_still_convert_to_it() -> None:
    pytest.importorskip("pandas")
    subprocess.run([sys.executable, "-c", PROGRAM], check=True)
