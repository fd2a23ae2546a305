"""Figure of the fitness that robots keep under changes of the simulation."""

from collections.abc import Sequence
from typing import Any

import plotnine as p9
import pyarrow as pa

from analysis.figures.forms import NothingToDraw
from analysis.figures.style import theme_of_size
from schema.errors import counted

_LAST, _BEST = "last population", "best ever"
_MOST = 2.0
"""Greatest share that the figure shows; points beyond stand at the edge."""


def robustness(table: pa.Table) -> p9.ggplot:
    """Return the share of its fitness that each robot keeps under each change.

    Raises:
        NothingToDraw: no robot has a positive fitness without changes.
    """
    rows = known_shares(table)
    raised = rows["change"].str.contains("higher")
    rows["label"] = rows["change"].where(~raised, "start raised by < 0.2 mm")
    return points_of_shares(rows, list(dict.fromkeys(rows["label"])), 5.2)


def known_shares(table: pa.Table) -> Any:  # noqa: ANN401 - pandas
    """Return the rows of a table that have a share, as a data frame.

    Raises:
        NothingToDraw: there are none.
    """
    rows = table.filter(table["share"].is_valid())
    if not rows:
        raise NothingToDraw("no robot has a positive fitness without changes")
    return rows.to_pandas()


def points_of_shares(
    rows: Any,  # noqa: ANN401 - pandas
    labels: Sequence[str],
    height_in: float,
) -> p9.ggplot:
    """Return a row of points for each label, and boxes of the last population.

    Args:
        rows: data frame with ``label``, ``share``, ``is_best`` and ``is_last``; its
            shares are clipped.
        labels: from top to bottom.
        height_in: of the figure [inches].
    """
    beyond = int((abs(rows["share"]) > _MOST).sum())
    rows["share"] = rows["share"].clip(-_MOST, _MOST)
    best = rows[rows["is_best"]].assign(of=_BEST)
    last = rows[rows["is_last"]].assign(of=_LAST)
    figure = p9.ggplot(mapping=p9.aes("label", "share"))
    figure += p9.geom_hline(yintercept=1.0, colour="#999999", size=0.5)
    if not last.empty:
        figure += p9.geom_boxplot(
            data=last, outlier_alpha=0, fill="#DDEBF5", colour="#7F7F7F", size=0.4
        )
    for each, size in ((last, 1.2), (best, 2.4)):
        figure += p9.geom_point(
            p9.aes(fill="of"),
            data=each,
            position=p9.position_jitter(width=0.15, height=0, random_state=1),
            size=size,
            stroke=0.2,
        )
    return (
        figure
        + p9.scale_fill_manual({_LAST: "#0072B2", _BEST: "#D55E00"}, name="")
        + p9.scale_x_discrete(limits=labels[::-1])
        + p9.coord_flip()
        + p9.expand_limits(y=[0, 1])
        + p9.labs(x="", y=f"fitness divided by fitness without changes{_said(beyond)}")
        + theme_of_size(height_in)
    )


def _said(beyond: int) -> str:
    """Return the part of the axis title about points that stand at the edge."""
    if not beyond:
        return ""
    return f"\n(at the edge: {counted(beyond, 'point')} beyond {_MOST:g})"
