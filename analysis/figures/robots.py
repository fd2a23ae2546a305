"""Figures of single robots, their ancestors, and of what is held against the thesis."""

import numpy as np
import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.statistics import t_quantile
from analysis.figures.forms import BAND_RUNS, NothingToDraw, Tables
from analysis.figures.style import in_order, label, paper, scales, whole
from analysis.measures.population_table import Numbers

_MEANT = {"final": "last populations", "born": "all ever judged"}
_ASIDE = 0.13
"""From one experiment to the next, by the distance of two numbers of extremities."""
_VERDICTS = {
    "reproduced": "#0072B2",
    "undecided": "#9A9A9A",
    "not reproduced": "#D55E00",
}


def variability(tables: Tables) -> p9.ggplot:
    """Return how far robots' fitness ranges while they live in an arena.

    Args:
        tables: ``variability``.

    Raises:
        NothingToDraw: no arena, or no two robots whose ranges differ.

    Source: Hupkes 2016, figure 6.8.
    """
    rows = tables.get("variability")
    if rows is None:
        raise NothingToDraw("no run has an arena")
    rows = rows.filter(pc.field("variability").is_valid())
    if len(set(rows["variability"].to_pylist())) <= 1:
        raise NothingToDraw("no two robots of an arena that were judged twice")
    frame = rows.to_pandas()
    return (
        p9.ggplot(frame, p9.aes("variability"))
        + p9.geom_density(p9.aes(fill="experiment"), alpha=0.25, colour="none")
        + p9.stat_density(
            p9.aes(colour="experiment", group="folder"),
            geom="line",
            size=0.4,
            alpha=0.8,
            position="identity",
        )
        + scales(rows["experiment"].to_pylist())
        + p9.coord_cartesian(xlim=(0, 1))
        + p9.labs(
            x="range of a robot's fitness / range of its contemporaries'", y="density"
        )
        + paper(3.6)
    )


def extremities_and_fitness(tables: Tables, by: str) -> p9.ggplot:
    """Return how fit robots are by their extremities, over runs.

    Args:
        tables: ``extremities``.
        by: "count" or "per_part".

    Raises:
        NothingToDraw: nobody was judged.

    Source: Hupkes 2016, figure 6.14.
    """
    rows = tables["extremities"].filter(pc.field("by") == by)
    if not rows.num_rows:
        raise NothingToDraw("nobody was judged")
    keys = ["experiment", "population", "bin"]
    made = rows.group_by(keys).aggregate(
        [("fitness", "mean"), ("fitness", "stddev"), ("fitness", "count")]
    )
    runs = np.asarray(made["fitness_count"], np.int64)
    mean = np.asarray(made["fitness_mean"], np.float64)
    # Arrow divides by the number of runs, an estimate by one less.
    error = np.asarray(made["fitness_stddev"]) / np.sqrt(np.maximum(runs - 1, 1))
    half = error * np.array([t_quantile(max(count - 1, 1)) for count in runs.tolist()])
    half[runs < BAND_RUNS] = np.nan
    width = 1.0 if by == "count" else 0.1
    places = np.asarray(made["bin"], np.float64) + (0.0 if by == "count" else 0.05)
    experiments = made["experiment"].to_pylist()
    places += _ASIDE * width * _aside(experiments)
    titles = [_MEANT[name] for name in made["population"].to_pylist()]
    panel = pa.DictionaryArray.from_arrays(
        pc.index_in(pa.array(titles), pa.array(list(_MEANT.values()))),
        list(_MEANT.values()),
    )
    shown = pa.table(
        {
            "experiment": made["experiment"],
            "panel": panel,
            "at": places,
            "fitness": mean,
            "low": np.maximum(mean - half, 0.0),
            "high": mean + half,
        }
    )
    axis = "extremities" if by == "count" else "extremities per part"
    return (
        p9.ggplot(shown.to_pandas(), p9.aes("at", "fitness"))
        + p9.geom_linerange(
            p9.aes(ymin="low", ymax="high", colour="experiment"),
            na_rm=True,
            size=0.5,
            alpha=0.6,
            show_legend=False,
        )
        + p9.geom_line(p9.aes(colour="experiment"), size=0.6)
        + p9.geom_point(p9.aes(colour="experiment"), size=1.3)
        + p9.facet_wrap("panel", ncol=2)
        + scales(experiments, is_filled=False)
        + p9.coord_cartesian(ylim=(0, 1.3 * float(mean.max()) or 1.0))
        + p9.labs(x=axis, y="mean fitness [m/s]")
        + paper(3.6)
    )


