"""Compares learners with random search on fixed bodies, for docs/learning.md.

    python -m docs.studies.learners run    # start, or go on after an end
    python -m docs.studies.learners page   # draw the picture, write the table

The bodies are ten random robots of scenario 1 and ten that evolved in scenario 3. Each
learner starts with the robot's own brain, ten times with other random streams. Rows are
kept in docs/learners_data/, one per finished search. Evaluations take 4 s, a
third of the time of scenario 1.
"""

import sys
from collections.abc import Callable
from itertools import accumulate, product
from math import inf, sqrt

import matplotlib.pyplot as plt
import numpy as np
import pyarrow.parquet as pq
from msgspec import structs
from scipy import stats

from analysis.comparison.statistics import mean_difference
from analyzer.report import analyze
from coordinator.evolution.learners.brain_parameters import BrainParameters
from coordinator.evolution.learners.learner import Batch, NewbornLearner, Points
from coordinator.evolution.newborns import founder
from coordinator.evolution.random_streams import Purpose, stream
from docs.studies.pages import (
    DOCS,
    PICTURES,
    ROOT,
    Parts,
    append_csv,
    command,
    csv_rows,
    markdown,
)
from schema.errors import FitnessUndefined, SimulationDiverged
from schema.experiment.document import Vetting, body_space
from schema.experiment.file import read_experiment
from schema.experiment.learning import Learning
from schema.experiment.settings import evaluation_settings_of
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.protobuf import decode_genome
from worker.robot.evaluation import evaluate

DATA = DOCS / "learners_data"
EVOLVED = ROOT / "tests" / "benchmarks" / "evolved.parquet"
EXPERIMENT = read_experiment("scenario1")
SHORT = structs.replace(EXPERIMENT.simulation, window_steps=800)
"""Evaluations of 4 s: the ones of scenario 1 take 12 s."""
SETTINGS = structs.replace(evaluation_settings_of(EXPERIMENT), simulation=SHORT)
BODIES, SEEDS, BUDGET = 10, 10, 60
COLOURS = ("#D55E00", "#E69F00", "#0072B2", "#7F7F7F")
BASE = "random"
LEARNERS = {
    "cma-es": Learning(),
    "cma-es, population 6": Learning(parameters={"population": 6}),
    "(1+1)-es": Learning(learner="(1+1)-es"),
    BASE: Learning(learner="random"),
}


def random_bodies(count: int) -> list[Robot]:
    """Return the first random robots of scenario 1 that pass vetting."""
    robots = list[Robot]()
    types = body_space(EXPERIMENT.space)
    for number in range(10 * count):
        robot = founder(EXPERIMENT, 1, number)
        if analyze(robot, types, Vetting()).is_viable:
            robots.append(robot)
    return robots[:count]


def evolved_bodies(count: int) -> list[Robot]:
    """Return robots that evolved in scenario 3."""
    types = body_space(EXPERIMENT.space)
    genomes = pq.read_table(EVOLVED, columns=["genome"])["genome"].to_pylist()
    # Ten of each of three runs.
    step = len(genomes) // count
    return [develop(decode_genome(data), types) for data in genomes[::step]][:count]


SETS: dict[str, Callable[[int], list[Robot]]] = {
    "random": random_bodies,
    "evolved": evolved_bodies,
}


def fitness_of(robot: Robot) -> float:
    """Return the fitness of a robot; -inf if its evaluation fails."""
    try:
        return evaluate(robot, SETTINGS).fitness
    except (SimulationDiverged, FitnessUndefined):
        return -inf


def search(
    robot: Robot, rules: Learning, name: BirthId, seed: int, budget: int
) -> list[float]:
    """Return the best fitness after each trial.

    Args:
        robot: whose brain is learnt.
        rules: learner and its parameters.
        name: of the robot, for the random streams.
        seed: of the search.
        budget: number of trials.
    """
    parameters = BrainParameters(rules, EXPERIMENT.brain, EXPERIMENT.space)
    start = parameters.read(robot)
    own = NewbornLearner(rules, start)
    found, begin = [fitness_of(robot)], 0
    points: Points = (start,)
    while len(found) < budget:
        rng = stream(seed, 0, name, len(found), Purpose.LEARNING)
        new = own.ask(rng, budget - len(found))
        found += [fitness_of(parameters.written(robot, each)) for each in new]
        points += new
        batch: Batch = (points[begin:], tuple(found[begin:]))
        own.tell(batch)
        begin = len(found)
    return list(accumulate(found, max))


