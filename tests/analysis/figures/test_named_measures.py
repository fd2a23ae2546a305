"""Figure of measures that experiments name."""

import pyarrow as pa

from analysis.figures import named_measures


def test_figure_is_drawn_without_a_warning() -> None:
    rows = [
        {"experiment": "a", "folder": "a-1", "island": 0, "measure": "height",
         "births": births, "mean": 0.1 * births}
        for births in (15, 30)
    ]  # fmt: skip
    tables = {"named_measures": pa.Table.from_pylist(rows)}
    # Warnings are errors: a scale without a layer that uses it is one.
    drawn = named_measures.measures_over_births(tables).draw()
    (line,) = drawn.axes[0].lines or drawn.axes[0].collections
    assert line is not None
