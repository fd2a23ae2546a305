"""Tables of measures by hand, and what a figure of them shows."""

from typing import Any

import plotnine as p9
import pyarrow as pa

from analysis.measures.outputs import schema

Row = dict[str, Any]


def table(name: str, rows: list[Row]) -> pa.Table:
    """Return a table of measures; what rows do not say is null."""
    return pa.Table.from_pylist(rows, schema(name))


def layers(figure: p9.ggplot) -> dict[str, Row]:
    """Return the columns that each layer shows, by its form."""
    return {
        type(layer.geom).__name__: (
            figure.data if layer._data is None else layer._data
        ).to_dict("list")
        for layer in figure.layers
    }