def _known(bodies: str) -> list[dict[str, str]]:
    return csv_rows(DATA / f"{bodies}.csv")


def run(_: object = None) -> None:
    """Make the searches whose rows are missing."""
    for bodies, make in SETS.items():
        done = {(row["body"], row["learner"], row["seed"]) for row in _known(bodies)}
        robots = make(BODIES)
        for seed, learner in product(range(SEEDS), LEARNERS):
            for number, robot in enumerate(robots):
                names = {"body": str(number), "learner": learner, "seed": str(seed)}
                if (*names.values(),) not in done:
                    rules, name = LEARNERS[learner], BirthId(0, number)
                    best = search(robot, rules, name, seed, BUDGET)
                    trials = {
                        f"best_{at}": f"{each:.9g}" for at, each in enumerate(best)
                    }
                    append_csv(DATA / f"{bodies}.csv", names | trials)
            print(f"seed {seed}, {bodies} bodies, {learner}", flush=True)


def courses() -> dict[tuple[str, str], np.ndarray[tuple[int, int, int]]]:
    """Return the best fitness by kind of bodies and learner: (seed, body, trial)."""
    found: dict[tuple[str, str], dict[tuple[int, int], list[float]]] = {}
    for bodies, row in ((name, row) for name in SETS for row in _known(name)):
        best = [float(row[f"best_{trial}"]) for trial in range(BUDGET)]
        at = found.setdefault((bodies, row["learner"]), {})
        at[int(row["seed"]), int(row["body"])] = best
    return {
        name: np.array(
            [[own[seed, body] for body in range(BODIES)] for seed in range(SEEDS)]
        )
        for name, own in found.items()
        if len(own) == BODIES * SEEDS
    }


def lines() -> list[str]:
    """Return the lines of the table: means over bodies, intervals over seeds."""
    more = ["more than `random` (95 % interval)", f"better, of {BODIES} bodies", "p"]
    heads = ["bodies", "learner", "at birth", "after 20 trials", *more,
             "after 60 trials", *more]  # fmt: skip
    found, rows = courses(), []
    for (bodies, learner), best in found.items():
        cells = [bodies, f"`{learner}`", f"{best[:, :, 0].mean():.4f}"]
        for trials in (20, BUDGET):
            reached, base = (
                each[:, :, trials - 1] for each in (best, found[bodies, BASE])
            )
            cells.append(f"{reached.mean():.4f}")
            cells += [""] * 3 if learner == BASE else _more(reached - base)
        rows.append(cells)
    return markdown(heads, rows)


def _more(more: np.ndarray[tuple[int, int]]) -> list[str]:
    """Return mean, interval, sign and p of differences (seed, body) over bodies."""
    bodies = more.mean(axis=0)
    middle, low, high = mean_difference(bodies, 0.0)
    p = stats.wilcoxon(bodies, method="exact").pvalue
    return [f"{middle:+.4f} ({low:+.4f} to {high:+.4f})", str((bodies > 0).sum()),
            f"{p:.2g}"]  # fmt: skip


def draw() -> None:
    """Write the picture: means over bodies by trial, with intervals over seeds."""
    figure, axes = plt.subplots(1, len(SETS), figsize=(9, 3.6), layout="constrained")
    found, trials = courses(), np.arange(BUDGET)
    quantile = stats.t.ppf(0.975, SEEDS - 1)
    for panel, bodies in zip(axes, SETS, strict=True):
        for learner, colour in zip(LEARNERS, COLOURS, strict=True):
            if (bodies, learner) not in found:
                continue
            means = found[bodies, learner].mean(axis=1)
            half = quantile * means.std(axis=0, ddof=1) / sqrt(SEEDS)
            middle = means.mean(axis=0)
            panel.plot(trials, middle, color=colour, label=learner)
            panel.fill_between(
                trials, middle - half, middle + half, color=colour, alpha=0.2, lw=0
            )
        panel.set(title=f"{bodies} bodies", xlabel="trial", ylim=(0, None))
        panel.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("best fitness so far [m/s]")
    axes[-1].legend(frameon=False, loc="lower right")
    figure.savefig(PICTURES / "learners.png", dpi=120)


def pages() -> dict[str, Parts]:
    """Return the generated part of the page."""
    return {"learning.md": {"learners": lines()}}


main = command(__doc__, pages, draw, run=("make the searches that are missing", run))

if __name__ == "__main__":
    sys.exit(main(None))
