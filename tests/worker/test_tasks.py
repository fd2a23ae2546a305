"""Fitness functions of the tasks, by hand-worked cases."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.document import Fitness
from schema.experiment.file import read_experiment, shipped_experiments
from schema.experiment.settings import FITNESS, fitness_argument, fitness_function
from schema.robot.trace import Floats, Trace
from worker.fitness import thesis
from worker.kinds import check_fitness
from worker.tasks import (
    Balance,
    Directed,
    Light,
    Targets,
    Turning,
    balance,
    directed_locomotion,
    light,
    target,
    turning,
)

Place = tuple[float, float]


def along(*places: Sequence[float], interval_s: float = 1.0) -> Trace:
    """Return a trace of x, y or x, y, z."""
    rows = [(*place, 0.0)[:3] for place in places]
    return Trace(interval_s, np.array(rows, dtype=float))


def about(axis: str, angles: Sequence[float] | Floats) -> Rotation:
    """Return rotations about one axis [rad]."""
    return Rotation.from_euler(axis, np.asarray(angles)[:, None])


def attitudes(turns: Rotation) -> Floats:
    """Return quaternions w, x, y, z of rotations."""
    found: Floats = turns.as_quat(scalar_first=True)
    return found


# --- directed locomotion ------------------------------------------------------------


def test_directed_locomotion_is_speed_along_the_heading_less_drift() -> None:
    """3 m ahead, at most 0.5 m aside, in 10 s."""
    trace = along((1, 1), (2, 1.5), (4, 1.25), interval_s=5.0)
    assert directed_locomotion(trace, Directed()) == pytest.approx((3 - 0.5) / 10)
    double = Directed(drift_weight=2.0)
    assert directed_locomotion(trace, double) == pytest.approx((3 - 1) / 10)
    free = Directed(drift_weight=0.0)
    assert directed_locomotion(trace, free) == pytest.approx(0.3)
    back = Directed(heading_deg=180.0)
    assert directed_locomotion(trace, back) == pytest.approx((-3 - 0.5) / 10)
    # To the left: 0.25 m ahead, 3 m aside.
    left = Directed(heading_deg=90.0)
    assert directed_locomotion(trace, left) == pytest.approx((0.25 - 3) / 10)


def test_directed_locomotion_above_the_limit_is_zero() -> None:
    trace = along((0, 0), (2, 0), interval_s=1.9)
    assert directed_locomotion(trace, Directed()) == 0.0
    fast = Directed(limit=2.0)
    assert directed_locomotion(trace, fast) == pytest.approx(2 / 1.9)


# --- targets ------------------------------------------------------------------------


def test_target_counts_how_much_nearer_the_core_comes() -> None:
    trace = along((0, 0), (0.5, 0.0), (0.7, 0.4), interval_s=2.0)
    # From 1 m to 0.5 m in 4 s.
    assert target(trace, Targets()) == pytest.approx(0.5 / 4)
    away = along((0, 0), (-1, 0), interval_s=4.0)
    assert target(away, Targets()) == pytest.approx(-1 / 4)


def test_a_reached_target_counts_whole_and_by_its_time() -> None:
    """Reached after 2 s; what comes after does not count."""
    trace = along((0, 0), (0.5, 0), (0.95, 0), (-3, 0))
    assert target(trace, Targets()) == pytest.approx(1 / 2)
    assert target(trace, Targets(reach_m=0.04)) == pytest.approx(-3 / 3)


def test_targets_are_visited_in_their_order() -> None:
    """1 m to the first; the second is 1 m from the first, and 0.4 m of it are left."""
    both = Targets(targets=((1.0, 0.0), (1.0, 1.0)))
    trace = along((0, 0), (1, 0.05), (1, 0.6), interval_s=2.0)
    assert target(trace, both) == pytest.approx((1 + 0.6) / 4)
    # The second is passed on the way to the first, which does not count.
    other = along((0, 0), (1, 1), (0.5, 0.0), interval_s=2.0)
    assert target(other, both) == pytest.approx(0.5 / 4)
    done = along((0, 0), (1, 0), (1, 1), (5, 5), interval_s=2.0)
    assert target(done, both) == pytest.approx(2 / 4)


def test_a_robot_that_starts_at_its_targets_has_no_fitness() -> None:
    assert target(along((1, 0), (1, 0)), Targets()) == 0.0
    assert target(along((0, 0), (1, 0), interval_s=0.5), Targets()) == 0.0  # 2 m/s


# --- light --------------------------------------------------------------------------


def lit(*places: Sequence[float], at: tuple[float, float, float] | None) -> Trace:
    return Trace(1.0, along(*places).core_position, {"light": at})


def test_light_is_the_mean_brightness() -> None:
    """Distances 2, 1 and 0 m: brightness 1/4, 1 and 1."""
    trace = lit((0, 0), (1, 0), (2, 0), at=(2.0, 0.0, 0.0))
    assert light(trace, Light()) == pytest.approx((0.25 + 1 + 1) / 3)
    half = Light(full_within_m=0.5)
    assert light(trace, half) == pytest.approx((1 / 16 + 1 / 4 + 1) / 3)
    # 3 m, 4 m and 0 m give a distance of 5 m.
    high = lit((0, 0, 0), (0, 0, 0), at=(3.0, 0.0, 4.0))
    assert light(high, Light()) == pytest.approx(1 / 25)


def test_light_needs_a_light() -> None:
    with pytest.raises(ExperimentError, match=r"set environment\.light"):
        light(lit((0, 0), (1, 0), at=None), Light())


# --- turning ------------------------------------------------------------------------


def turned(turns: Rotation, places: Sequence[Place] | None = None) -> Trace:
    """Return a trace with attitudes, 1 s apart, at the origin if not given."""
    count = len(turns)
    rows = np.zeros((count, 3))
    if places is not None:
        rows[:, :2] = places
    return Trace(1.0, rows, {"core_attitude": attitudes(turns)})


LEFT = about("z", np.arange(9.0))
"""1 rad per second to the left, beyond a full turn."""


@pytest.mark.parametrize("tilt", [0.0, 0.5, math.pi])
def test_turning_counts_full_turns_about_the_vertical(tilt: float) -> None:
    trace = turned(LEFT * Rotation.from_euler("x", tilt))
    assert turning(trace, Turning()) == pytest.approx(1.0)
    assert turning(trace, Turning(direction="left")) == pytest.approx(1.0)
    assert turning(trace, Turning(direction="right")) == pytest.approx(-1.0)


def test_turning_does_not_depend_on_the_sign_of_quaternions() -> None:
    trace = turned(LEFT)
    trace.core_attitude[3] *= -1.0
    assert turning(trace, Turning()) == pytest.approx(1.0)


def test_rolling_over_is_not_turning() -> None:
    for axis in "xy":
        rolled = turned(about(axis, np.arange(9.0)))
        assert turning(rolled, Turning()) == pytest.approx(0.0, abs=1e-12)
    back = turned(about("z", [0, 1, 2, 1, 0, -1, 0, 0, 0]))
    assert turning(back, Turning()) == pytest.approx(0.0, abs=1e-12)


def test_turning_in_place_is_penalised_for_leaving_it() -> None:
    """0.5 m away at most in 8 s, at 5 rad/m."""
    places = [(0.0, 0.0)] * 4 + [(0.3, 0.4)] + [(0.1, 0.0)] * 4
    trace = turned(LEFT, places)
    assert turning(trace, Turning()) == pytest.approx(1.0 - 5 * 0.5 / 8)
    assert turning(trace, Turning(wander_weight=0.0)) == pytest.approx(1.0)


def test_turning_above_the_limit_is_zero() -> None:
    assert turning(turned(LEFT), Turning(limit=0.99)) == 0.0
    assert turning(turned(LEFT), Turning(limit=1.01)) == pytest.approx(1.0)


# --- balance ------------------------------------------------------------------------


def standing(tilts_deg: Sequence[float], places: Sequence[Sequence[float]]) -> Trace:
    tilts = about("y", np.radians(tilts_deg))
    channels = {"core_attitude": attitudes(tilts)}
    return Trace(1.0, np.array(places, dtype=float), channels)


def test_balance_is_the_mean_height_while_upright_less_drift() -> None:
    """Heights 0.1, 0.2, 0.3 and 0.4 m; the last is tilted too much; 0.5 m away."""
    places = [(1, 1, 0.1), (1, 1, 0.2), (1.3, 1.4, 0.3), (1, 1, 0.4)]
    trace = standing([0, -29, 29, 31], places)
    assert balance(trace, Balance(drift_weight=0.0)) == pytest.approx(0.6 / 4)
    assert balance(trace, Balance()) == pytest.approx(0.6 / 4 - 0.05 * 0.5)
    steady = Balance(tilt_deg=20.0, drift_weight=0.0)
    assert balance(trace, steady) == pytest.approx(0.1 / 4)
    upside_down = standing([180] * 4, places)
    assert balance(upside_down, Balance(drift_weight=0.0)) == 0.0


def test_balance_does_not_depend_on_the_heading() -> None:
    turns = about("z", [0.2, 1.6, 3.4, 5.2])
    trace = Trace(1.0, np.full((4, 3), 0.2), {"core_attitude": attitudes(turns)})
    assert balance(trace, Balance()) == pytest.approx(0.2)


def test_balance_above_the_limit_is_zero() -> None:
    high = standing([0, 0], [(0, 0, 3), (0, 0, 3)])
    assert balance(high, Balance()) == 0.0
    assert balance(high, Balance(limit=3.5)) == pytest.approx(3.0)


# --- in experiments -----------------------------------------------------------------


@pytest.mark.parametrize("name", shipped_experiments())
def test_functions_of_shipped_experiments_accept_their_parameters(name: str) -> None:
    fitness = read_experiment(name).fitness
    argument = fitness_argument(fitness_function(fitness), fitness)
    for key, value in fitness.parameters.items():
        read = msgspec.json.encode(getattr(argument, key))
        assert msgspec.json.decode(read) == value


def test_each_short_name_is_a_function_with_parameters_of_its_own() -> None:
    assert FITNESS["locomotion"] == "worker.fitness:thesis"
    assert fitness_function(Fitness(function="locomotion")) is thesis
    found = {
        type(fitness_argument(fitness_function(each), each))
        for each in (Fitness(function=name) for name in FITNESS)
    }
    assert found == {Fitness, Directed, Targets, Light, Turning, Balance}


def test_wrong_names_and_parameters_are_refused_in_one_line() -> None:
    with pytest.raises(UnknownPlugin) as raised:
        fitness_function(Fitness(function="turnign"))
    assert str(raised.value) == (
        "fitness.function: must be one of locomotion, directed-locomotion, target, "
        "light, turning, balance or 'module:attribute', got 'turnign'; "
        "did you mean 'turning'?"
    )
    for table, error in (
        ({"directoin": "left"}, "no such key; did you mean 'direction'?"),
        ({"direction": "up"}, "fitness.parameters.direction: must be one of 'either'"),
        ({"wander_weight": -1.0}, "fitness.parameters.wander_weight: must be a number"),
    ):
        fitness = Fitness(function="turning", parameters=table)
        with pytest.raises(ExperimentError) as refused:
            fitness_argument(fitness_function(fitness), fitness)
        assert error in str(refused.value)


@pytest.mark.parametrize("name", FITNESS)
def test_each_function_keeps_the_contract_of_fitness_functions(name: str) -> None:
    fitness = Fitness(function=name)
    check_fitness(fitness)
