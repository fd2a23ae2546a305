"""Sensitivity of fitness to the numerical settings of the simulator.

Robots of a run, drawn from each third of its robots in order of fitness, are
re-simulated with a finer time step, or with another changed setting; the two rankings
are compared.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from schema.errors import (
    ExperimentError,
    RunFolderError,
    SensorFailed,
    SimulationDiverged,
)
from schema.experiment.document import Experiment, Simulation
from schema.experiment.file import own_experiment
from schema.formats.files import settings_of
from schema.robot.results import Floats
from schema.robot.robot import Robot
from schema.tables.files import read_table
from schema.wire.born import robot_of_birth
from worker.robot.evaluation import evaluate

THIRDS = 3
WINNERS = 10


@dataclass(frozen=True, slots=True)
class Population:
    """Evaluated robots of a run: its experiment, N robots, and their fitness (N,)."""

    experiment: Experiment
    robots: tuple[Robot, ...]
    fitness: Floats


def read_population(folder: Path) -> Population:
    """Return the robots of a run and their fitness.

    Args:
        folder: of a run, finished or not; failed evaluations are left out.

    Raises:
        RunFolderError: no such folder, or not of a run that has started.
        MalformedMessage: an invalid genome.
    """
    runs = read_table(folder, "runs")
    if not runs.num_rows:
        raise RunFolderError(f"{folder}: no run is there, or none that has begun")
    experiment = own_experiment(runs["document"][0].as_py())
    names = ["island", "birth", "genome", "robot"]
    births = read_table(folder, "births").select(names).to_pylist()
    born = {(row["island"], row["birth"]): row for row in births}
    evaluations = read_table(folder, "evaluations")
    columns = ["island", "birth", "fitness"]
    evaluated = evaluations.select(columns).drop_null().to_pylist()
    return Population(
        experiment,
        tuple(
            robot_of_birth(one["genome"], one["robot"], experiment)
            for one in (born[row["island"], row["birth"]] for row in evaluated)
        ),
        np.array([row["fitness"] for row in evaluated]),
    )


def sample_thirds(fitness: Floats, per_third: int, seed: int = 1) -> list[int]:
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


def compare(
    robots: Iterable[Robot], experiment: Experiment, other: Simulation
) -> Floats:
    """Return the fitness of N robots in two simulations, (2, N) [m/s].

    The first simulation is that of their experiment.

    Args:
        robots: checked robots.
        experiment: limits, simulation and fitness.
        other: simulation to compare with; a robot that diverges has fitness 0.
    """
    worlds = (experiment.simulation, other)
    found = [
        [_fitness(robot, experiment, world) for world in worlds] for robot in robots
    ]
    return np.array(found).reshape(-1, 2).T


def _fitness(robot: Robot, experiment: Experiment, world: Simulation) -> float:
    settings = replace(settings_of(experiment), simulation=world)
    try:
        return evaluate(robot, settings).fitness
    except (SimulationDiverged, SensorFailed):
        return 0.0


def spearman(first: Floats, second: Floats) -> float:
    """Return the rank correlation of two samples; ties share their mean rank.

    Args:
        first: (N,), not all equal.
        second: (N,), not all equal.

    Source: Spearman, 1904; tested against scipy in tests/worker/bench/test_fidelity.py.
    """
    return float(np.corrcoef(_ranks(first), _ranks(second))[0, 1])


def _ranks(values: Floats) -> Floats:
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    ranks: Floats = (last - (count - 1) / 2)[place]
    return ranks
