"""Figure of measures that experiments name."""

import pyarrow as pa
from matplotlib.text import Text

from analysis.figures import named_measures
from tests.analysis.drawn import layers


def test_figure_is_drawn_without_a_warning() -> None:
    rows = [
        {"experiment": "a", "folder": "a-1", "island": 0, "measure": measure,
         "births": births, "mean": 0.1 * births, "unit": unit}
        for births in (15, 30)
        for measure, unit in (("own", "m/s"), ("bare", ""))
    ]  # fmt: skip
    tables = {"named_measures": pa.Table.from_pylist(rows)}
    # Warnings are errors: a scale without a layer that uses it is one.
    drawn = named_measures.measures_over_births(tables).draw()
    (line,) = drawn.axes[0].lines or drawn.axes[0].collections
    assert line is not None
    texts = {text.get_text() for text in drawn.findobj(Text)}
    assert {"own [m/s]", "bare"} <= texts


def test_a_measure_at_one_number_of_births_is_a_dot() -> None:
    row = {"experiment": "a", "folder": "a-1", "island": 0, "births": 15, "mean": 0.1}
    rows = [{**row, "measure": "height", "unit": "m"}]
    figure = named_measures.measures_over_births(
        {"named_measures": pa.Table.from_pylist(rows)}
    )
    assert layers(figure)["geom_point"]["mean"] == [0.1]
