"""The tables that `revolve analyze` writes: columns, units and meanings.

A run is identified by ``experiment`` and ``folder``: two folders may both contain the
experiment's run 0, with different seeds. Births are counted per island.
"""

import pyarrow as pa

_KINDS = {
    "run": pa.int32(),
    "seed": pa.uint64(),
    "island": pa.int32(),
    "birth_island": pa.int32(),
    "is_last": pa.bool_(),
    "is_failed": pa.bool_(),
    "is_front": pa.bool_(),
    "near_automatic": pa.bool_(),
    "kept": pa.bool_(),
    "saved": pa.bool_(),
}
_RUN = {"experiment": "name of the experiment", "folder": "path of the run folder"}
_HERE = {**_RUN, "island": "number of the island"}
_ISLAND = {**_HERE, "births": "births there so far"}
_ROBOT = {"birth_island": "island of birth", "birth": "number of birth there"}

BODY = {
    "parts": "nodes of the body tree",
    "active_joints": "joints with a motor",
    "passive_joints": "joints without a motor",
    "joints": "active and passive joints",
    "extremities": "leaves of the body tree; 1 for a single core",
    "touch_sensors": "touch sensor parts",
    "hidden": "hidden neurons",
    "connections": "connections of the genome, including unresolvable ones",
}
"""Sizes of a robot, in the order of the thesis."""

PER_PART = {
    f"{name}_per_part": f"{name} divided by parts"
    for name in BODY
    if name not in {"parts", "touch_sensors"}
}
"""Sizes of a robot divided by its number of parts."""

POPULATION = {
    "size": "living robots",
    "judged": "living robots whose fitness counts: off-line all, on-line mature ones",
    "fitness": "mean of judged robots, in the unit of the fitness function",
    "fitness_best": "maximum of judged robots, in the same unit",
    "rank": "mean of judged robots (thesis eq. 6.1)",
    "ancestors": "different ancestors of all judged robots together",
    "ancestors_per_robot": "ancestors divided by judged",
    "diversity": "mean tree edit distance of pairs of living robots",
    "retention": "share of living robots that are still alive 120 births later",
    "phylogenetic_diversity": "branches of the tree of living robots and their first "
    "parents up to the founders, each of length 1",
    "coverage": "share of the grid's cells that the births so far have reached",
    "qd_score": "sum over these cells of the greatest fitness so far minus grid.offset",
    "archive_entropy": "entropy of the births so far over the grid's cells [nats]",
    "hypervolume": "volume that the births so far dominate: fitness above grid.offset "
    "and the grid's measures as shares of their ranges, those of grid.minimised from "
    "the other end; null for more than two measures",
    "novelty": "mean over the births since the population before of the distance to "
    "the 5 nearest earlier births, in measures of the grid as shares of their ranges",
    "foreign": "share of living robots that, or whose ancestors, were born elsewhere",
    **{name: f"mean of judged robots: {what}" for name, what in BODY.items()},
    **{name: f"mean of judged robots: {what}" for name, what in PER_PART.items()},
    "without_touch": "share of judged robots without touch sensors",
    "one_touch": "share of judged robots with one touch sensor",
    "two_touch": "share of judged robots with two or more touch sensors",
    "recurrent": "mean of judged robots: share of weight that lies on cycles",
    "sensed": "mean of judged robots: share of motors that a sensor can influence",
}
"""Measures of a population at a number of births."""

OWN = "measures."
"""Start of the names of an experiment's own measures among other outcomes."""
OUTCOME = {
    "births": "births of the comparison: the most that all compared runs reach",
    **POPULATION,
    "retention": "share of living robots that are still alive 120 births later, as the "
    "mean over the run's births",
    "late_gain": "share of the gain in fitness in the second half of births",
    "late_rise": "mean fitness over the last tenth of births minus that over the tenth "
    "that ends at half of the births, of populations as many births apart as there are "
    "founders",
    "early_drop": "share of the loss of diversity in the first tenth of births",
    "early_diversity": "mean diversity over the first tenth of births, of such "
    "populations",
    "diversity_change": "diversity of the last population minus that of the founders",
    "parts_change": "parts of the last population minus those of random robots",
    "touch_sensors_change": "touch sensors, last population minus random robots",
    "hidden_change": "hidden neurons, last population minus random robots",
    "extremities_fitness": "rank correlation of fitness and extremities, all robots",
    "extremities_per_part_fitness": "the same for extremities per part",
    "extremities_slope": "change of fitness per extremity, of all robots of four or "
    "more (least squares)",
    "variability": "median of the robots' variability (on-line)",
    "touched": "share of robots that ever touched another robot (on-line)",
    "between": "mean tree edit distance between islands",
    "gain": "fitness of the last population minus that of the founders",
    "size_mean": "mean over the run's births of the number of living robots",
    "retention_fitness": "rank correlation of retention and fitness over births",
    "parts_fitness": "rank correlation of fitness and parts, all robots",
    "family_distance": "distance within the best robot's family / among founders",
    "family_founders": "number of founders whose parts are in that family",
    "later_fitness": "mean fitness of the best robot of the last population, alone, in "
    "the four windows after that of its evaluation",
    "sustained": "later_fitness divided by the fitness in the window of its evaluation",
    "kept_fitness": "share of its fitness that the best robot keeps under changes of "
    "time step, friction and start (revolve robustness)",
    "touching": "contact time of robots divided by their lifetimes; simultaneous "
    "contacts count separately (on-line)",
    "real_time_factor": "simulated by wall-clock time of 30 robots (bench arena)",
}
"""Outcome of a run: one number per measure, by which experiments are compared."""

