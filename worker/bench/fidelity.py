"""Sensitivity of fitness to the numerical settings of the simulator.

Robots of a run, drawn from each third of its robots in order of fitness, are
re-simulated with a finer time step, or with another changed setting; the two rankings
are compared.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from schema.errors import (
    ExperimentError,
    FitnessUndefined,
    RunFolderError,
    SensorFailed,
    SimulationDiverged,
)
from schema.experiment.document import (
    Experiment,
    Simulation,
    island_experiment,
    steps_of,
)
from schema.experiment.file import own_experiment
from schema.experiment.settings import evaluation_settings_of, lasting
from schema.robot.results import Floats
from schema.robot.robot import Robot
from schema.tables.description import allow_plugins_of
from schema.tables.files import read_table
from schema.wire.born import robot_of_birth
from schema.wire.updates import individual
from worker.robot.evaluation import evaluate

THIRDS = 3
WINNERS = 10


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
    experiment = own_experiment(runs["document"][0].as_py())
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
    """Return the rank correlation of two samples; ties share their mean rank.

    Args:
        first: (N,).
        second: (N,).

    Returns:
        The correlation; NaN if the numbers of a sample are all equal.

    Source: Spearman, 1904; tested against scipy in tests/worker/bench/test_fidelity.py.
    """
    ranks = _ranks(first), _ranks(second)
    if not all(each.std() for each in ranks):
        return math.nan
    return float(np.corrcoef(*ranks)[0, 1])


def _ranks(values: Floats) -> Floats:
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    ranks: Floats = (last - (count - 1) / 2)[place]
    return ranks
