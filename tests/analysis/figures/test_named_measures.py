"""Figure of measures that experiments name."""

import pyarrow as pa
from matplotlib.text import Text

from analysis.figures.courses import UNITS, measures_over_births
from tests.analysis.drawn import layers
from worker.measures import BUILT_IN


def test_figure_is_drawn_without_a_warning() -> None:
    rows = [
        {"experiment": "a", "folder": "a-1", "island": 0, "measure": measure,
         "births": births, "mean": 0.1 * births, "about": about}
        for births in (15, 30)
        for measure, about in (
            ("height", ""), ("bare", "A number."), ("own", "Pull [N] of a rope [m/s].")
        )
    ]  # fmt: skip
    tables = {"named_measures": pa.Table.from_pylist(rows)}
    # Warnings are errors: a scale without a layer that uses it is one.
    drawn = measures_over_births(tables).draw()
    (line,) = drawn.axes[0].lines or drawn.axes[0].collections
    assert line is not None
    texts = {text.get_text() for text in drawn.findobj(Text)}
    assert {"height [m]", "bare", "own [m/s]"} <= texts


def test_a_measure_at_one_number_of_births_is_a_dot() -> None:
    row = {"experiment": "a", "folder": "a-1", "island": 0, "births": 15, "mean": 0.1}
    rows = [{**row, "measure": "height", "about": ""}]
    figure = measures_over_births({"named_measures": pa.Table.from_pylist(rows)})
    assert layers(figure)["geom_point"]["mean"] == [0.1]


def test_units_are_those_of_the_docstrings() -> None:
    assert UNITS.keys() < BUILT_IN.keys()
    for name, function in BUILT_IN.items():
        unit = UNITS.get(name, "1")
        assert f"[{unit}]" in (function.__doc__ or "").partition("Source")[0], name