_TWO_SAMPLES = {
    "runs_a": "number of runs of a",
    "runs_b": "number of runs of b",
    "mean_a": "mean over runs of a",
    "mean_b": "mean over runs of b; the reference if there is no b",
    "median_a": "median over runs of a",
    "median_b": "median over runs of b; the reference if there is no b",
    "difference": "mean_a - mean_b",
    "difference_low": "lower end of its 95 % interval (Welch's t over runs)",
    "difference_high": "upper end of that interval",
    "effect": "-1..1; Cliff's delta of a and b, or rank-biserial correlation of a",
    "effect_low": "lower end of delta's 95 % interval (Newcombe's score)",
    "effect_high": "upper end of that interval",
    "p": "two-sided exact p value; null in comparison if all runs are equal",
    "q": "p value corrected for all tests of the table (Benjamini-Hochberg)",
}

OUTPUTS: dict[str, dict[str, str]] = {
    "runs": {
        **_RUN,
        "run": "number of the repeat",
        "seed": "seed of the run",
        "run_id": "identifier of the run, a column of all tables in its folder; null "
        "if its description is damaged",
        "state": "finished, stopped or running (also if it was killed)",
        "births": "recorded births of all islands",
        "planned": "births of all islands in a finished run",
        "islands": "number of islands",
        "differs": "settings that differ from most runs of the same experiment name, "
        "or from those of the experiment that is named at the end",
        "function": "fitness function",
        "failures": "failed evaluations, and robots of arenas whose physics diverged",
        "duration_s": "time from the start to the end of the run, pauses included [s]",
        "fitness_function": "fitness function, its parameters and the digest of its "
        "source; only runs with the same text have comparable fitness",
        "plugins": "plug-in modules and the digests of their sources",
        "arena_births": "recorded births in arenas; null without an arena",
        "arena_living": "robots in the last recorded populations of the arenas; null "
        "without an arena",
        "deaths": "robots of arenas that died; null without an arena",
        "simulated_s": "simulated time of the arenas up to the last sample of fitness; "
        "null without an arena [s]",
    },
    "populations": {**_ISLAND, **POPULATION},
    "robots": {
        **_RUN,
        "island": "island on which it had this fitness; copies of migrants are judged "
        "on several islands, and the greatest fitness counts",
        **_ROBOT,
        "is_last": "whether it is judged in an island's last population",
        "fitness": "last fitness, or the mean of its evaluations if selection takes "
        "that; off-line 0 if the evaluation failed",
        "rank": "rank (thesis eq. 6.1)",
        "ancestors": "number of different ancestors",
        **BODY,
        **PER_PART,
        "fitness_max": "greatest fitness recorded at a birth, or the last one; in an "
        "arena it can be greater than the last",
        "births": "births on its island up to its own; in an arena the founder with "
        "the highest number is born first",
        "is_failed": "whether all its evaluations failed, which counts as 0, or as "
        "the least fitness below 0",
        "later_fitness": "of the fittest robot of the last populations, simulated "
        "alone: mean fitness in the four windows after that of its evaluation; null of "
        "others",
        "sustained": "later_fitness divided by the fitness in the window of its "
        "evaluation, also alone; null if that is not positive",
    },
    "extremities": {
        **_RUN,
        "population": "'final': last populations; 'born': all robots ever evaluated",
        "by": "'count': by extremities; 'per_part': by extremities_per_part",
        "bin": "number of extremities, or lower end of a bin of width 0.1",
        "robots": "number of robots in the bin",
        "fitness": "mean fitness of the bin",
    },
    "brains": {
        **_RUN,
        **_ROBOT,
        "body_change": "tree edit distance to the first parent; null for founders",
        "brain_change": "neurons and connections that are new or lost, and the sum of "
        "the changes of all others, 0..1 each, against the first parent; null for "
        "founders and for parts without identity",
        "brain_varied": "part of brain_change: the sum of the changes",
        "brain_new": "part of brain_change: new neurons and connections",
        "brain_lost": "part of brain_change: lost neurons and connections",
        "recurrent": "share of the weight of connections that lies on cycles; "
        "connections to oscillators, which ignore them, are left out",
        "sensed": "share of motors that a sensor can influence",
    },
    "variability": {
        **_RUN,
        "island": "island that it lived on",
        **_ROBOT,
        "samples": "fitness samples of the mature robot",
        "fitness_range": "greatest minus least of its fitness",
        "population_range": "range of all fitness samples during its life",
        "variability": "fitness_range divided by population_range",
    },
    "interactions": {
        **_HERE,
        "robots": "robots that lived there",
        "lived_s": "sum of their lifetimes [s]",
        "pairs": "pairs of robots that ever touched",
        "touched": "share of robots that ever touched another robot",
        "touching": "contact time, counted for both robots and simultaneous contacts "
        "separately, divided by lived_s",
    },
    "between": {
        **_RUN,
        "births": "births on each island",
        "islands": "number of islands with a population",
        "within": "mean over islands of their diversity",
        "between": "mean tree edit distance of pairs on different islands",
    },
    "families": {
        **_ISLAND,
        "birth_island": "island of birth of the fittest robot of the last population",
        "birth": "number of birth of that robot there",
        "members": "robots of its family: its ancestors of four levels, and itself",
        "distance": "mean tree edit distance of pairs of the family",
        "founder_distance": "mean tree edit distance of pairs of robots born first",
        "founders": "founders whose parts are in the family; null if unknown",
    },
    "migrants": {
        **_RUN,
        "epoch": "migration epoch",
        **_ROBOT,
        "island": "island that it left",
        "to": "island that it went to",
        "fitness": "fitness when it left",
        "descendants": "descendants born on island 'to'",
        "living": "descendants in that island's last population, itself included",
        "reached": "islands whose last population contains it or a descendant",
    },
    "cells": {
        **_HERE,
        "cell": "bins of the grid's measures, from 0, such as 3/7",
        **_ROBOT,
        "fitness": "greatest fitness that a robot of the cell had",
        "births": "births on the island when it was reached",
        "robots": "evaluations in the cell; on-line samples of fitness",
    },
    "fronts": {
        **_HERE,
        **_ROBOT,
        "x_objective": "first objective of nsga2, and whether its max or min is sought",
        "y_objective": "second objective",
        "x": "value of the first objective",
        "y": "value of the second one",
        "is_front": "whether no birth of the island dominates it in all objectives",
    },
    "named_measures": {
        **_ISLAND,
        "measure": "name in measures.names",
        "mean": "mean of judged robots, in the measure's unit",
        "robots": "number of these robots",
        "about": "first line of an own measure's docstring; empty if it is not known",
    },
    "changes": {
        **_ISLAND,
        "births": "births there up to the point",
        "setting": "settings that have a value at the point, with commas",
        "point": "births off-line, simulated time in arenas [s]",
        "before": "mean fitness of the last population before the point",
        "after": "mean fitness of the first population after it; in an arena a window "
        "later",
        "lost": "before minus after",
        "recovery": "births, or seconds, from the point until the mean is back at "
        "before; null if it is not before the next point",
    },
    "learning": {
        **_RUN,
        **_ROBOT,
        "trials": "number of brains that the robot tried",
        "at_birth": "fitness with the brain at birth; if that trial failed 0, or the "
        "least fitness below 0",
        "fitness": "fitness with the best brain",
        "gain": "fitness minus at_birth",
        "kept": "whether it is in the first population recorded after its birth, in an "
        "arena in the second one recorded since it is mature; null off-line for "
        "founders, and for robots that an arena did not decide on",
        "saved": "whether it is kept, although its fitness at birth is below that of "
        "each robot of that population; null as kept is",
    },
    "learning_curves": {
        **_RUN,
        "trial": "number of the trial, 0 is the brain at birth",
        "robots": "number of robots with such a trial",
        "median": "median over these robots of the best fitness so far; failed trials "
        "count as at_birth",
        "low": "lower quartile",
        "high": "upper quartile",
    },
    "life_courses": {
        **_HERE,
        "sim_time_s": "simulated time of a sample of fitness [s]",
        "living": "robots that live then",
        "energy": "mean of their store energy; null if they have none",
        "born": "births since the sample before",
    },
    "lifespans": {
        **_HERE,
        **_ROBOT,
        "age_s": "age at death [s]",
        "reason": "reason of the death",
    },
    "birth_places": {
        **_HERE,
        "birth": _ROBOT["birth"],
        "sim_time_s": "simulated time of the birth [s]",
        "x": "x of its place, world frame [m]",
        "y": "y of its place, world frame [m]",
        "children": "number of its children",
    },
    "couples": {
        **_HERE,
        "sim_time_s": "simulated time of the mating [s]",
        "birth": "number of birth of the child",
        "x": "x of the place near which the child was born; null if any [m]",
        "y": "y of that place [m]",
        "first_x": "x of the place where the first parent was born [m]",
        "first_y": "y of that place [m]",
        "second_x": "x of the place where the second parent was born [m]",
        "second_y": "y of that place [m]",
        "related": "share of the parents and their ancestors that both have in common",
    },
    "patch_means": {
        **_HERE,
        "patch": "number of the patch",
        "x": "x of its centre [m]",
        "y": "y of its centre [m]",
        "radius_m": "its radius [m]",
        "content": "mean over samples of what it holds there",
    },
    "sweeps": {
        **_RUN,
        "setting": "dotted key of a setting that the sweep changes",
        "value": "its value in this run, as JSON",
        "number": "the same if it is a number",
    },
    "progression": {
        "experiment": _RUN["experiment"],
        "measure": "column of populations",
        "births": "births on each island",
        "mean": "mean over runs",
        "low": "lower end of the mean's 95 % interval (Student's t over runs)",
        "high": "upper end of that interval",
        "least": "minimum over runs",
        "greatest": "maximum over runs",
        "runs": "number of runs with a value at these births",
    },
    "outcomes": {**_RUN, **OUTCOME},
    "comparison": {
        "measure": "column of outcomes",
        "a": "experiment",
        "b": "experiment",
        "births": OUTCOME["births"],
        **_TWO_SAMPLES,
        "runs_needed": "runs of each experiment with which p is below 0.05 with a "
        "probability of 80 % if the effect is as seen; null if it is 0",
    },
    "findings": {
        "finding": "number of the finding",
        "figure": "figure of the thesis",
        "claim": "the finding in words",
        "measure": "column of outcomes",
        "a": "experiment",
        "b": "experiment; empty if a is compared with a number",
        "expected": "'>', '<', '=' (alike), '!=' or 'some' (occurs) of a against b",
        "births": OUTCOME["births"],
        **_TWO_SAMPLES,
        "mean_b": "mean over runs of b, times a share that the claim names; if it is "
        "about the spread, mean_a and mean_b are mean distances of runs from their "
        "experiment's median",
        "verdict": "reproduced, not reproduced, undecided or does not apply",
        "why": "the rule of the verdict",
        "topic": "the finding without the names of experiments",
        "margin": "largest negligible effect, or difference if there is no b; with "
        "'=', the largest that counts as alike",
        "p_alike": "p of the equivalence test (two one-sided tests), with '='",
        "q_alike": "p_alike, corrected for all equivalence tests of the table",
        "power": "probability that this test finds equal experiments alike at 5 %",
        "near_automatic": "whether the finding follows almost by construction, or also "
        "holds without selection",
    },
    "left_out": {
        "folder": "path of the run folder; empty for figures",
        "what": "run, table, measure or figure",
        "why": "reason",
    },
}
"""Columns and their meanings, by table; each table is one Parquet file."""

