"""The figures, in the order of the thesis; each a function of tables of measures."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from analysis.figures.bench import arena_speed, spider_speed
from analysis.figures.forms import Panel, Tables, over_births, over_runs
from analysis.figures.islands import between, fitness_by_island, migration_graph
from analysis.figures.robots import (
    effects,
    extremities_and_fitness,
    lineages,
    variability,
)

Draw = Callable[[Tables], Any]

_SPREAD = (
    "Points are finished runs, boxes (of fewer than five runs: bars at the median) sum "
    "them up, and violins show the robots of all their last populations."
)
THE_BIRTHS = "the runs' births"
"""A source that is no table of measures."""
_BENCHMARK = "the benchmark's file"
_COURSE = (
    "Lines are means over runs, bands their 95 % intervals where there are three runs, "
    "as far as the axis goes."
)


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure that can be drawn if the tables allow it.

    Attributes:
        number: of the thesis; of figures of our own, "A" and on.
        title: what it is about.
        caption: what is seen.
        source: the tables whose rows it shows.
        draw: returns it, or raises ``NothingToDraw`` with the reason.
    """

    number: str
    title: str
    caption: str
    source: tuple[str, ...]
    draw: Draw


def _spread(number: str, title: str, *panels: Panel) -> Figure:
    return Figure(
        number,
        title,
        _SPREAD,
        ("outcomes", "robots"),
        lambda tables: over_runs(tables, *panels),
    )


def _course(number: str, title: str, measure: str, text: str) -> Figure:
    draw = partial(over_births, measure=measure, text=text)
    return Figure(number, title, _COURSE, ("progression",), draw)


FIGURES: tuple[Figure, ...] = (
    Figure("6.1", "Speed of an arena by its population",
           "Simulated over wall time of random robots in one arena: points are "
           "repetitions, the line joins their means, the dashed one is the thesis's "
           "fit of its own machine; above the thin line is faster than real time.",
           (_BENCHMARK,), arena_speed),
    _spread("6.2", "Fitness at the end", Panel("fitness", "fitness [m/s]")),
    _course("6.3", "Fitness over births", "fitness", "mean fitness [m/s]"),
    _spread("6.4", "Unique ancestors per robot of the last population",
            Panel("ancestors_per_robot", "unique ancestors per robot")),
    _course("6.5a", "Diversity over births", "diversity", "mean tree edit distance"),
    _spread("6.5b", "Diversity at the end",
            Panel("diversity", "mean tree edit distance")),
    _spread("6.6", "Rank at the end", Panel("rank", "rank")),
    _course("6.7", "Retention over births", "retention",
            "share alive 120 births later"),
    Figure("6.8", "Variability of fitness on-line",
           "Density over robots of the range of a robot's fitness by the range of all "
           "its contemporaries'; thin lines are single runs.",
           ("variability",), variability),
    _spread("6.9", "Parts at the end", Panel("parts", "parts")),
    _spread("6.11", "Joints at the end",
            Panel("active_joints", "active joints"),
            Panel("passive_joints", "passive joints"), Panel("joints", "all joints")),
    _spread("6.12", "Joints per part at the end",
            Panel("active_joints_per_part", "active joints per part"),
            Panel("passive_joints_per_part", "passive joints per part"),
            Panel("joints_per_part", "all joints per part")),
    _spread("6.13", "Extremities at the end",
            Panel("extremities", "extremities"),
            Panel("extremities_per_part", "extremities per part")),
    Figure("6.14a", "Fitness by the number of extremities",
           "Points are means over the runs that have such robots, bars their 95 % "
           "intervals where there are three runs, as far as the axis goes; left the "
           "last populations, right all who were ever judged.",
           ("extremities",), partial(extremities_and_fitness, by="count")),
    Figure("6.14b", "Fitness by extremities per part",
           "As before, in bins of 0.1 whose middles the points are at.",
           ("extremities",), partial(extremities_and_fitness, by="per_part")),
    _spread("6.15", "Touch sensors at the end",
            Panel("touch_sensors", "touch sensors"),
            Panel("without_touch", "share of robots without")),
    _spread("6.16", "Hidden neurons at the end",
            Panel("hidden", "hidden neurons"),
            Panel("hidden_per_part", "hidden neurons per part")),
    Figure("6.17", "All ancestors of the best robots",
           "Each point is an ancestor of the fittest robot of an experiment's last "
           "populations, by its number of birth on its island; each line leads to a "
           "parent.",
           (THE_BIRTHS,), lineages),
    Figure("7.1", "Speed of an arena of spiders by its population",
           "Simulated over wall time of equal spiders on a grid: points are "
           "repetitions, the line joins their means.",
           (_BENCHMARK,), spider_speed),
    _spread("A", "Connections at the end",
            Panel("connections", "connections"),
            Panel("connections_per_part", "connections per part")),
    Figure("B", "Fitness of islands",
           "Each line is an island's mean fitness, of all runs that have islands.",
           ("populations",), fitness_by_island),
    Figure("C", "Migration between islands",
           "An arrow is as thick as migrants were many; its colour says for how many "
           "of them a descendant, or the migrant itself, lives at the end.",
           ("migrants",), migration_graph),
    Figure("D", "Diversity within and between islands",
           "Mean tree edit distance of pairs on one island, and of pairs on two.",
           ("between",), between),
    Figure("E", "Robots that touched another",
           _SPREAD, ("outcomes",),
           lambda tables: over_runs(tables, Panel("touched", "share of robots"))),
    Figure("F", "The thesis's findings as effects",
           "Cliff's delta of a over b with its 95 % interval, or where one experiment "
           "is held against a number the rank-biserial correlation, beside what "
           "the thesis says: > more, < less, = alike.",
           ("findings",), effects),
)  # fmt: skip
"""In the order of the thesis, then ours."""
