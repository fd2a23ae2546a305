"""Pareto fronts of experiments with several objectives."""

import plotnine as p9

from analysis.figures.forms import Tables
from analysis.figures.style import in_order, panel_grid, scales, theme_of_size


def fronts(tables: Tables) -> p9.ggplot:
    """Return all births in the first two objectives, a line along each front."""
    frame = tables["fronts"].to_pandas()
    experiments = in_order(frame["experiment"])
    frame["line"] = frame["folder"] + " " + frame["island"].astype(str)
    # Panels have one pair of objectives each.
    frame["panel"] = frame["y_objective"] + " by " + frame["x_objective"]
    best = frame[frame["is_front"]].sort_values(["line", "x", "y"])
    columns, rows = panel_grid(panels := frame["panel"].nunique(), 2)
    figure = p9.ggplot(frame, p9.aes("x", "y", colour="experiment"))
    figure += p9.geom_point(size=0.8, alpha=0.3, stroke=0, show_legend=False)
    # Between two points the best is that of the one which is not better in x.
    is_less = frame["x_objective"].iloc[0].endswith("(min)")
    steps = {"direction": "hv" if is_less else "vh", "size": 0.5, "alpha": 0.8}
    figure += p9.geom_step(p9.aes(group="line"), best, **steps)
    figure += p9.geom_point(data=best, size=1.6, show_legend=False)
    if panels > 1:
        figure += p9.facet_wrap("panel", scales="free", ncol=columns)
        texts = {"x": "first objective", "y": "second objective"}
    else:
        texts = {axis: frame[f"{axis}_objective"].iloc[0] for axis in "xy"}
    figure += scales(tables, experiments, is_filled=False)
    return figure + p9.labs(**texts) + theme_of_size(0.8 + 3.6 * rows)
