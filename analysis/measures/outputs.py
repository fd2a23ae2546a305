"""What `revolve analyze` writes: its tables, their columns, units and meanings.

A run is named by ``experiment`` and ``folder``: two folders may both hold the
experiment's run 0, of different seeds. Births count each island's own.
"""

import pyarrow as pa

_KINDS = {
    "folder": pa.string(),
    "experiment": pa.string(),
    "run": pa.int32(),
    "seed": pa.uint64(),
    "state": pa.string(),
    "island": pa.int32(),
    "births": pa.int64(),
    "birth_island": pa.int32(),
    "birth": pa.int64(),
    "is_last": pa.bool_(),
}
_RUN = {
    "experiment": "name of the experiment",
    "folder": "of the run, as it was found",
}
_ISLAND = {**_RUN, "island": "number of the island", "births": "born there by then"}
_ROBOT = {"birth_island": "island of birth", "birth": "number of the birth there"}

BODY = {
    "parts": "nodes of the body tree",
    "active_joints": "joints with a motor",
    "passive_joints": "joints without one",
    "joints": "both",
    "extremities": "leaves of the body tree; a lone core counts 1",
    "touch_sensors": "parts that feel touch",
    "hidden": "hidden neurons",
    "connections": "of the genome, unresolvable ones included",
}
"""Sizes of a robot, in the order of the thesis."""

PER_PART = {
    f"{name}_per_part": f"{name} by parts"
    for name in (
        "active_joints",
        "passive_joints",
        "joints",
        "extremities",
        "hidden",
        "connections",
    )
}
"""The same, relative to the size of the body."""

POPULATION = {
    "size": "alive",
    "judged": "alive whose fitness counts: off-line all, on-line the mature",
    "fitness": "mean of the judged [m/s]",
    "fitness_best": "greatest of the judged [m/s]",
    "rank": "mean of the judged (thesis eq. 6.1)",
    "ancestors": "different ancestors of all judged together",
    "ancestors_per_robot": "the same by the number of judged",
    "diversity": "mean tree edit distance of the pairs alive",
    "retention": "share of the living that still live 120 births later",
    "foreign": "share of the living with an ancestor, or a birth, elsewhere",
    **{name: f"mean of the judged: {what}" for name, what in BODY.items()},
    **{name: f"mean of the judged: {what}" for name, what in PER_PART.items()},
    "without_touch": "share of the judged without touch sensors",
}
"""What is measured of a population at a number of births."""

OUTCOME = {
    "births": "compared at: the greatest that all runs of both experiments reach",
    **POPULATION,
    "retention": "mean over the run's births",
    "late_gain": "share of the fitness gained that the second half of births brought",
    "early_drop": "share of the diversity lost that the first tenth of births took",
    "diversity_change": "diversity, last population less founders",
    "parts_change": "parts, last population less random robots",
    "touch_sensors_change": "touch sensors, last population less random robots",
    "hidden_change": "hidden neurons, last population less random robots",
    "extremities_fitness": "rank correlation of fitness and extremities, all judged",
    "extremities_per_part_fitness": "the same of extremities per part",
    "variability": "median of the robots' variability (on-line)",
    "touched": "share of robots that ever touched another (on-line)",
    "between": "mean tree edit distance between islands",
}
"""One number of each run: what experiments are compared by."""

_SPREAD = {
    "low": "lower end of the mean's 95 % interval (Student's t over runs)",
    "high": "upper end",
    "least": "least run",
    "greatest": "greatest run",
    "runs": "that have a value there",
}
_TWO_SAMPLES = {
    "runs_a": "runs of a",
    "runs_b": "runs of b",
    "mean_a": "mean over runs of a",
    "mean_b": "mean over runs of b; of one experiment alone: the reference",
    "median_a": "median over runs of a",
    "median_b": "median over runs of b; of one experiment alone: the reference",
    "difference": "mean_a - mean_b",
    "difference_low": "lower end of its 95 % interval (Welch's t over runs)",
    "difference_high": "upper end",
    "effect": "-1..1; Cliff's delta of a and b, or rank-biserial correlation of a",
    "effect_low": "lower end of delta's 95 % interval (Newcombe's score)",
    "effect_high": "upper end",
    "p": "two-sided, exact",
    "q": "the same, corrected for all tests of the table (Benjamini-Hochberg)",
}