def _aside(experiments: list[str]) -> Numbers:
    """Return how far from the middle each row stands, so that none hides another."""
    names = in_order(experiments)
    spots = [names.index(name) - (len(names) - 1) / 2 for name in experiments]
    return np.array(spots, np.float64)


def lineages(tables: Tables) -> p9.ggplot:
    """Return all ancestors of the best robots, by when they were born and their rank.

    Args:
        tables: ``lineage``, as ``analysis.figures.family_tree.LINEAGE``.

    Raises:
        NothingToDraw: nobody who lives has parents.

    Source: Hupkes 2016, 6.17 and on, and the rank of eq. 6.1.
    """
    rows = tables.get("lineage")
    if not rows or not any(rows["parents"].to_pylist()):
        raise NothingToDraw("nobody who lives at the end has parents")
    lines: list[dict[str, object]] = []
    people = rows.to_pylist()
    known = {(row["experiment"], row["order"]): row for row in people}
    for row in people:
        for parent in row["parents"]:
            above = known[row["experiment"], parent]
            ends = {"to": above["number"], "to_rank": above["rank"]}
            lines.append({**row, **ends})
    names = [label(name) for name in in_order(rows["experiment"].to_pylist())]
    return (
        p9.ggplot(rows.select(["experiment", "number", "rank"]).to_pandas())
        + p9.geom_segment(
            p9.aes("number", "rank", xend="to", yend="to_rank", colour="experiment"),
            data=pa.Table.from_pylist(lines).drop_columns("parents").to_pandas(),
            size=0.3,
            alpha=0.5,
            show_legend=False,
        )
        + p9.geom_point(
            p9.aes("number", "rank", colour="experiment"),
            size=0.8,
            show_legend=len(names) > 1,
        )
        + scales(rows["experiment"].to_pylist(), is_filled=False)
        + p9.scale_y_continuous(breaks=whole)
        + p9.labs(x="number of birth", y="rank")
        + paper(4.2)
    )


def effects(tables: Tables) -> p9.ggplot:
    """Return the effects that the thesis's findings are judged by.

    Args:
        tables: ``findings``.

    Raises:
        NothingToDraw: no finding could be tested.
    """
    rows = tables["findings"].filter(pc.field("effect").is_valid())
    if not rows.num_rows:
        raise NothingToDraw("no two experiments of a finding have two finished runs")
    claims = [
        f"{row['figure']}  {row['claim']}  ({row['expected']})"
        for row in rows.to_pylist()
    ]
    named = rows.append_column("text", pa.array(claims))
    sure = named.filter(named["effect_low"].is_valid())
    figure = (
        p9.ggplot(named.to_pandas(), p9.aes("text", "effect", colour="verdict"))
        + p9.geom_hline(yintercept=0, colour="#999999", size=0.5)
        + p9.geom_point(size=2)
        + p9.scale_x_discrete(limits=claims[::-1])
        + p9.scale_colour_manual(_VERDICTS, name="")
        + p9.coord_flip(ylim=(-1, 1))
        + p9.labs(x="", y="effect")
        + paper(1.2 + 0.16 * len(claims), 9.0)
        + p9.theme(axis_text_y=p9.element_text(size=8))
    )
    if not sure.num_rows:
        return figure
    ends = p9.aes(ymin="effect_low", ymax="effect_high")
    return figure + p9.geom_linerange(ends, data=sure.to_pandas(), size=0.7)
