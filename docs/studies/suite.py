"""Table and picture of the scores of the suite, for docs/suite.md.

    python -m docs.studies.suite page          # write them
    python -m docs.studies.suite page --check  # compare the table
    python -m docs.studies.suite run FOLDER    # make our scores again, below FOLDER

Scores are files of ``revolve suite run``: the references that the package has, and the
files of docs/data/suite, one per experiment.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from matplotlib import pyplot as plt

from docs.studies.pages import DOCS, PICTURES, ROOT, Parts, command, markdown
from revolve.suite.protocol import read_protocol
from revolve.suite.score import REFERENCES, WINDOWS, Score, read_score

DATA = DOCS / "data" / "suite"
OURS = ("no-reproduction", "scenario1", "map-elites")
UNITS = {"turning": "rad/s"}
COLOURS = {"first": "#0072B2", "later": "#D55E00"}


def scores() -> list[Score]:
    """Return all scores, the references first."""
    files = sorted(map(str, DATA.glob("*.json")))
    return [read_score(each, read_protocol()) for each in (*REFERENCES, *files)]


def table() -> list[str]:
    """Return the lines of the table."""
    heads = ["task", "experiment", "first window", "later windows",
             "delta, random search", "delta, `scenario1`"]  # fmt: skip
    rows = []
    for task in read_protocol().tasks:
        for score in scores():
            own = score.tasks[task]
            cells = [task, f"`{score.name}`"]
            cells += [_interval(own.medians[window], task) for window in WINDOWS]
            for name in REFERENCES:
                row = own.against[name]["later"]
                ends = f"{row['effect_low']:+.2f} to {row['effect_high']:+.2f}"
                shown = f"{row['effect']:+.2f} ({ends})"
                cells.append("" if name == score.name else shown)
            rows.append(cells)
    return markdown(heads, rows)


def _interval(ends: list[float | None], task: str) -> str:
    low, median, high = ends
    return f"{median:.4f} {UNITS.get(task, 'm/s')} ({low:.4f} to {high:.4f})"


def draw() -> None:
    """Write the picture: each run's score, and the medians."""
    known, tasks = scores(), [*read_protocol().tasks]
    size = (10, 0.7 + 0.45 * len(known))
    figure, axes = plt.subplots(1, len(tasks), figsize=size, layout="constrained")
    for panel, task in zip(axes, tasks, strict=True):
        for place, score in enumerate(known):
            for shift, window in zip((-0.13, 0.13), WINDOWS, strict=True):
                values = getattr(score.tasks[task], window)
                height, colour = place + shift, COLOURS[window]
                panel.plot(values, [height] * len(values), "o", color=colour,
                           alpha=0.45, ms=4, mew=0)  # fmt: skip
                median = score.tasks[task].medians[window][1]
                panel.plot([median], [height], "|", color=colour, ms=11, mew=2.5)
        panel.set_title(f"{task} [{UNITS.get(task, 'm/s')}]", fontsize=9)
        panel.set_yticks(range(len(known)), [score.name for score in known])
        panel.set(
            xlim=(min(0.0, panel.get_xlim()[0]), None), ylim=(len(known) - 0.5, -0.5)
        )
        panel.tick_params(labelsize=8, labelleft=panel is axes[0])
        panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(PICTURES / "suite.png", dpi=130)
    plt.close(figure)


def run(folders: list[Path]) -> None:
    """Make our scores again in a folder, and keep them."""
    (folder,) = folders
    for name in OURS:
        place = folder / name
        words = ["suite", "run", "--experiment", name, "--out", str(place)]
        subprocess.run([sys.executable, "-m", "revolve", *words], cwd=ROOT, check=True)
        home = ROOT / "revolve" / "suite" if name in REFERENCES else DATA
        shutil.copy(place / "score.json", home / f"{name}.json")


def pages() -> dict[str, Parts]:
    """Return the generated part of the page."""
    return {"suite.md": {"scores": table()}}


main = command(__doc__, pages, draw, run=("make our scores again in a folder", run))

if __name__ == "__main__":
    sys.exit(main(None))
