"""Builders of tables of measures, and the data of a figure's layers."""

from typing import Any

import plotnine as p9
import pyarrow as pa

from analysis.measures.outputs import schema

Row = dict[str, Any]


def table(name: str, rows: list[Row]) -> pa.Table:
    """Return a table of measures; missing columns are null."""
    return pa.Table.from_pylist(rows, schema(name))


def layers(figure: p9.ggplot) -> dict[str, Row]:
    """Return the data of each layer, by the name of its geom."""
    return {
        type(layer.geom).__name__: (
            figure.data if layer._data is None else layer._data
        ).to_dict("list")
        for layer in figure.layers
    }