OUTPUTS: dict[str, dict[str, str]] = {
    "runs": {
        **_RUN,
        "run": "number of the repeat",
        "seed": "of the run",
        "state": "finished, stopped or running, which may have died since",
        "births": "recorded, of all islands",
        "planned": "births of the experiment, of all islands",
        "islands": "of the experiment",
        "differs": "from the settings that most runs of its name have, if it does",
    },
    "populations": {**_ISLAND, **POPULATION},
    "robots": {
        **_RUN,
        **_ROBOT,
        "is_last": "among the judged of an island's last population",
        "fitness": "as last judged; off-line 0 if that failed [m/s]",
        "rank": "thesis eq. 6.1",
        "ancestors": "different ones",
        **BODY,
        **PER_PART,
    },
    "extremities": {
        **_RUN,
        "population": "'final': the last judged; 'born': all who were ever judged",
        "by": "'count': extremities; 'per_part': in bins of 0.1",
        "bin": "count, or the bin's lower end",
        "robots": "in it",
        "fitness": "their mean [m/s]",
    },
    "variability": {
        **_RUN,
        "island": "where it lived",
        **_ROBOT,
        "samples": "recorded while mature",
        "fitness_range": "greatest less least of its fitness [m/s]",
        "population_range": "of all fitness recorded while it was alive [m/s]",
        "variability": "the first by the second",
    },
    "interactions": {
        **_RUN,
        "island": "number of the island",
        "robots": "that lived there",
        "lived_s": "by all of them together [s]",
        "pairs": "that ever touched there",
        "touched": "share of robots that ever touched another",
        "touching": "time of touch, counted for both, by time lived",
    },
    "between": {
        **_RUN,
        "births": "on each island",
        "islands": "that had a population then",
        "within": "mean over islands of their diversity",
        "between": "mean tree edit distance of pairs of different islands",
    },
    "migrants": {
        **_RUN,
        "epoch": "of the exchange",
        **_ROBOT,
        "island": "where it came from",
        "to": "where it went",
        "fitness": "when it left [m/s]",
        "descendants": "born on the island it went to",
        "living": "in that island's last population, itself included",
        "reached": "islands in whose last population it or a descendant lives",
    },
    "progression": {
        "experiment": _RUN["experiment"],
        "measure": "column of populations",
        "births": "on each island",
        "mean": "over runs",
        **_SPREAD,
    },
    "outcomes": {**_RUN, **OUTCOME},
    "comparison": {
        "measure": "column of outcomes",
        "a": "experiment",
        "b": "experiment",
        "births": OUTCOME["births"],
        **_TWO_SAMPLES,
    },
    "findings": {
        "finding": "number of the claim",
        "figure": "of the thesis",
        "claim": "in words",
        "measure": "column of outcomes",
        "a": "experiment",
        "b": "experiment; empty where a is held against a reference",
        "expected": "'>', '<' or '=' (no large difference) of a against b",
        "births": OUTCOME["births"],
        **_TWO_SAMPLES,
        "verdict": "reproduced, not reproduced or undecided",
        "why": "the rule that decided",
    },
    "left_out": {"folder": "of the run", "what": "table or measure", "why": "reason"},
}
"""Columns and their meanings, by table; each is one Parquet file."""

_INTEGERS = {"size", "judged", "ancestors", "planned", "islands", "robots", "samples",
             "pairs", "epoch", "to", "descendants", "living", "reached", "runs",
             "runs_a", "runs_b", "finding"}  # fmt: skip
_TEXTS = {"population", "by", "measure", "a", "b", "figure", "claim", "expected",
          "verdict", "why", "what", "differs"}  # fmt: skip
_COUNTS = {"robots": {*BODY, "rank", "ancestors"}}


def schema(table: str) -> pa.Schema:
    """Return the Arrow schema of an output; ``meaning`` is in each field's metadata.

    Args:
        table: a key of ``OUTPUTS``.
    """
    return pa.schema(
        [
            pa.field(name, _kind(table, name), metadata={"meaning": meaning})
            for name, meaning in OUTPUTS[table].items()
        ]
    )


def _kind(table: str, name: str) -> pa.DataType:
    if name in _TEXTS:
        return pa.string()
    if table == "outcomes" and name not in {"births", *_RUN}:
        return pa.float64()
    if name in _INTEGERS or name in _COUNTS.get(table, ()):
        return pa.int64()
    return _KINDS.get(name, pa.float64())