_INTEGERS = {"arena_births", "arena_living", "size", "judged", "ancestors", "planned",
             "islands", "robots", "samples", "pairs", "epoch", "to", "descendants",
             "living", "reached", "runs", "runs_a", "runs_b", "runs_needed",
             "failures", "deaths", "finding", "births", "birth", "members", "founders",
             "trials", "trial", "born", "children", "patch"}  # fmt: skip
_TEXTS = {"folder", "experiment", "run_id", "state", "population", "by", "measure",
          "a", "b", "figure", "claim", "expected", "verdict", "why", "what", "topic",
          "setting", "value", "differs", "function", "fitness_function",
          "plugins", "about", "reason", "cell", "x_objective",
          "y_objective"}  # fmt: skip
_COUNTS = {"robots": {*BODY, "rank", "ancestors"}}


def meaning(outcome: str) -> str:
    """Return the meaning of an outcome, or of a measure that an experiment names."""
    if outcome.startswith(OWN):
        return "mean of judged robots of the last population, in the measure's unit"
    return OUTCOME[outcome]


def schema(table: str) -> pa.Schema:
    """Return the Arrow schema of a table, with ``meaning`` in each field's metadata."""
    return pa.schema(
        [
            pa.field(name, _kind(table, name), metadata={"meaning": meaning})
            for name, meaning in OUTPUTS[table].items()
        ]
    )


def run_schema(table: str) -> pa.Schema:
    """Return the columns of a table of one run, without those that name the run."""
    return pa.schema([field for field in schema(table) if field.name not in _RUN])


def _kind(table: str, name: str) -> pa.DataType:
    if name in _TEXTS:
        return pa.string()
    if table == "outcomes" and name != "births":
        return pa.float64()
    if name in _INTEGERS or name in _COUNTS.get(table, ()):
        return pa.int64()
    return _KINDS.get(name, pa.float64())
