"""Fitness under small changes of the simulation."""

from typing import Any

import numpy as np
import pytest
from msgspec.structs import asdict, replace

from schema.errors import (
    FitnessUndefined,
    RevolveError,
    SensorFailed,
    SimulationDiverged,
)
from schema.experiment.document import Fitness, Simulation
from schema.experiment.environment import Environment
from schema.experiment.identity import NO_IDENTITY
from schema.experiment.robust import Robust
from schema.experiment.settings import EvaluationSettings
from schema.robot.results import Evaluation, sustained
from schema.robot.robot import Robot
from tests.worker.evaluations import with_simulation
from worker.robot.disturbances import disturbances
from worker.robot.evaluation import evaluate, simulate
from worker.robot.robustness import (
    ChangedSettings,
    all_changes,
    rejudge,
    summary,
    window_changes,
)

SETTINGS = with_simulation(Simulation(window_steps=400, drop_m=0.01))
CHANGE = ChangedSettings("none", SETTINGS)
SMALL = [change for change in all_changes(SETTINGS) if change.is_small]


def test_each_change_changes_one_thing_and_no_duration() -> None:
    before = asdict(SETTINGS.simulation)
    differing = []
    for change in SMALL:
        assert replace(change.settings, simulation=SETTINGS.simulation) == SETTINGS
        after = asdict(change.settings.simulation)
        differing.append({name for name in after if after[name] != before[name]})
        world = change.settings.simulation
        assert world.window_steps * world.timestep_s == pytest.approx(2.0)
        assert world.brain_steps * world.timestep_s == pytest.approx(0.125)
    clocks = {"timestep_s", "brain_steps", "pose_steps", "window_steps"}
    assert differing == [clocks, clocks, {"friction"}, *[{"drop_m"}] * 8]
    steps = [change.settings.simulation.timestep_s for change in SMALL[:2]]
    assert steps == pytest.approx([0.0025, 0.001])
    assert SMALL[2].settings.simulation.friction == pytest.approx(0.99)
    lifts = [1000 * (one.settings.simulation.drop_m - 0.01) for one in SMALL[3:]]
    assert len({*lifts}) == 8
    assert all(0 < lift < 0.2 for lift in lifts)
    assert sum(lifts) / 8 == pytest.approx(0.1, abs=0.05)


def test_all_changes_by_hand() -> None:
    changes = all_changes(SETTINGS)
    counts: dict[str, int] = {}
    for change in changes:
        counts[change.group] = counts.get(change.group, 0) + 1
    assert counts == {
        "later window": 4, "time step": 2, "friction": 4, "start": 12, "mass": 2,
        "torque": 2, "noise": 2, "ground": 2,
    }  # fmt: skip
    assert len({change.name for change in changes}) == len(changes) == 30
    found = {change.name: change.settings for change in changes}
    base = SETTINGS.simulation
    expected: dict[str, dict[str, Any]] = {
        "window 2 to 4 s": {"warmup_steps": 400},
        "window 8 to 10 s": {"warmup_steps": 1600},
        "friction 0.9": {"friction": 0.9},
        "friction 1.1": {"friction": 1.1},
        "start tilted -1 degree about y": {"start_deg": (0.0, -1.0, 0.0)},
        "start tilted +1 degree about x": {"start_deg": (1.0, 0.0, 0.0)},
        "mass x 0.9": {"mass_factor": 0.9},
        "torque x 1.1": {"torque_factor": 1.1},
    }
    for name, wanted in expected.items():
        simulation = replace(base, **wanted)
        assert found[name] == replace(SETTINGS, simulation=simulation)
    slope, bumps = found["slope +1 degree"], found["ground with bumps of 2 mm"]
    assert slope == replace(SETTINGS, environment=Environment(slope_deg=1.0))
    assert bumps == replace(SETTINGS, environment=Environment(roughness_m=0.002))
    rough = replace(SETTINGS, environment=Environment(roughness_m=0.1, ground_seed=4))
    other = {change.name: change.settings for change in all_changes(rough)}
    assert other["other bumps"].environment.ground_seed == 5


