"""What one run's tables say: all measures, and the tables they make.

Everything is a function of the run's own tables. What a damaged table keeps from
being measured is left out and named; all else is measured.
"""

from collections.abc import Callable

import pyarrow as pa

from analysis.bodies import extremity_bins
from analysis.diversity import mean_distances
from analysis.interactions import interactions
from analysis.material import Material, Refusals
from analysis.migrants import migrants
from analysis.populations import populations
from analysis.robots import robots
from analysis.variability import variability
from schema.errors import RevolveError

_OTHERS: dict[str, Callable[[Material], pa.Table]] = {
    "robots": robots,
    "extremities": lambda run: extremity_bins(robots(run)),
    "variability": lambda run: variability(run.tables["fitness"]),
    "interactions": lambda run: interactions(
        run.births, *(run.tables[name] for name in ("fitness", "deaths", "touches"))
    ),
    "between": lambda run: mean_distances(run.census, run.trees),
    "migrants": lambda run: migrants(
        run.tables["migrations"], run.births, run.census, run.lines
    ),
}


def measure(
    run: Material, wanted: frozenset[str]
) -> tuple[dict[str, pa.Table], Refusals]:
    """Return all measures of a run.

    Args:
        run: its tables.
        wanted: which of variability, interactions, between and migrants have sense.

    Returns:
        Tables by name, each with the columns of ``analysis.outputs.schema`` less the
        run's name; and the measures that could not be had, with the reason.
    """
    found = {}
    found["populations"], refusals = populations(run)
    for name, function in _OTHERS.items():
        if name in {"robots", "extremities"} | wanted:
            try:
                found[name] = function(run)
            except RevolveError as error:
                refusals[name] = str(error)
    return found, refusals
