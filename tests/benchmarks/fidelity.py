"""Sensitivity of fitness to the numerical settings of the simulator.

Robots of a run, drawn from each third of its robots in order of fitness, are
re-simulated with a finer time step, or with another changed setting; the two rankings
are compared: ``python -m tests.benchmarks.fidelity RUN``.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec.structs import replace
from scipy.stats import spearmanr

from schema.agent.flags import Flags, add_plugins
from schema.agent.supervisor import prepare_process
from schema.errors import (
    ExperimentError,
    FitnessUndefined,
    RunFolderError,
    SensorFailed,
    SimulationDiverged,
)
from schema.experiment.check import check_experiment
from schema.experiment.document import (
    Experiment,
    Simulation,
    island_experiment,
    steps_of,
)
from schema.experiment.file import experiment_from_text, read_experiment
from schema.experiment.settings import evaluation_settings_of, lasting
from schema.plugins.bounded import parse_toml
from schema.plugins.permission import allow
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.tables.description import allow_plugins_of
from schema.tables.files import read_table
from schema.wire.born import robot_of_birth
from schema.wire.updates import individual
from worker.robot.evaluation import evaluate
from worker.robot.robustness import finer

THIRDS = 3
WINNERS = 10
LEAST_SPEARMAN = 0.95
"""Goal for the rank correlation of fitness with a time step five times finer."""
_AGAINST = "--against"

Change = Callable[[Experiment], Simulation]
"""Returns the simulation to compare with that of an experiment."""


class Evaluated(NamedTuple):
    """Robot of a run, and settings of its evaluation: those of its island."""

    robot: Robot
    experiment: Experiment


@dataclass(frozen=True, slots=True)
class Population:
    """Evaluated robots of a run, N of them, and their fitness (N,)."""

    robots: tuple[Evaluated, ...]
    fitness: Floats


def read_population(folder: Path) -> Population:
    """Return the robots of a run and their fitness.

    Args:
        folder: of a run, finished or not; failed evaluations are left out.

    Raises:
        RunFolderError: no such folder, or not of a run that has started.
        ExperimentError: a plug-in of the run that is not allowed, or differs.
        MalformedMessage: an invalid genome.
    """
    runs = read_table(folder, "runs")
    if not runs.num_rows:
        raise RunFolderError(f"{folder}: no run is there, or none that has begun")
    allow_plugins_of(folder)
    experiment = experiment_from_text(runs["document"][0].as_py(), is_own=True)
    names = ["island", "birth", "genome", "robot"]
    births = read_table(folder, "births", names).to_pylist()
    born = {(row["island"], row["birth"]): row for row in births}
    evaluations = read_table(folder, "evaluations").to_pylist()
    evaluated = [row for row in evaluations if row["fitness"] is not None]
    return Population(
        tuple(_evaluated(row, born[individual(row)], experiment) for row in evaluated),
        np.array([row["fitness"] for row in evaluated]),
    )


def _evaluated(
    row: Mapping[str, Any], born: Mapping[str, Any], experiment: Experiment
) -> Evaluated:
    """Return the robot of a row of the evaluations table, given its birth."""
    own = island_experiment(experiment, row["island"])
    robot = robot_of_birth(born["genome"], born["robot"], own)
    steps = steps_of(row["simulated_s"], own.simulation)
    clock = lasting(evaluation_settings_of(own), steps).simulation
    # This evaluation's own length, of which none is drawn.
    clock = replace(clock, evaluation_s=None)
    return Evaluated(robot, replace(own, simulation=clock))


def sample_thirds(fitness: Floats, per_third: int, seed: int) -> list[int]:
    """Return indices drawn from each third of the robots, the least fit third first.

    Args:
        fitness: (N,) of all.
        per_third: number drawn from each third, without replacement.
        seed: of the draw.

    Raises:
        ExperimentError: fewer robots than that.
    """
    if len(fitness) < THIRDS * per_third:
        raise ExperimentError(
            f"{THIRDS} x {per_third} robots are needed, the run has {len(fitness)}"
        )
    rng = np.random.default_rng(seed)
    return [
        int(index)
        for third in np.array_split(np.argsort(fitness, kind="stable"), THIRDS)
        for index in np.sort(rng.choice(third, per_third, replace=False))
    ]


def winners(fitness: Floats) -> list[int]:
    """Return the indices of the ten fittest, fittest first."""
    return [int(index) for index in np.argsort(-fitness, kind="stable")[:WINNERS]]


def compare(robots: Iterable[Evaluated], change: Change) -> Floats:
    """Return the fitness of N robots in two simulations, (2, N) [m/s].

    The first simulation is that of their island. An evaluation that fails counts as
    fitness 0.

    Args:
        robots: checked robots.
        change: returns the other simulation.
    """
    found = [
        [_fitness(robot, own, world) for world in (own.simulation, change(own))]
        for robot, own in robots
    ]
    return np.array(found).reshape(-1, 2).T


def _fitness(robot: Robot, experiment: Experiment, world: Simulation) -> float:
    settings = replace(evaluation_settings_of(experiment), simulation=world)
    try:
        return evaluate(robot, settings).fitness
    except (SimulationDiverged, SensorFailed, FitnessUndefined):
        return 0.0


def spearman(first: Floats, second: Floats) -> float:
    """Return the rank correlation of two samples; NaN if one's numbers are all equal.

    Args:
        first: (N,).
        second: (N,).
    """
    if not (np.ptp(first) and np.ptp(second)):
        return math.nan
    return float(spearmanr(first, second).statistic)


def main(folder: Path, per_third: int, seed: int, against: Sequence[str]) -> None:
    """Compare and print the results.

    Args:
        folder: of the run.
        per_third: number of robots drawn from each third of the run's robots.
        seed: of the draw.
        against: changed simulation settings, "KEY=VALUE" in TOML; none: finer steps.
    """
    population = read_population(folder)
    change = partial(changed, against)
    chosen = sample_thirds(population.fitness, per_third, seed)
    best = winners(population.fitness)
    found, top = (
        compare([population.robots[index] for index in which], change)
        for which in (chosen, best)
    )
    print(
        f"{len(chosen)} robots of {folder}: Spearman {spearman(*found):.4f} (goal: "
        f"{LEAST_SPEARMAN}); mean {found[0].mean():.4f} here, {found[1].mean():.4f} "
        "there"
    )
    thirds = np.split(found, THIRDS, axis=1)
    by_third = ", ".join(f"{spearman(*each):.3f}" for each in thirds)
    print(f"  by thirds, least fit first: {by_third}")
    for rank, (here, there) in enumerate(top.T, start=1):
        print(f"  winner {rank}: {here:.4f} here, {there:.4f} there")


def changed(settings: Sequence[str], experiment: Experiment) -> Simulation:
    """Return the experiment's simulation with some keys set, or finer; checked."""
    if not settings:
        return finer(experiment.simulation)
    tables = parse_toml("[simulation]\n" + "\n".join(settings), _AGAINST)
    simulation = msgspec.to_builtins(experiment.simulation) | tables["simulation"]
    tables |= {"name": experiment.name, "simulation": simulation}
    found = read_experiment(tables, _AGAINST).simulation
    check_experiment(replace(experiment, simulation=found), _AGAINST)
    return found


if __name__ == "__main__":
    flags = Flags(description=__doc__)
    flags.add_argument("folder", type=Path, metavar="RUN")
    flags.add_argument("--per-third", type=int, default=20)
    flags.add_argument("--seed", type=int, default=1)
    flags.add_argument("--against", action="append", default=[], metavar="KEY=VALUE")
    add_plugins(flags)
    options = vars(flags.parse_args())
    prepare_process()
    allow(options.pop("plugins"))
    main(**options)