def test_noise_is_the_only_disturbance_of_its_change(turtle: Robot) -> None:
    changes = {change.name: change.settings for change in all_changes(SETTINGS)}
    noisy = changes["actuator noise 0.01"]
    rules = noisy.robust
    assert rules is not None
    worlds = [own.simulation for own, _ in disturbances(noisy, rules, NO_IDENTITY)]
    assert worlds == [replace(SETTINGS.simulation, actuator_noise=0.01)] * 4
    trials = [
        evaluate(turtle, own, name).fitness
        for own, name in disturbances(noisy, rules, NO_IDENTITY)
    ]
    assert evaluate(turtle, noisy).fitness == pytest.approx(sum(trials) / 4)
    assert len({*trials}) == 4


def test_fitness_is_that_of_an_evaluation_with_the_changed_settings(
    turtle: Robot,
) -> None:
    slow = replace(SETTINGS, fitness=Fitness(path_weight=0.5))
    changes = [CHANGE, ChangedSettings("half the weight", slow)]
    assert [fitness for _, fitness in rejudge(turtle, changes)] == [
        evaluate(turtle, SETTINGS).fitness,
        evaluate(turtle, slow).fitness,
    ]


@pytest.mark.parametrize(
    "failure", [SimulationDiverged, SensorFailed, FitnessUndefined]
)
def test_failed_evaluations_have_no_fitness(
    turtle: Robot, failure: type[RevolveError]
) -> None:
    def fake(_: Robot, settings: EvaluationSettings) -> Evaluation:
        if settings.simulation.friction < 1.0:
            raise failure("slipped away")
        return Evaluation(0.5, 0.0, 0.0, 12.0)

    judgements = rejudge(turtle, SMALL, fake)
    found = [fitness for _, fitness in judgements]
    assert found == [0.5, 0.5, None, *[0.5] * 8]


def test_later_windows_follow_that_of_the_evaluation(turtle: Robot) -> None:
    """Oracle: velocities between the ends of windows of one long simulation."""
    drawn = replace(
        SETTINGS,
        simulation=replace(SETTINGS.simulation, warmup_steps=200),
        fitness=Fitness(path_weight=0.0, straight_weight=1.0),
        robust=Robust(),
    )
    whole = replace(SETTINGS.simulation, window_steps=5 * 400 + 200)
    path = simulate(turtle, with_simulation(whole)).core_position[:, :2]
    ends = path[[5 + 10 * number for number in range(6)]]
    lengths = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    changes = window_changes(drawn)
    assert [one.name for one in changes] == [
        "window 3 to 5 s", "window 5 to 7 s", "window 7 to 9 s", "window 9 to 11 s"
    ]  # fmt: skip
    assert [fitness for _, fitness in rejudge(turtle, changes)] == pytest.approx(
        (lengths[1:] / 2).tolist(), rel=1e-9
    )


@pytest.mark.parametrize(
    ("selected", "later", "share"),
    [
        (0.4, (0.1, 0.2, 0.3, 0.2), 0.5),
        (0.4, (0.1, None, 0.3, 0.2), 0.375),
        (0.0, (0.1, 0.1, 0.1, 0.1), None),
        (-0.4, (0.1, 0.1, 0.1, 0.1), None),
        (None, (0.1, 0.1, 0.1, 0.1), None),
    ],
)
def test_sustained(
    selected: float | None, later: tuple[float | None, ...], share: float | None
) -> None:
    assert sustained(selected, later) == pytest.approx(share)


@pytest.mark.parametrize(
    ("fitness", "found", "line"),
    [
        (
            0.125,
            (0.07625, 0.1, 0.1325),
            "keeps 61 to 106 % of its fitness (0.125) under",
        ),
        (0.1, (0.1, None), "start; 1 of them failed"),
        (-0.2, (-0.25, -0.1), "has a fitness of -0.25 to -0.1 under 2 small changes"),
        (0.3, (None,), "has no fitness under 1 small changes"),
        (0.125, (0.1,), "start; sustains 25 % in the next 2 windows"),
    ],
)
def test_summary(fitness: float, found: tuple[float | None, ...], line: str) -> None:
    assert line in summary(fitness, found, (0.0, 0.0625))
