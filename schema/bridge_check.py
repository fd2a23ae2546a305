"""Whether the settings between off-line and on-line fit the rest of an experiment.

Evaluations of varying duration, judging the living anew, and a population of varying
size are an off-line island's; an arena has its own of each.
Source: Hupkes 2016, section 8.2.
"""

from schema.experiment import Experiment, Selection, steps_of


def culling_problem(experiment: Experiment) -> str:
    """Return why a population cannot be culled as a document says, or nothing."""
    selection = experiment.selection
    rules = selection.culling
    if rules is None:
        return ""
    where = "selection.culling"
    if experiment.arena is not None:
        return f"{where}: an arena has these rules in [arena]; leave one of them out"
    if selection.survivors != "best" or not selection.keep_parents:
        return (
            f"{where}: who is fit enough survives; selection.survivors must be "
            '"best" and selection.keep_parents true'
        )
    if problem := _floor_problem(selection):
        return f"{where}.{problem}"
    if round(rules.full_cull_share * rules.population_limit) < 1:
        return (
            f"{where}.full_cull_share: must make room for one of population_limit = "
            f"{rules.population_limit}, got {rules.full_cull_share:g}"
        )
    return ""


def _floor_problem(selection: Selection) -> str:
    rules = selection.culling
    if rules is None:
        return ""
    needed = selection.parents_needed
    if rules.population_floor < needed:
        return (
            f"population_floor: must be >= {needed}, so that there are always two "
            f"parents to choose, got {rules.population_floor}"
        )
    lowest = max(rules.population_floor + 1, selection.population)
    if rules.population_limit < lowest:
        return (
            "population_limit: must be > population_floor and >= "
            f"selection.population, {lowest}, got {rules.population_limit}"
        )
    return ""


def reevaluation_problem(experiment: Experiment) -> str:
    """Return why nobody can be judged anew, or nothing."""
    selection = experiment.selection
    if selection.reevaluation is None:
        return ""
    where = "selection.reevaluation"
    if experiment.arena is not None:
        return f"{where}: an arena judges all the time; leave one of them out"
    if not selection.keep_parents:
        return (
            f"{where}: nobody lives beyond a brood where selection.keep_parents is "
            "false"
        )
    return ""


def duration_problem(experiment: Experiment) -> str:
    """Return why evaluations cannot last as a document says, or nothing."""
    clock = experiment.simulation
    if clock.evaluation_s is None:
        return ""
    where = "simulation.evaluation_s"
    shortest, longest = clock.evaluation_s
    if experiment.arena is not None:
        return f"{where}: an arena's robots have no set time; leave it out"
    least = (clock.warmup_steps + clock.window_steps) * clock.timestep_s
    if steps_of(shortest, clock) < clock.warmup_steps + clock.window_steps:
        return (
            f"{where}: must be >= {least:g} s, warmup_steps and window_steps "
            f"together, got {shortest:g}"
        )
    if longest < shortest:
        return f"{where}: must be [shortest, longest], got [{shortest:g}, {longest:g}]"
    return ""
