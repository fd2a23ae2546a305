"""Start of PyArrow in processes that write tables."""

import sys
from importlib.abc import MetaPathFinder

import pyarrow as pa


class _WithoutPandas(MetaPathFinder):
    """Finder that hides pandas."""

    def find_spec(self, name: str, *_: object) -> None:
        """Raise for pandas; other modules are found as usual."""
        if name == "pandas":
            raise ImportError(name)


def skip_pandas() -> None:
    """Keep PyArrow from importing pandas, if it is installed, at the first array.

    The import takes half a second and 40 MB. PyArrow makes it to recognise arrays of
    pandas, which our tables are never made of. ``to_pandas`` still works. Nothing is
    changed in a process that has imported pandas.
    """
    if "pandas" in sys.modules:
        return
    finder = _WithoutPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.array([0])
    finally:
        sys.meta_path.remove(finder)
