"""Draws docs/tutorials/pictures/ from the runs of the tutorials.

    python -m docs.studies.tutorial_pictures FOLDER

FOLDER has what the commands of tutorials 1, 3 and 4 write. Fitness is an SVG; the
pictures of robots are copies of those that the tutorials' commands draw.
"""

import shutil
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

import revolve as rv

PICTURES = Path(__file__).resolve().parents[1] / "tutorials" / "pictures"
COPIES = {"best.png": "first-gait.png", "jump.png": "jump.png", "feet.png": "feet.png"}


def main(folder: Path) -> int:
    """Draw all; return 0."""
    PICTURES.mkdir(exist_ok=True)
    rows = rv.read(folder / "runs" / "first").population.to_pandas()
    groups = rows.assign(fitness=rows["fitness"].fillna(0.0)).groupby("births")
    # Same source, same bytes: no date, fixed ids.
    mpl.rcParams.update({"svg.hashsalt": "revolve", "font.size": 9})
    figure, axes = plt.subplots(figsize=(6.4, 2.9), layout="constrained")
    for name, colour in (("max", "#c77b2f"), ("mean", "#3b6ea8")):
        found = groups["fitness"].agg(name)
        label = "best" if name == "max" else "mean"
        axes.plot(found.index, found.to_numpy(), color=colour, marker=".", label=label)
    axes.set(xlabel="births", ylabel="fitness of the population [m/s]", ylim=(0, None))
    axes.set_xticks(np.arange(0, 301, 50))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    figure.savefig(PICTURES / "first-run.svg", metadata={"Date": None})
    for source, name in COPIES.items():
        shutil.copy(folder / source, PICTURES / name)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
