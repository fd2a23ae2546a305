"""Catalogue of the figures: number, title, caption and drawing function."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from analysis.figures.bench import speed
from analysis.figures.courses import (
    changes_over_births,
    course_caption,
    measures_over_births,
    over_births,
)
from analysis.figures.ecosystems import ages_at_death, ground_map, life_courses
from analysis.figures.findings import effects
from analysis.figures.forms import (
    NothingToDraw,
    Panels,
    Tables,
    fitness_note,
    over_runs,
    spread_caption,
)
from analysis.figures.islands import between, fitness_by_island, migration_graph
from analysis.figures.learning import bodies_saved, learning_curves, learning_gain
from analysis.figures.robots import (
    extremities_and_fitness,
    fronts,
    lineages,
    variability,
)
from analysis.figures.style import file_name

BIRTHS = "the births tables of the runs"
"""A source that is not a table of measures."""
_BENCHMARK = "the benchmark file"
_NO_RULES = "no arena has rules of its own"

Section = Literal[
    "sweeps",
    "fitness",
    "robots",
    "bodies",
    "diversity",
    "islands",
    "measures",
    "learning",
    "speed",
    "thesis",
]
"""Section of the report that shows a figure."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the catalogue.

    Attributes:
        number: number in the thesis; a letter for a figure that is not in it.
        title: subject of the figure.
        caption: description of what the figure shows, or a function that returns it
            for the tables that the figure was drawn from.
        source: tables whose rows it shows.
        draw: returns the drawing, or raises ``NothingToDraw`` with the reason.
        section: section of the report.
        subject: words of the file name; those of the title if empty.
        nothing: reason why it is not drawn if its first source has no rows; empty if
            ``draw`` says it.
        texts: texts of its marks in the report, as of ``interactive``.
    """

    number: str
    title: str
    caption: str | Callable[[Tables], str]
    source: tuple[str, ...]
    draw: Callable[[Tables], Any]
    section: Section
    subject: str = ""
    nothing: str = ""
    texts: Mapping[str, str] = field(default_factory=dict)

    def drawn(self, tables: Tables) -> Any:  # noqa: ANN401 - of two libraries
        """Return the drawing.

        Raises:
            NothingToDraw: the tables lack its data.
        """
        if self.nothing and not tables.get(self.source[0]):
            raise NothingToDraw(self.nothing)
        return self.draw(tables)

    @property
    def stem(self) -> str:
        """Name of the figure's files without ending, for example ``A-connections``."""
        number = self.number.partition("-")[0]
        return file_name(f"{number}-{self.subject or self.title.lower()}")


def missing(number: str, why: str) -> Figure:
    """Return a figure that cannot be drawn."""
    return Figure(number, "", "", ("",), list, "robots", nothing=why)


@dataclass(frozen=True, slots=True)
class DrawnFigure:
    """A figure that was drawn, its caption, its files, and itself as PNG."""

    figure: Figure
    caption: str
    files: Sequence[Path]
    picture: bytes


def _spread(
    section: Section, number: str, title: str, panels: Panels, note: str = ""
) -> Figure:
    return Figure(
        number,
        title,
        partial(spread_caption, panels=panels, note=note),
        ("outcomes", "robots"),
        partial(over_runs, panels=panels),
        section,
    )


def _course(
    section: Section, number: str, title: str, measure: str, text: str
) -> Figure:
    return Figure(
        number,
        title,
        partial(course_caption, measure=measure),
        ("populations", "progression"),
        partial(over_births, measure=measure, text=text),
        section,
    )


def _of_cells(number: str, title: str, measure: str, text: str) -> Figure:
    figure = _course("diversity", number, title, measure, text)
    source = ("cells", *figure.source)
    return replace(figure, source=source, nothing="no experiment has a [grid]")


def _with_note(tables: Tables, text: str) -> str:
    """Return a caption, and what the panels are if fitness functions differ."""
    return text + fitness_note(tables)


