"""Figures in the order and form of the thesis."""

from pathlib import Path

import plotnine as p9
import pyarrow as pa

WIDTH_IN, HEIGHT_IN = 7.0, 4.0
DPI = 150


def progression_figure(table: pa.Table) -> p9.ggplot:
    """Return mean fitness over births, with its interval over runs.

    Args:
        table: rows of fitness of ``analysis.progression.progression``.

    Source: Hupkes 2016, figure 6.3.
    """
    figure = (
        p9.ggplot(table.to_pandas(), p9.aes("births", "mean"))
        + p9.geom_line(p9.aes(colour="experiment"), size=0.8)
        + p9.labs(
            x="births",
            y="mean fitness of the population",
            colour="",
            fill="",
        )
        + p9.theme_gray()
        + p9.theme(figure_size=(WIDTH_IN, HEIGHT_IN), legend_position="top")
    )
    sure = table.filter(table["low"].is_valid())
    if not sure.num_rows:
        return figure
    ends = p9.aes(ymin="low", ymax="high", fill="experiment")
    return figure + p9.geom_ribbon(ends, data=sure.to_pandas(), alpha=0.25)


def save(figure: p9.ggplot, path: Path) -> None:
    """Write a figure as PNG and PDF; ``path`` has no ending."""
    for ending in (".png", ".pdf"):
        figure.save(path.with_suffix(ending), dpi=DPI, verbose=False)
