"""Tests of comparisons and findings, of runs with known numbers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from analysis.comparison.claims import ARENA, CLAIMS, Claim
from analysis.comparison.comparison import comparison, outcomes_of
from analysis.comparison.findings import (
    LARGE,
    NEGLIGIBLE,
    findings,
    verdict,
    with_benchmark,
)
from analysis.comparison.outcomes import outcome, slope
from analysis.measures.load import LoadedRun
from analysis.measures.outputs import OUTCOME, OUTPUTS
from analysis.measures.study import MeasuredRun
from schema.experiment.document import (
    ArenaSection,
    Experiment,
    Reevaluation,
    SelectionSection,
)
from schema.experiment.grid import Grid
from tests.analysis.drawn import table

Level = Mapping[str, float | None]
ROBOT = dict.fromkeys(OUTPUTS["robots"], 0) | {
    "experiment": "",
    "folder": "",
    "is_failed": False,
}


def tables(
    levels: Sequence[Level], robots: Sequence[Level] = ()
) -> dict[str, pa.Table]:
    """Return measured tables: rows of populations, and of robots."""
    rows = [{"island": 0, "judged": 1, **level} for level in levels]
    named = [
        {**ROBOT, "is_last": False, "birth": number, **robot}
        for number, robot in enumerate(robots)
    ]
    return {
        "populations": table("populations", rows),
        "robots": table("robots", named),
    }


SETTINGS = (Experiment("e", births=100),) * 2


def measured(
    name: str, number: int, made: dict[str, pa.Table], state: str = "finished"
) -> MeasuredRun:
    folder = Path(f"{name}-{number}")
    run = LoadedRun(folder, name, number, 1, state, "", SETTINGS[0])
    return MeasuredRun(run, made, ())


def runs(name: str, values: list[float], *, births: int = 100) -> list[MeasuredRun]:
    """Return finished runs that end with these fitnesses."""
    return [
        measured(name, number, tables([{"births": births, "fitness": value}]))
        for number, value in enumerate(values)
    ]


def test_measures_of_the_experiments_are_compared() -> None:
    """Means of the last populations at 100 births: islands 2 and 4, hence 3."""
    every = []
    for name, energies in (("a", [2.0, 3.0]), ("b", [5.0, 7.0]), ("c", [])):
        for number, energy in enumerate(energies or [0.0]):
            (one,) = runs(name, [0.1])
            rows = [
                {"island": island, "births": births, "measure": "energy", "mean": mean}
                for island, births, mean in (
                    (0, 50, 99.0), (0, 100, energy - 1.0), (1, 90, energy + 1.0),
                    (0, 130, 99.0),
                )
            ] * bool(energies)  # fmt: skip
            named = table("named_measures", rows)
            run = replace(one.run, number=number, folder=Path(f"{name}{number}"))
            every.append(
                replace(one, run=run, tables={**one.tables, "named_measures": named})
            )
    found = comparison(outcomes_of(every)).to_pylist()
    (row,) = [row for row in found if row["measure"].startswith("measures.")]
    assert (row["measure"], row["a"], row["b"]) == ("measures.energy", "a", "b")
    assert (row["mean_a"], row["mean_b"], row["effect"]) == (2.5, 6.0, -1.0)


def test_outcomes_by_hand() -> None:
    levels = [
        {"births": 15, "fitness": 0.1, "diversity": 10.0, "parts": 12.0, "hidden": 4.0},
        {"births": 30, "fitness": 0.2, "diversity": 6.0, "retention": 0.5},
        {"births": 60, "fitness": 0.4, "diversity": 4.0, "retention": 0.1},
        {"births": 120, "fitness": 0.5, "diversity": 2.0, "parts": 20.0, "hidden": 1.0},
        {"births": 150, "fitness": 9.0, "diversity": 9.0, "parts": 9.0},
    ]
    robots = [
        {"parts": 10.0, "hidden": 3.0, "fitness": 0.1, "extremities": 2.0},
        {"parts": 14.0, "hidden": 5.0, "fitness": 0.2, "extremities": 3.0},
        {"parts": 99.0, "ancestors": 2.0, "fitness": 0.3, "extremities": 5.0},
    ]
    found = outcome(tables(levels, robots), 120, SETTINGS)
    assert (found["births"], found["fitness"], found["parts"]) == (120, 0.5, 20)
    # Nothing is recorded 120 births earlier.
    assert math.isnan(found["retention"])
    late = [*levels[:4], {**levels[3], "births": 150, "retention": 0.9}]
    assert outcome(tables(late), 150, SETTINGS)["retention"] == 0.5
    assert outcome(tables(late), 300, SETTINGS)["retention"] == pytest.approx(0.5)
    # Of 0.4 gained, 0.1 came after birth 60; nothing is recorded from birth 15 to 12;
    # of 8 lost, 4 were lost up to birth 30.
    assert found["late_gain"] == pytest.approx(0.25)
    assert math.isnan(found["early_drop"])
    assert math.isnan(outcome(tables(levels[1:4]), 100, SETTINGS)["late_gain"])
    longer = [*levels[:4], {**levels[3], "births": 300}]
    assert outcome(tables(longer), 300, SETTINGS)["early_drop"] == pytest.approx(0.5)
    # The tenth from birth 108 to 120 has 0.5, that until 60 has 0.4; until 12 nothing.
    assert found["late_rise"] == pytest.approx(0.1)
    assert math.isnan(found["early_diversity"])
    early = outcome(tables(longer), 300, SETTINGS)["early_diversity"]
    assert early == pytest.approx(8.0)  # of births 15 and 30
    # Only populations as many births apart as there are founders, fifteen, count.
    odd = [*longer, {**levels[0], "births": 20}]
    assert outcome(tables(odd), 300, SETTINGS)["early_diversity"] == early
    assert found["diversity_change"] == -8
    # Random robots have no ancestors: 12 parts and 4 hidden neurons on average.
    assert found["parts_change"] == 8
    assert found["hidden_change"] == -3
    assert found["extremities_fitness"] == pytest.approx(1)
    assert math.isnan(found["touched"])


EIGHT = Experiment("e", births=100, selection=SelectionSection(population=8))


@pytest.mark.parametrize(
    ("settings", "island", "gain", "change"),
    [
        (SETTINGS, 0, 0.3, 3),
        ((EIGHT,), 0, 0.5, 5),
        # Island 2 is not in the document: it has the settings of the last one.
        ((SETTINGS[0], EIGHT), 2, 0.5, 5),
    ],
)
def test_changes_are_counted_from_the_founders_of_the_experiment(
    settings: tuple[Experiment, ...], island: int, gain: float, change: float
) -> None:
    levels = [
        {
            "island": island,
            "births": births,
            "fitness": fitness,
            "diversity": 10 * fitness,
        }
        for births, fitness in ((8, 0.1), (16, 0.3), (24, 0.6))
    ]
    found = outcome(tables(levels), 24, settings)
    assert found["gain"] == pytest.approx(gain)
    assert found["diversity_change"] == pytest.approx(change)


def test_contacts_and_families_of_later_births_do_not_count() -> None:
    """Island 0 ends with 15 births, island 1 goes on to 30."""
    levels = [
        {"island": island, "births": births, "fitness": 0.1}
        for island, births in ((0, 15), (1, 15), (1, 30))
    ]
    contacts = [{"island": 0, "touched": 0.5}, {"island": 1, "touched": 0.7}]
    families = [
        {"island": island, "distance": distance, "founder_distance": 1.0}
        for island, distance in ((0, 0.2), (1, 0.4))
    ]
    made = tables(levels) | {
        "interactions": table("interactions", contacts),
        "families": table("families", families),
    }
    found = [outcome(made, births, SETTINGS) for births in (30, 15, 14)]
    names = ("touched", "family_distance")
    assert [found[0][name] for name in names] == pytest.approx([0.6, 0.3])
    assert [found[1][name] for name in names] == pytest.approx([0.5, 0.2])
    made["families"] = made["families"].slice(0, 0)
    found.append(outcome(made, 30, SETTINGS))
    assert all(math.isnan(found[2][name]) for name in names)
    assert math.isnan(found[3]["family_distance"])


@pytest.mark.parametrize(
    ("island", "at_15"),
    [
        (SETTINGS[1], 0.9),
        (Experiment("e", selection=SelectionSection(reevaluation=Reevaluation())), -1),
        (Experiment("e", arena=ArenaSection()), -1.0),
    ],
)
def test_fitness_of_whole_lives_counts_on_islands_that_end(
    island: Experiment, at_15: float
) -> None:
    """Island 0 ends with 15 births; island 1 goes on, and larger ones are fitter."""
    levels = [
        {"island": island, "births": births, "fitness": 0.1}
        for island, births in ((0, 15), (1, 15), (1, 30))
    ]
    robots = [
        {"island": island, "parts": parts, "fitness": fitness}
        for island, parts, fitness in (
            (0, 3.0, 0.2), (0, 4.0, 0.1), (1, 5.0, 0.3), (1, 6.0, 0.4), (1, 7.0, 0.5),
        )
    ]  # fmt: skip
    lives = [
        {"island": island, "birth": birth, "variability": value}
        for island, birth, value in ((0, 0, 0.2), (0, 1, 0.4), (1, 0, 0.9), (1, 1, 0.9))
    ]
    made = tables(levels, robots)
    made["variability"] = table("variability", lives)
    settings = (SETTINGS[0], island)
    early, late = (outcome(made, births, settings) for births in (15, 30))
    # Ranks 2 1 3 4 5, or 2 1 alone: 1 - 6 (1 + 1) / (5 (25 - 1)) = 0.9.
    assert early["parts_fitness"] == pytest.approx(at_15)
    assert late["parts_fitness"] == pytest.approx(0.9)
    assert early["variability"] == pytest.approx(0.3)
    assert late["variability"] == pytest.approx(0.65)


def test_outcome_of_several_islands_is_their_mean() -> None:
    levels = [
        {"island": 0, "births": 15, "fitness": 0.1},
        {"island": 1, "births": 15, "fitness": 0.5},
        {"island": 0, "births": 30, "fitness": 0.3},
    ]
    assert outcome(tables(levels), 30, SETTINGS)["fitness"] == pytest.approx(0.4)


def test_every_measure_of_every_pair_is_compared_once() -> None:
    found = comparison(
        outcomes_of([*runs("b", [1, 2, 3]), *runs("a", [4, 5, 6]), *runs("c", [2, 2])])
    ).to_pylist()
    fitness = [row for row in found if row["measure"] == "fitness"]
    assert [(row["a"], row["b"]) for row in fitness] == [
        ("a", "b"),
        ("a", "c"),
        ("b", "c"),
    ]
    first = fitness[0]
    assert (first["runs_a"], first["runs_b"], first["effect"]) == (3, 3, 1)
    assert (first["mean_a"], first["median_b"], first["difference"]) == (5, 2, 3)
    assert first["p"] == pytest.approx(0.1)
    assert first["q"] >= first["p"]
    assert first["difference_low"] < 3 < first["difference_high"]


def test_measures_that_are_equal_in_all_runs_are_not_tested() -> None:
    made = []
    for name, values in (("a", (1.0, 2.0)), ("b", (3.0, 4.0)), ("c", (5.0, 6.0))):
        parts = 8.0 if name == "c" else 7.0
        for number, value in enumerate(values):
            level = {"births": 15, "fitness": value, "parts": parts, "hidden": 1.0}
            made.append(measured(name, number, tables([level])))
    rows = comparison(outcomes_of(made)).to_pylist()
    found = {(row["a"], row["b"], row["measure"]): row for row in rows}
    equal = found["a", "b", "parts"]
    assert (equal["p"], equal["q"], equal["difference"]) == (None, None, 0)
    # Equal in the runs of each experiment, but not between them: 2 of the 6 orders of
    # four runs are as extreme.
    assert found["a", "c", "parts"]["p"] == pytest.approx(1 / 3)
    assert all(row["p"] is None for row in rows if row["measure"] == "hidden")
    # All tests have the same p, so that the correction changes none.
    tested = [row["q"] for row in rows if row["p"] is not None]
    assert tested == pytest.approx([1 / 3] * len(tested))


def test_fitness_is_compared_only_with_the_same_function() -> None:
    """The function of c is another one; sizes of its robots are compared."""
    levels = [{"births": 15, "fitness": 0.1, "parts": 1.0, "fitness_best": 9.0}]
    made = []
    for name, function in (("a", "f"), ("b", "f"), ("c", "g")):
        for number in range(2):
            one = measured(name, number, tables(levels))
            made.append(replace(one, run=replace(one.run, fitness=function)))
    outcomes = outcomes_of(made)
    rows = comparison(outcomes).to_pylist()
    found: dict[tuple[str, str], set[str]] = {}
    for row in rows:
        found.setdefault((row["a"], row["b"]), set()).add(row["measure"])
    assert {"fitness", "fitness_best", "parts"} <= found["a", "b"]
    for pair in (("a", "c"), ("b", "c")):
        assert not found[pair] & {"fitness", "fitness_best", "late_gain"}
        assert "parts" in found[pair]
    claims = [Claim("1", "fitter", "fitness", "a", ">", "c"),
              Claim("2", "larger", "parts", "a", ">", "c")]  # fmt: skip
    fitter, larger = findings(outcomes, claims).to_pylist()
    assert (fitter["verdict"], fitter["why"]) == (
        "undecided",
        "different fitness functions: f, g",
    )
    assert (fitter["p"], larger["p"]) == (None, 1.0)


def test_cells_are_compared_only_with_the_same_grid() -> None:
    levels = [{"births": 15, "coverage": 0.1, "parts": 1.0}]
    made = []
    for name, bins in (("a", 2), ("b", 2), ("c", 3)):
        grid = Grid(("x",), bounds=((0, 1),), bins=(bins,))
        one = measured(name, 0, tables(levels))
        settings = Experiment("e", births=100, grid=grid)
        made.append(replace(one, run=replace(one.run, settings=settings)))
    rows = comparison(outcomes_of(made)).to_pylist()
    found = {(row["a"], row["b"]) for row in rows if row["measure"] == "coverage"}
    assert found == {("a", "b")}
    assert {("a", "c"), ("b", "c")} < {(row["a"], row["b"]) for row in rows}


def test_experiments_are_compared_at_births_that_all_runs_reach() -> None:
    short = [
        measured("a", 0, tables([{"births": 30, "fitness": 0.2}])),
        measured("a", 1, tables([{"births": 60, "fitness": 0.4}])),
    ]
    levels = [{"births": 15, "fitness": 0.1}, {"births": 90, "fitness": 0.9}]
    long = [measured("b", number, tables(levels)) for number in range(2)]
    (row,) = [
        row
        for row in comparison(outcomes_of([*short, *long])).to_pylist()
        if row["measure"] == "fitness"
    ]
    # Run 1 of a has nothing recorded up to 30 births.
    assert (row["births"], row["runs_a"], row["mean_b"]) == (30, 1, 0.1)


def test_unfinished_runs_are_not_compared() -> None:
    made = tables([{"births": 30, "fitness": 0.2}])
    outcomes = outcomes_of([measured("a", 0, made, "running"), *runs("b", [1, 2])])
    assert outcomes.experiments == ["b"]
    assert outcomes.table()["fitness"].to_pylist() == [1, 2]
    assert comparison(outcomes).num_rows == 0


HIGH = [11.0, 12, 13, 14, 15, 16, 17, 18, 19, 20]
LOW = [1.0, 2, 3, 4, 5, 6, 7, 8, 9, 10]
MANY = [float(value % 10) for value in range(40)]
WIDE = [value - 5.5 for value in range(12)]


def decided(
    claims: dict[Claim, str], values: dict[str, list[float]]
) -> list[dict[str, Any]]:
    """Return the findings about claims, which must have the given verdicts."""
    made = [run for name, fitness in values.items() for run in runs(name, fitness)]
    found: list[dict[str, Any]] = findings(outcomes_of(made), list(claims)).to_pylist()
    assert [row["finding"] for row in found] == [*range(1, len(claims) + 1)]
    assert [row["verdict"] for row in found] == [*claims.values()]
    return found


def test_findings_of_few_births_spreads_shares_and_numbers() -> None:
    alone = ("fitness", "narrow")
    claims = {
        Claim("1", "early", "fitness", "wide", ">", reference=-9, births=101):
            "does not apply",
        Claim("2", "in time", "fitness", "wide", ">", reference=-9, births=100):
            "reproduced",
        Claim("3", "wider", "fitness", "wide", "!=", "narrow", is_spread=True):
            "reproduced",
        Claim("4", "as wide", "fitness", "wide", "!=", "wide", is_spread=True):
            "undecided",
        Claim("5", "half", "fitness", "low", "<", "high", share=0.5): "reproduced",
        Claim("6", "a tenth", "fitness", "low", "<", "high", share=0.1):
            "not reproduced",
        Claim("7", "about 0", *alone, "=", margin=0.2): "reproduced",
        Claim("8", "about 1", *alone, "=", reference=1.0, margin=0.2):
            "not reproduced",
        Claim("9", "occurs", "fitness", "once", "some"): "reproduced",
        Claim("10", "never occurs", "fitness", "never", "some"): "not reproduced",
        Claim("11", "may occur", "fitness", "seldom", "some"): "undecided",
        Claim("12", "negligible", *alone, ">", reference=-0.1, margin=0.5):
            "not reproduced",
    }  # fmt: skip
    found = decided(
        claims,
        {
            "wide": WIDE,
            "narrow": [value / 50 for value in WIDE],
            "low": LOW,
            "high": [value + 20 for value in HIGH],
            "once": [0.0] * 9 + [0.1],
            "never": [0.0] * 29,
            "seldom": [0.0] * 28,
        },
    )
    assert (found[0]["births"], found[0]["p"]) == (100, None)
    # Means are those of what is compared: the distances from the median are 3 and
    # 3 / 50 on average; half of 35.5 is 17.75.
    means = ("mean_a", "mean_b", "median_a", "median_b")
    assert [found[2][name] for name in means[:2]] == pytest.approx([3, 0.06])
    assert found[2]["difference"] == pytest.approx(3 - 0.06)
    assert [found[4][name] for name in means] == [5.5, 17.75, 5.5, 17.75]
    assert found[4]["difference"] == 5.5 - 17.75
    # A difference of 0.1 is significant, but less than the margin.
    assert found[11]["q"] < 0.05
    words = "the 95 % interval of the difference (uncorrected) ends"
    assert found[11]["why"].startswith(words)
    assert found[6]["power"] > 0.9
    assert found[6]["q_alike"] < 0.05


def test_an_arena_benchmark_is_compared_with_real_time() -> None:
    sizes, factors = [30, 30, 30, 5], [2.0, 3.0, 4.0, 0.5]
    rows = pa.table(
        {"benchmark": ["arena"] * 4, "population": sizes, "factor": factors}
    )
    claims = [Claim("1", "x", "real_time_factor", ARENA, ">", reference=1.0),
              Claim("2", "x", "fitness", "low", ">", reference=0.0)]  # fmt: skip
    outcomes = outcomes_of(runs("low", LOW))
    fast, fit = findings(with_benchmark(outcomes, rows), claims).to_pylist()
    assert (fast["runs_a"], fast["mean_a"], fast["births"]) == (3, 3.0, 0)
    assert (fit["runs_a"], fit["births"]) == (10, 100)
    none = findings(with_benchmark(outcomes, rows[:0]), claims).to_pylist()
    assert none[0]["why"] == f"no finished run of {ARENA} could be measured"


@pytest.mark.parametrize(
    ("expected", "effect", "q", "ends", "decided"),
    [
        (">", 0.9, 0.01, (0.5, 1.0), "reproduced"),
        ("<", 0.9, 0.01, (0.5, 1.0), "not reproduced"),
        ("<", -0.9, 0.01, (-1.0, -0.5), "reproduced"),
        (">", 0.4, 0.2, (-0.1, 0.8), "undecided"),
        (">", -0.1, 0.6, (-0.3, 0.1), "not reproduced"),
        ("<", 0.1, 0.6, (-0.1, 0.3), "not reproduced"),
        ("=", 0.1, 0.6, (-0.2, 0.4), "reproduced"),
        ("=", 0.1, 0.6, (-0.4, 0.6), "undecided"),
        ("=", 0.3, 0.01, (0.1, 0.5), "undecided"),
        ("=", -0.7, 0.01, (-0.9, -0.3), "not reproduced"),
    ],
)
def test_the_rules_of_verdicts(
    expected: str, effect: float, q: float, ends: tuple[float, float], decided: str
) -> None:
    row = {"effect": effect, "q": q, "effect_low": ends[0], "effect_high": ends[1]}
    row |= {"runs_b": 30, "margin": LARGE if expected == "=" else NEGLIGIBLE}
    row["q_alike"] = 0.01 if max(map(abs, ends)) < LARGE else 0.2
    assert verdict(expected, row)[0] == decided


def test_claims_name_existing_measures() -> None:
    assert {claim.measure for claim in CLAIMS} <= set(OUTCOME)
    figures = [tuple(map(int, claim.figure.split("."))) for claim in CLAIMS]
    assert figures == sorted(figures)
    assert len({claim.text for claim in CLAIMS}) == len(CLAIMS)


def test_slope_by_extremities_is_that_of_all_robots_of_four_or_more() -> None:
    """Oracle: SciPy's regression; bins of equal robots have the slope of the robots."""
    rng = np.random.default_rng(5)
    counts = rng.integers(1, 12, 200).astype(float)
    fitness = 0.01 * counts + rng.normal(0, 0.1, 200)
    is_many = counts >= 4
    wanted = stats.linregress(counts[is_many], fitness[is_many]).slope
    bins = np.unique(counts)
    means = np.array([fitness[counts == each].mean() for each in bins])
    robots = np.array([(counts == each).sum() for each in bins], np.float64)
    assert slope(bins, means, robots) == pytest.approx(wanted)
    few = np.array([3.0, 4.0])
    assert math.isnan(slope(few, few, few))


def test_what_differs_by_less_than_a_large_effect_names_its_margin() -> None:
    alike = [one for one in CLAIMS if one.expected == "=" and one.b]
    assert len(alike) > 40
    assert all(f"({LARGE:g})" in one.text for one in alike)
