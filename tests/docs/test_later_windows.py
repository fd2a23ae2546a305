"""Later windows on docs/results.md, recomputed with SciPy; dates of all claims."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pytest
from scipy import stats

from analysis.comparison.claims import CLAIMS
from docs.studies.thesis.data import DATA, POPULATIONS, WINDOWS
from docs.studies.thesis.later import dates, key_of
from docs.studies.thesis.windows import missing

PAGE = Path(__file__).parents[2] / "docs" / "results.md"
LABELS = {"scenario 1": "scenario1", "scenario 2": "scenario2",
          "scenario 3": "scenario3", "no reproduction": "no-reproduction",
          "no selection": "no-selection"}  # fmt: skip


def cells_of(part: str, page: Path = PAGE) -> list[list[str]]:
    """Return the cells of a generated table, heads first."""
    found = re.search(f"<!-- begin: {part} -->\n(.*?)<!-- end -->", page.read_text(),
                      re.DOTALL)  # fmt: skip
    assert found
    lines = [line for line in found[1].splitlines() if not line.startswith("|---")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def fitness_of(label: str, runs: int = 1000) -> pd.DataFrame:
    """Return the fitness of the best robots of an experiment's first runs by window."""
    rows = pd.read_csv(DATA / "windows" / "robots.csv")
    is_wanted = (rows["experiment"] == LABELS.get(label, label)) & (rows["run"] < runs)
    mine = rows[is_wanted]
    return mine.filter(regex=r"^window ").fillna(0.0)


@pytest.mark.parametrize("file", [WINDOWS, POPULATIONS])
def test_all_robots_are_evaluated(file: Path) -> None:
    assert missing(DATA, file) == []


def test_medians_of_windows_are_recomputed() -> None:
    _, *rows = cells_of("windows")
    assert len(rows) >= 5
    for label, runs, *cells, percent, again in rows:
        found = fitness_of(label)
        assert len(found) == int(runs)
        medians = found.median().tolist()
        assert [float(each) for each in cells] == pytest.approx(medians, abs=6e-4)
        if percent == "-":
            assert "drawn" in label or "reevaluated" in label
            continue
        at = int(label.endswith("warm"))
        positive = found[found.iloc[:, at] > 0]
        shares = positive.iloc[:, at + 1 :].mean(axis=1) / positive.iloc[:, at]
        wanted = pytest.approx(100 * shares.median(), abs=0.51)
        assert float(percent.removesuffix(" %")) == wanted
        assert again == ("-" if label == "scenario 3" else f"{runs} of {runs}")


def test_comparisons_from_36_s_on_are_recomputed_with_scipy() -> None:
    _, *rows = cells_of("late")
    assert len(rows) >= 6
    for names, medians, effect, p in rows:
        a, b = (fitness_of(name).iloc[:, 3:].mean(axis=1) for name in names.split(", "))
        test = stats.mannwhitneyu(a, b, method="exact")
        delta = 2 * test.statistic / (len(a) * len(b)) - 1
        assert float(effect.split()[0]) == pytest.approx(delta, abs=0.006)
        assert float(p) == pytest.approx(test.pvalue, rel=0.06)
        wanted = [a.median(), b.median()]
        found = [float(each) for each in medians.split("; ")]
        assert found == pytest.approx(wanted, abs=6e-4)


def test_means_of_populations_are_recomputed_with_scipy() -> None:
    rows = pd.read_csv(DATA / "windows" / "populations.csv")
    late = {name: own["late"] for name, own in rows.groupby("experiment")}
    _, *table = cells_of("populations", PAGE.with_name("starts.md"))
    assert {cells[0].strip("`") for cells in table} == {*late}
    for name, runs, median, effect, p in table:
        own = late[name.strip("`")]
        assert len(own) == int(runs) == 10
        assert float(median) == pytest.approx(own.median(), abs=6e-4)
        if not effect:
            continue
        base = late[name.strip("`").partition("-")[0]]
        test = stats.mannwhitneyu(own, base, method="exact")
        delta = 2 * test.statistic / len(own) ** 2 - 1
        assert float(effect.split()[0]) == pytest.approx(delta, abs=0.006)
        assert float(p) == pytest.approx(test.pvalue, rel=0.06)


def test_numbers_of_the_first_who_looked_come_out_again() -> None:
    """Medians over 26, 27, 9 and 28 robots that another program simulated."""
    earlier = {
        "scenario 1": (0.262, 0.079, 0.052, 0.035),
        "scenario 2": (0.208, 0.069, 0.053, 0.062),
        "scenario 3": (0.065, 0.083, 0.084, 0.085),
        "no reproduction": (0.054, 0.037, 0.042, 0.044),
    }
    for label, wanted in earlier.items():
        runs = 10 if label == "scenario 3" else 30
        ours = fitness_of(label, runs).median().to_numpy()[[0, 1, 2, 4]]
        assert ours == pytest.approx(wanted, rel=0.15, abs=0.006), label


def test_every_claim_has_a_date_of_a_stage() -> None:
    known = dates()
    keys = [
        key_of({"figure": one.figure, "measure": one.measure, "a": one.a,
                "b": one.b or "", "expected": one.expected, "text": one.text})
        for one in CLAIMS
    ]  # fmt: skip
    assert known.keys() == set(keys)
    assert all(re.fullmatch(r"\d{4}-\d\d-\d\d", date) for date in known.values())
    stages = [row[0] for row in cells_of("stages")[1:]]
    assert set(known.values()) == set(stages)
    assert all(first < second for first, second in pairwise(stages))


def test_convergence_is_recomputed() -> None:
    rows = cells_of("convergence")[1:]
    for label, runs, effect, _ in rows:
        folder = DATA / "outcomes"
        found = pd.concat(
            pd.read_parquet(path).nlargest(1, "births")
            for path in sorted(folder.glob(f"{LABELS[label]}-[0-9][0-9].parquet"))
        )
        ranks = found[["diversity", "fitness"]].rank()
        assert len(found) == int(runs)
        assert float(effect) == pytest.approx(np.corrcoef(ranks.T)[0, 1], abs=0.006)
