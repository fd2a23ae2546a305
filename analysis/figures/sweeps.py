"""Maps of a sweep: outcomes of its runs by the settings that differ."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.comparison.statistics import mean_difference
from analysis.figures.forms import NothingToDraw, Tables
from analysis.figures.look import BLUE, INK, LOOK
from analysis.measures.population_table import Numbers

MEASURES = {
    "fitness": "mean fitness",
    "fitness_best": "best fitness",
    "late_gain": "share of the gain in fitness\nin the second half of births",
    "diversity": "mean tree edit distance",
    "size": "living robots",
}
"""Outcomes that a map shows: how good a setting is, and how stable.

A small share in the second half says that fitness has levelled off; the number of
living robots says what population an arena keeps.
"""
_PANEL_IN = 2.3
_MOST_CELLS = 40
"""Cells of a map from which on their numbers are not written."""


class SweepRuns(NamedTuple):
    """Finished runs of one sweep, a row each, with settings and known measures."""

    settings: list[str]
    frame: Any  # a data frame; pandas has no types
    measures: list[str]


def sweep_runs(tables: Tables, experiment: str) -> SweepRuns:
    """Return the finished runs of a sweep with their settings and outcomes.

    Raises:
        NothingToDraw: no run of it is finished.
    """
    rows = tables["sweeps"].to_pandas()
    rows = rows[rows["experiment"] == experiment]
    settings = list(dict.fromkeys(rows["setting"]))
    chosen = rows["number"].where(rows["number"].notna(), rows["value"])
    points = rows.assign(chosen=chosen).pivot(
        index="folder", columns="setting", values="chosen"
    )
    points = points.infer_objects()
    outcomes = tables["outcomes"].to_pandas().merge(points, on="folder")
    if outcomes.empty:
        raise NothingToDraw(f"no run of the sweep {experiment} is finished")
    # A sweep of fitness is divided into experiments, each with one value of those.
    settings = [name for name in settings if outcomes[name].nunique() > 1] or settings
    known = [name for name in MEASURES if outcomes[name].notna().any()]
    # Off-line populations have a fixed size.
    shown = [name for name in known if name != "size" or outcomes[name].nunique() > 1]
    return SweepRuns(settings, outcomes[[*settings, *shown]], shown)


def sweep_map(tables: Tables, experiment: str) -> Figure:
    """Return the outcomes of a sweep's runs by its settings.

    One setting: a line; two settings with repeated values: a map of the means over
    runs; otherwise one panel per setting, each point a run.

    Raises:
        NothingToDraw: no run of it is finished.
    """
    runs = sweep_runs(tables, experiment)
    is_map, columns = _is_map(runs), len(runs.settings)
    shown = [None] if is_map else runs.settings
    cells = [(name, setting) for name in runs.measures for setting in shown]
    most = max(1, int(LOOK.get().width_in / _PANEL_IN))
    wide = min(most, columns if columns > 1 and not is_map else len(cells))
    high = -(-len(cells) // wide)
    size = (LOOK.get().width_in, (_PANEL_IN + 0.3 * is_map) * high)
    figure, axes = plt.subplots(high, wide, figsize=size, squeeze=False)
    for panel, (measure, setting) in zip(axes.flat, cells, strict=False):
        if setting is None:
            _draw_map(runs, panel, measure)
        else:
            _draw_points(runs, panel, measure, setting)
    for panel in axes.flat[len(cells) :]:
        panel.set_visible(False)
    figure.tight_layout()
    return figure


def sweep_caption(tables: Tables, experiment: str) -> str:
    """Return what the map shows, and the two settings with the highest mean fitness."""
    runs = sweep_runs(tables, experiment)
    frame = runs.frame
    if "fitness" not in runs.measures:
        frame = frame.assign(fitness=np.nan)
    points = [
        (values, group.to_numpy(np.float64))
        for values, group in frame.groupby(runs.settings)["fitness"]
    ]
    has_means = any(len(fitness) > 1 for _, fitness in points)
    known = [(values, fitness[~np.isnan(fitness)]) for values, fitness in points]
    known = [point for point in known if len(point[1])]
    few = "Means over finished runs" if has_means else "Finished runs"
    line = "; the line joins means over runs" * has_means
    kind = "" if _is_map(runs) else f" Each point is a run{line}."
    return (
        f"{few} at each point of the sweep ({len(runs.frame)} runs at {len(points)} "
        f"points).{kind}{_best_points(runs.settings, known)}"
    )


def _best_points(settings: Sequence[str], points: Sequence[tuple[Any, Numbers]]) -> str:
    """Return which point has the highest mean fitness, and how sure this is.

    Points are values of the settings, and fitness of the runs that have any.
    """
    if not points:
        return ""

    def text(values: Any, fitness: Numbers) -> str:  # noqa: ANN401 - of any settings
        pairs = zip(settings, values, strict=True)
        at = ", ".join(f"{setting} = {_text(value)}" for setting, value in pairs)
        spread = f" (sd {fitness.std(ddof=1):.2g})" if len(fitness) > 1 else ""
        return f"{at}: {fitness.mean():.3g}{spread}"

    ordered = sorted(points, key=lambda point: -point[1].mean())
    best = f" Mean fitness is highest at {text(*ordered[0])}"
    if len(ordered) == 1:
        return f"{best}."
    best += f", then at {text(*ordered[1])}."
    first, second = ordered[0][1], ordered[1][1]
    if min(len(first), len(second)) == 1:
        return f"{best} One run at a point has no spread; --repeats adds runs."
    difference, low, high = mean_difference(first, second)
    if np.isnan(low):
        return f"{best} All runs of a point are equal: no interval of the difference."
    verdict = "is shown" if low > 0 else "is not shown"
    return (
        f"{best} The difference of these two, {difference:.2g} (95 % interval "
        f"{low:.2g} to {high:.2g}, Welch's t), {verdict}; the best of many points is "
        "often best by chance."
    )


def _is_map(runs: SweepRuns) -> bool:
    """Return whether two settings cross: both have values that repeat."""
    if len(runs.settings) != 2:  # noqa: PLR2004 - the axes of a map
        return False
    points = runs.frame[runs.settings].drop_duplicates()
    return all(points[name].nunique() < len(points) for name in runs.settings)


def _draw_map(runs: SweepRuns, panel: Axes, measure: str) -> None:
    across, up = runs.settings
    means = runs.frame.pivot_table(
        index=up, columns=across, values=measure, dropna=False
    )
    picture = panel.imshow(means, origin="lower", aspect="auto", cmap="Blues")
    panel.set_xticks(range(means.shape[1]), map(_text, means.columns))
    panel.set_yticks(range(means.shape[0]), map(_text, means.index))
    panel.set(xlabel=across, ylabel=up)
    panel.set_title(MEASURES[measure], fontsize=9, color=INK)
    panel.figure.colorbar(picture, ax=panel)
    if means.size > _MOST_CELLS:
        return
    middle = float(np.nanmean([np.nanmin(means), np.nanmax(means)]))
    for (row, column), value in np.ndenumerate(means.to_numpy()):
        colour = "white" if value > middle else "black"
        text = f"{value:.2g}"
        panel.text(column, row, text, ha="center", va="center", size=7, color=colour)


def _draw_points(runs: SweepRuns, panel: Axes, measure: str, setting: str) -> None:
    frame = runs.frame[[setting, measure]].dropna()
    values = frame[setting]
    is_number = values.dtype.kind in "if"
    x = values if is_number else values.map(str)
    panel.scatter(x, frame[measure], s=12, color=BLUE, alpha=0.6)
    means = frame.groupby(setting)[measure].mean()
    if len(means) < len(frame):
        at = means.index if is_number else means.index.map(str)
        panel.plot(at, means, color=INK, linewidth=1)
    panel.set(xlabel=setting)
    panel.set_ylabel(MEASURES[measure], fontsize=8)


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
