"""Evaluation under drawn disturbances."""

import math

import pytest
from msgspec.structs import replace

from schema.errors import SimulationDiverged
from schema.experiment.document import Simulation
from schema.experiment.identity import NO_IDENTITY, Identity, Origin
from schema.experiment.robust import RANGES, Robust
from schema.experiment.settings import EvaluationSettings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from tests.worker.evaluations import with_simulation
from worker.robot.control_loop import ControlLoop
from worker.robot.disturbances import combined, disturbances
from worker.robot.evaluation import EvaluationLoop, evaluate

SETTINGS = with_simulation(Simulation(window_steps=400, friction=0.5, drop_m=0.01))
STILL = Robust(
    draws=1,
    friction=(1, 1),
    mass=(1, 1),
    torque=(1, 1),
    lift_m=(0, 0),
    tilt_deg=(0, 0),
    sensor_noise=(0, 0),
    actuator_noise=(0, 0),
)
"""No disturbance at all."""


def drawn(
    rules: Robust, identity: Identity = NO_IDENTITY
) -> list[tuple[EvaluationSettings, Identity]]:
    return list(disturbances(SETTINGS, rules, identity))


def result(fitness: float, straight: float = 0.0) -> Evaluation:
    return Evaluation(fitness, 2 * straight, straight, 2.0, (10 * fitness,))


def test_ranges_of_width_zero_give_the_plain_evaluation(turtle: Robot) -> None:
    settings = replace(SETTINGS, robust=STILL)
    assert evaluate(turtle, settings) == evaluate(turtle, SETTINGS)


def test_fixed_disturbances_are_those_of_the_simulation(turtle: Robot) -> None:
    rules = replace(
        STILL, friction=(0.8, 0.8), mass=(2, 2), torque=(0.5, 0.5), lift_m=(0.02, 0.02),
        tilt_deg=(3, 3), heading_deg=(90, 90), sensor_noise=(0.1, 0.1),
        actuator_noise=(0.2, 0.2),
    )  # fmt: skip
    ((settings, identity),) = drawn(rules)
    world = Simulation(
        window_steps=400, friction=0.4, drop_m=0.03, mass_factor=2.0,
        torque_factor=0.5, start_deg=(3.0, 3.0, 90.0), sensor_noise=0.1,
        actuator_noise=0.2,
    )  # fmt: skip
    assert settings == replace(SETTINGS, simulation=world)
    assert identity == NO_IDENTITY
    assert evaluate(turtle, replace(SETTINGS, robust=rules)) == evaluate(
        turtle, settings
    )


@pytest.mark.parametrize("distribution", ["uniform", "normal"])
def test_draws_fill_their_ranges(distribution: str) -> None:
    rules = Robust(draws=100, distribution=distribution)  # type: ignore[arg-type]
    found = [settings.simulation.friction for settings, _ in drawn(rules)]
    assert len({*found}) > 90
    assert 0.45 <= min(found) < 0.46
    assert 0.54 < max(found) <= 0.55
    mean = sum(found) / 100
    sd = math.sqrt(sum((one - mean) ** 2 for one in found) / 100)
    # Of a uniform distribution, the width over the root of 12; else a quarter.
    wanted = 0.1 / math.sqrt(12) if distribution == "uniform" else 0.025
    assert mean == pytest.approx(0.5, abs=4 * wanted / 10)
    assert sd == pytest.approx(wanted, rel=0.2)


def test_draws_depend_on_the_identity_alone() -> None:
    rules = Robust(draws=3)
    birth, other = BirthId(0, 5), BirthId(0, 6)
    first = Identity(Origin(seed=1), birth, 0)
    identities = [
        first,
        Identity(Origin(seed=2), birth, 0),
        Identity(Origin(seed=1, run=1), birth, 0),
        Identity(Origin(seed=1, island=1), birth, 0),
        Identity(Origin(seed=1), other, 0),
        Identity(Origin(seed=1), birth, 1),
    ]
    assert drawn(rules, first) == drawn(rules, first)
    worlds = [
        settings.simulation
        for identity in identities
        for settings, _ in drawn(rules, identity)
    ]
    assert len({*worlds}) == 18
    names = [
        own for one in (identities[0], identities[5]) for _, own in drawn(rules, one)
    ]
    assert [each.trial for each in names] == [0, 1, 2, 3, 4, 5]


def test_a_range_does_not_change_the_draws_from_another() -> None:
    before = drawn(Robust())
    for name in RANGES:
        for (old, _), (new, _) in zip(
            before, drawn(replace(Robust(), **{name: (1.0, 1.0)})), strict=True
        ):
            changed = {
                each
                for each in old.simulation.__struct_fields__
                if getattr(old.simulation, each) != getattr(new.simulation, each)
            }
            assert len(changed) == 1


@pytest.mark.parametrize(
    ("rules", "fitness"),
    [
        (Robust(take="least"), 1.0),
        (Robust(take="mean"), 3.0),
        (Robust(take="quantile"), 1.75),
        (Robust(take="quantile", quantile=0.5), 2.5),
        (Robust(take="quantile", quantile=1.0), 6.0),
    ],
)
def test_combination_by_hand(rules: Robust, fitness: float) -> None:
    found = [result(3.0, 0.1), result(1.0, 0.2), result(2.0, 0.3), result(6.0, 0.4)]
    both = combined(found, rules)
    assert both.fitness == fitness
    assert both.path_velocity == pytest.approx(0.5)
    assert both.straight_velocity == pytest.approx(0.25)
    assert both.simulated_s == 2.0
    assert both.measures == (30.0,)


def test_fitness_is_that_of_the_draws(turtle: Robot) -> None:
    rules = Robust(draws=3, take="least")
    single = [evaluate(turtle, own, name).fitness for own, name in drawn(rules)]
    assert len({*single}) == 3
    assert evaluate(turtle, replace(SETTINGS, robust=rules)).fitness == min(single)


def test_a_failed_draw_is_a_failure_with_its_number(
    turtle: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    start, starts = EvaluationLoop._start, iter(range(2))

    def fake(self: EvaluationLoop) -> ControlLoop:
        if next(starts):
            raise SimulationDiverged("physics diverged by 1.000 s")
        return start(self)

    monkeypatch.setattr(EvaluationLoop, "_start", fake)
    with pytest.raises(SimulationDiverged, match=r"^draw 2 of 4: physics diverged"):
        evaluate(turtle, replace(SETTINGS, robust=Robust()))
