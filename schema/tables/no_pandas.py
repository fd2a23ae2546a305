"""PyArrow without pandas, in processes that do not need it."""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

import pyarrow as pa


def leave_out_pandas() -> None:
    """Let PyArrow work without pandas in this process.

    With its first array or scalar PyArrow imports pandas, if that is installed, to
    recognize a ``Series``: 0.2 s and 30 MB in each process. It does so once. A later
    ``import pandas`` and PyArrow's ``to_pandas`` work as usual; an array that is made
    of a ``Series`` may hold NaN where it would have been null.

    Nothing is changed in a process that has imported pandas. No other thread may
    import it meanwhile.
    """
    if "pandas" in sys.modules:
        return
    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.scalar(0)
    finally:
        sys.meta_path.remove(finder)


class _NoPandas(MetaPathFinder):
    """Finder of modules that says that pandas is not installed."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002 - of the protocol
        target: ModuleType | None = None,  # noqa: ARG002 - of the protocol
    ) -> ModuleSpec | None:
        """Raise ``ModuleNotFoundError`` for pandas; return None for all others."""
        if fullname == "pandas":
            raise ModuleNotFoundError(name=fullname)
        return None
