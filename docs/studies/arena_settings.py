"""Writes the tables and the picture of docs/arena_settings.md from docs/sweeps.

    revolve analyze SWEEP --out REPORT
    python -m docs.studies.arena_settings keep REPORT ...  # keep rows
    python -m docs.studies.arena_settings page             # write tables and picture
    python -m docs.studies.arena_settings page --check     # fail if the tables differ

Each sweep has one file of rows, one per run: docs/sweeps/NAME.csv.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from scipy.interpolate import RegularGridInterpolator
from scipy.stats import friedmanchisquare

from analysis.comparison.statistics import ALPHA, mean_difference
from analysis.figures.sweeps import sweep_map
from docs.studies.pages import DOCS, Parts, command, markdown, save_small

ROWS = DOCS / "sweeps"
GRID, CHECK, LIMIT = "arena-settings", "arena-settings-check", "arena-limit"
INTERVAL, SHARE = "arena.birth_interval_s", "arena.survive_share_of_mean"
POPULATION_LIMIT = "arena.population_limit"
KEPT = ("fitness", "fitness_best", "diversity", "late_gain", "size", "size_mean")
"""Outcomes of a run that are kept, columns of ``measures/outcomes.parquet``."""
Frame = Any  # pandas has no types
SHOWN = {
    "fitness": ("mean fitness [m/s]", 4),
    "size_mean": ("living robots", 1),
    "birth_s": ("simulated time per birth [s]", 1),
}
"""Outcomes of the table of the check: heading, and number of decimals."""
DRAWS = 500
TESTED = {
    "fitness": "mean fitness",
    "fitness_best": "best fitness",
    "diversity": "mean tree edit distance",
    "late_gain": "late gain",
    "size_mean": "living robots",
    "birth_s": "simulated time per birth",
}
"""Outcomes of the table of effects, and their names."""


def keep(reports: Sequence[Path]) -> None:
    """Keep the rows of the sweeps of reports."""
    for report in reports:
        _keep(report)


def _keep(report: Path) -> None:
    """Keep the rows of the sweep of a report, one per finished run."""
    sweeps, outcomes, runs, populations = (
        pq.read_table(report / "measures" / f"{name}.parquet").to_pandas()
        for name in ("sweeps", "outcomes", "runs", "populations")
    )
    (name,) = set(sweeps["experiment"])
    settings = sweeps.pivot_table(index="folder", columns="setting", values="number")
    founded = populations[populations["births"] > outcomes["births"].max() // 4]
    rows = settings.join(outcomes.set_index("folder")[["births", *KEPT]], how="inner")
    rows["size_least"] = founded.groupby("folder")["size"].min()
    simulated_s = runs.set_index("folder")["simulated_s"]
    rows["birth_s"] = simulated_s / rows["births"]
    rows.index = [Path(folder).name for folder in rows.index]
    rows.sort_index().to_csv(
        ROWS / f"{name}.csv", index_label="run", float_format="%.6g"
    )


def kept(name: str) -> Frame:
    """Return the rows of a sweep."""
    return pa.csv.read_csv(ROWS / f"{name}.csv").to_pandas().set_index("run")


def settings_of(rows: Frame) -> list[str]:
    """Return the swept settings: columns with a dotted key."""
    return [column for column in rows.columns if "." in column]


def drawn(name: str) -> Any:  # noqa: ANN401 - a figure
    """Return the map of a sweep, as in its report."""
    rows = kept(name)
    long = rows[settings_of(rows)].melt(
        var_name="setting", value_name="number", ignore_index=False
    )
    sweeps = long.assign(experiment=name, folder=long.index, value="")
    outcomes = rows.assign(experiment=name, folder=rows.index)
    tables = {
        "sweeps": pa.Table.from_pandas(sweeps, preserve_index=False),
        "outcomes": pa.Table.from_pandas(outcomes, preserve_index=False),
    }
    return sweep_map(tables, name)


def draw() -> None:
    """Write the picture of the page."""
    save_small(drawn(GRID), GRID)


def pages() -> dict[str, Parts]:
    """Return the generated parts of the page."""
    grid = kept(GRID)
    parts = {
        "intervals": setting_lines(grid, INTERVAL),
        "shares": setting_lines(grid, SHARE),
        "limits": setting_lines(kept(LIMIT), POPULATION_LIMIT),
        "effects": effect_lines(grid),
        "power": power_lines(grid),
        "check": check_lines(grid, kept(CHECK)),
    }
    return {"arena_settings.md": parts}


def setting_lines(rows: Frame, setting: str) -> list[str]:
    """Return a table of means over all runs with the same value of a setting.

    The interval of mean fitness is that of the mean over these runs.
    """
    heads = [f"`{setting.removeprefix('arena.')}`", "runs", "mean fitness [m/s]",
             "best [m/s]", "late gain", "tree edit distance", "living robots (least)",
             "simulated time per birth [s]"]  # fmt: skip
    lines = []
    for value, own in rows.groupby(setting):
        middle, low, high = mean_difference(own["fitness"].to_numpy(), 0.0)
        means = own.mean(numeric_only=True)
        lines.append([
            f"{value:g}", str(len(own)), f"{middle:.4f} ({low:.4f} to {high:.4f})",
            f"{means['fitness_best']:.4f}", f"{100 * own['late_gain'].median():.0f} %",
            f"{means['diversity']:.1f}",
            f"{means['size_mean']:.1f} ({means['size_least']:.1f})",
            f"{means['birth_s']:.1f}",
        ])  # fmt: skip
    return markdown(heads, lines)


def effect_lines(grid: Frame) -> list[str]:
    """Return a table: which outcomes depend on a setting, and which on the founders.

    Friedman's test compares the values of a setting between runs of the same repeat,
    so with the same founders, and of the same other setting. The last column is the
    share of an outcome's variance that lies between repeats.
    """
    heads, lines = (
        ["outcome", "interval: p", "share: p", "variance between repeats"],
        [],
    )
    for measure, name in TESTED.items():
        found = [
            friedmanchisquare(*blocks_of(grid, measure, setting).T).pvalue
            for setting in (INTERVAL, SHARE)
        ]
        rows = grid.assign(repeat=_repeats(grid))
        means = rows.groupby("repeat")[measure].transform("mean")
        between = means.var(ddof=0) / rows[measure].var(ddof=0)
        cells = (f"{p:.2g}" for p in found)
        lines.append([name, *cells, f"{100 * between:.0f} %"])
    return markdown(heads, lines)


def blocks_of(grid: Frame, measure: str, setting: str) -> np.ndarray[Any, Any]:
    """Return an outcome by the values of a setting, (B, V).

    A block has the same repeat, so the same founders, and the same other setting.
    """
    other = SHARE if setting == INTERVAL else INTERVAL
    rows = grid.assign(repeat=_repeats(grid))
    blocks = rows.pivot_table(
        index=["repeat", other], columns=setting, values=measure
    ).dropna()
    return np.asarray(blocks)


def _repeats(grid: Frame) -> Any:  # noqa: ANN401 - pandas
    return grid.index.str.rpartition("-").get_level_values(2)


def power_lines(grid: Frame) -> list[str]:
    """Return a table: how often Friedman's test finds an effect on mean fitness.

    In each of ``DRAWS`` draws the runs of a block are permuted, so that the setting has
    no effect; then the fitness at one of its five values is multiplied.
    """
    lines, rng = [], np.random.default_rng(1)
    for factor in (1, 2, 3):
        cells = []
        for setting in (INTERVAL, SHARE):
            blocks, hits = blocks_of(grid, "fitness", setting), 0
            for _ in range(DRAWS):
                drawn = rng.permuted(blocks, axis=1)
                drawn[:, 0] *= factor
                hits += int(friedmanchisquare(*drawn.T).pvalue < ALPHA)
            cells.append(f"{100 * hits / DRAWS:.0f} %")
        lines.append([f"{factor}", *cells])
    return markdown(["mean fitness at one value, times", "interval", "share"], lines)


def check_lines(grid: Frame, others: Frame) -> list[str]:
    """Return a table of points that are not in the grid.

    It has values interpolated from the grid's means, and observed values.
    """
    heads, lines = ["birth interval [s]", "survival share", "runs"], []
    for name, _ in SHOWN.values():
        heads += [f"{name}: expected", "observed"]
    for (interval, share), own in others.groupby([INTERVAL, SHARE]):
        cells = []
        for measure, (_, digits) in SHOWN.items():
            expected = interpolated(grid, measure, interval, share)
            least, most = own[measure].min(), own[measure].max()
            observed = f"{own[measure].mean():.{digits}f}"
            spread = f"{least:.{digits}f} to {most:.{digits}f}"
            cells += [f"{expected:.{digits}f}", f"{observed} ({spread})"]
        lines.append([f"{interval:g}", f"{share:g}", str(len(own)), *cells])
    return markdown(heads, lines)


def interpolated(grid: Frame, measure: str, interval: float, share: float) -> float:
    """Return a measure at settings between those of the grid, linear in both."""
    means = grid.pivot_table(index=INTERVAL, columns=SHARE, values=measure)
    at = RegularGridInterpolator((means.index, means.columns), means.to_numpy())
    return float(at((interval, share)))


main = command(__doc__, pages, draw, keep=("keep the rows of finished sweeps", keep))

if __name__ == "__main__":
    sys.exit(main(None))