FIGURES: tuple[Figure, ...] = (
    Figure("6.1", "Speed of an arena by its population",
           "Simulated by wall-clock time of random robots in one arena, on a "
           "logarithmic axis. Points are repetitions, the solid line joins their "
           "means, the dashed line is the thesis's fit for its own machine. Values "
           "above 1 are faster than real time.",
           (_BENCHMARK,), partial(speed, kind="arena"), "speed"),
    _spread("fitness", "6.2", "Fitness at the end", {"fitness": "fitness"}),
    _course("fitness", "6.3", "Fitness over births", "fitness", "mean fitness"),
    _spread("diversity", "6.4", "Unique ancestors per robot of the last population",
            {"ancestors_per_robot": "unique ancestors per robot"}),
    _course("diversity", "6.5a", "Diversity over births", "diversity",
            "mean tree edit distance"),
    _spread("diversity", "6.5b", "Diversity at the end",
            {"diversity": "mean tree edit distance"}),
    _spread("diversity", "6.6", "Rank in ancestry at the end",
            {"rank": "rank (founders 1, children one more)"}),
    _course("diversity", "6.7", "Retention over births", "retention",
            "share alive 120 births later"),
    Figure("6.8", "Variability of fitness on-line",
           "Density over robots of the range of a robot's fitness divided by the range "
           "of fitness in the population during its life. Thin lines are single runs.",
           ("variability",), variability, "islands", nothing="no run has an arena"),
    _spread("bodies", "6.9", "Parts at the end", {"parts": "parts"}),
    _spread("bodies", "6.11", "Joints at the end",
            {"active_joints": "active joints",
             "passive_joints": "passive joints", "joints": "all joints"}),
    _spread("bodies", "6.12", "Joints per part at the end",
            {"active_joints_per_part": "active joints per part",
             "passive_joints_per_part": "passive joints per part",
             "joints_per_part": "all joints per part"}),
    _spread("bodies", "6.13", "Extremities at the end",
            {"extremities": "extremities",
             "extremities_per_part": "extremities per part"}),
    Figure("6.14a", "Fitness by the number of extremities",
           partial(_with_note, text="Points are means over the runs that have such "
           "robots. Bars are 95 % intervals of the mean, shown for five or more runs. "
           "Left: the last populations. Right: all robots ever evaluated."),
           ("extremities",), partial(extremities_and_fitness, by="count"), "bodies",
           nothing="no robot was evaluated"),
    Figure("6.14b", "Fitness by extremities per part",
           "As figure 6.14a, in bins of 0.1; each point is at the middle of its bin.",
           ("extremities",), partial(extremities_and_fitness, by="per_part"), "bodies",
           nothing="no robot was evaluated"),
    _spread("bodies", "6.15", "Touch sensors at the end",
            {"touch_sensors": "touch sensors",
             "without_touch": "share of robots without any"}),
    _spread("bodies", "6.16", "Hidden neurons at the end",
            {"hidden": "hidden neurons",
             "hidden_per_part": "hidden neurons per part"}),
    Figure("6.17", "All ancestors of the best robots",
           "Each point is an ancestor of the fittest robot of an experiment's last "
           "populations; the horizontal axis is its number of birth on its island, the "
           "vertical one its rank: 1 for founders, else one more than the greatest of "
           "its parents. Each line leads to a parent.",
           (BIRTHS,), lineages, "diversity"),
    Figure("7.1", "Speed of an arena of spiders by its population",
           "Simulated by wall-clock time of identical spiders on a grid, on a "
           "logarithmic axis. Points are repetitions, the line joins their means.",
           (_BENCHMARK,), partial(speed, kind="spider"), "speed"),
    _spread("bodies", "A", "Connections at the end",
            {"connections": "connections",
             "connections_per_part": "connections per part"},
            "Connections are those of the genome, also those that lead to no neuron "
            "of the robot; the robot's own brain and file have only the others."),
    Figure("B", "Fitness of islands",
           partial(_with_note, text="Each line is the mean fitness of one island, for "
           "all runs with several islands."),
           ("populations",), fitness_by_island, "islands"),
    Figure("C", "Migration between islands",
           "The width of an arrow is the number of migrants. Its colour is the share "
           "of migrants that are alive, or have a living descendant, at the end.",
           ("migrants",), migration_graph, "islands",
           nothing="no run has several islands with migrants"),
    Figure("D", "Diversity within and between islands",
           "Mean tree edit distance of pairs of robots on the same island, and of "
           "pairs on different islands.",
           ("between",), between, "islands"),
    _spread("islands", "E", "Robots that touched another robot",
            {"touched": "share of robots"}),
    Figure("F", "The thesis's findings as effects",
           "Each row is a pair of experiments A/B, with Cliff's delta and its 95 % "
           "interval, or an experiment that is compared with a number, with the "
           "difference divided by its margin. 1, 2 and 3 are the scenarios, random is "
           "no reproduction, drift no selection. In brackets: what the thesis finds. "
           "Shaded: negligible effects; within the dotted lines two experiments are "
           "alike. † marks what says nothing about evolution.",
           ("findings",), effects, "thesis"),
    Figure("H", "Measures over births",
           "Mean over the population of each measure that the experiment names. Each "
           "line is an island of a run; units are those of the measure.",
           ("named_measures",), measures_over_births, "measures",
           nothing="no experiment names measures"),
    Figure("I", "Body and brain change over births",
           "Mean distance between a child and its first parent, the one whose copy was "
           "changed, by the child's number of birth. Left: bodies, tree edit distance. "
           "Right: brains, neurons and connections that are new, lost or changed "
           "(changes count 0 to 1). Thick lines are means over runs, thin lines runs.",
           ("brains",), changes_over_births, "bodies", nothing="no robot has parents"),
    Figure("J", "Learning curves",
           "Best fitness of a newborn so far by trial: the line is the median over all "
           "robots of a run, the band their quartiles, both as means over runs. Trial "
           "0 is the brain at birth; failed trials count 0.",
           ("learning_curves",), learning_curves, "learning",
           nothing="no robot learns"),
    Figure("K", "Fitness at birth and after learning",
           "Medians over the newborns of each interval of births, with the brain at "
           "birth and with the best one that they tried; bands are quartiles. The "
           "distance of the lines is what learning gains.",
           ("learning",), learning_gain, "learning", nothing="no robot learns"),
    Figure("L", "Bodies that learning saved",
           "Share of newborns that are in the next recorded population, after the "
           "founders; in an arena in the second one recorded since they are mature. "
           "Learning has saved a body if its robot is there although its fitness at "
           "birth is below that of each robot of that population.",
           ("learning",), bodies_saved, "learning", nothing="no robot learns"),
    Figure("M", "Population, energy and births over time",
           "Of arenas with rules of their own, by simulated minute: means over samples "
           "of the living robots and of their energy, and births, founders included. "
           "Each line is an arena. A line ends when no robot is left.",
           ("life_courses",), life_courses, "islands", nothing=_NO_RULES),
    Figure("N", "Ages at death",
           "Ages of robots when they died, by reason, in arenas with rules of their "
           "own; in brackets the number of robots. Those that live at the end are left "
           "out.",
           ("lifespans",), ages_at_death, "islands", nothing=_NO_RULES),
    Figure("O", "Map of births and matings",
           "Each point is the place of a robot's birth, larger the more children it "
           "had. Lines join the places of birth of two parents; the colour is the "
           "share of the parents and their ancestors that both have in common. Discs "
           "are patches, with the mean of what they hold. The first four arenas with "
           "rules of their own are shown.",
           ("birth_places", "couples", "patch_means"), ground_map, "islands",
           nothing=_NO_RULES),
    _of_cells("Q", "Coverage over births", "coverage",
              "share of cells reached so far"),
    _of_cells("R", "QD score over births", "qd_score", "QD score"),
    _of_cells("T", "Novelty over births", "novelty",
              "distance to the 5 nearest earlier births"),
    Figure("U", "Pareto fronts",
           "All births in the first two objectives, pale, and those that no birth of "
           "their island dominates in all objectives, joined by a line for each run "
           "and island.",
           ("fronts",), fronts, "diversity", nothing="no experiment has objectives"),
)  # fmt: skip
"""Figures of the thesis in its order, then further figures."""
