"""Figures of the speed of an arena: random robots and spiders."""

import numpy as np
import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.forms import NothingToDraw, Tables
from analysis.figures.look import BLUE, GREY
from analysis.figures.style import theme_of_size

_THESIS = (-0.26, 34.78, 20.41)
"""Real-time factor a + b / p + c / p^2 on an i7-4790K. Source: Hupkes 2016, 6.1."""
_LEAST = 0.1
"""Least value that is drawn of the thesis's fit."""
_TICKS = [factor * 10.0**power for power in range(-2, 5) for factor in (1, 3)]
_OURS, _THEIRS = "this machine", "thesis, i7-4790K"


def speed(tables: Tables, kind: str) -> p9.ggplot:
    """Return the real-time factor of arenas of "arena" or "spider" by population.

    Random robots are beside the thesis's fit.

    Raises:
        NothingToDraw: no benchmark was read.

    Source: Hupkes 2016, figures 6.1 and 7.1, without its comparison with RoboGen.
    """
    rows = tables.get("benchmark")
    if rows is not None:
        rows = rows.filter(pc.field("benchmark") == kind)
    if not rows:
        raise NothingToDraw(
            f"no benchmark file was read; create one with: revolve bench {kind} --out "
            f"RUNS/{kind}.parquet"
        )
    figure = _points(rows)
    if kind != "arena":
        return figure
    sizes = np.unique(np.asarray(rows["population"], np.float64))
    line = np.linspace(sizes.min(), max(sizes.max(), sizes.min() + 1), 100)
    a, b, c = _THESIS
    factors = a + b / line + c / line**2
    # Of many robots it is negative.
    fit = pa.table({"population": line, "factor": factors}).filter(factors >= _LEAST)
    if fit.num_rows <= 1:
        return figure
    return figure + p9.geom_line(data=fit.to_pandas().assign(of=_THEIRS), size=0.7)


def _points(rows: pa.Table) -> p9.ggplot:
    means = rows.group_by("population").aggregate([("factor", "mean")])
    line = means.rename_columns(["population", "factor"]).to_pandas().assign(of=_OURS)
    return (
        p9.ggplot(line, p9.aes("population", "factor", colour="of", linetype="of"))
        + p9.geom_hline(yintercept=1.0, colour=GREY, size=0.5)
        + p9.annotate(
            "text",
            x=line["population"].max(),
            y=1.0,
            label="real time",
            ha="right",
            va="bottom",
            size=8,
            colour=GREY,
        )
        + p9.geom_line(size=0.9)
        + p9.geom_point(
            p9.aes("population", "factor"),
            data=rows.to_pandas(),
            inherit_aes=False,
            fill=BLUE,
            colour="white",
            size=1.8,
            stroke=0.2,
        )
        + p9.scale_colour_manual({_OURS: BLUE, _THEIRS: GREY}, name="")
        + p9.scale_linetype_manual({_OURS: "-", _THEIRS: "--"}, name="")
        + p9.scale_y_log10(
            breaks=_TICKS, labels=lambda ticks: [f"{tick:g}" for tick in ticks]
        )
        + p9.labs(x="robots", y="simulated / wall time")
        + theme_of_size(3.6)
    )
