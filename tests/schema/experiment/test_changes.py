"""Changing settings: values over births and time, and mistakes in ``[[changes]]``."""

from typing import Any

import pytest

from schema.experiment.changes import (
    CHANGEABLE,
    SettingChange,
    change_points,
    settings_at,
    value_at,
)
from schema.experiment.document import island_experiment
from schema.experiment.settings import evaluation_settings, evaluation_settings_of
from tests.documents import check_refused, parse

FRICTION = "simulation.friction"
PUSH = "environment.push_impulse"


def change(**keys: Any) -> SettingChange:  # noqa: ANN401 - any of its keys
    known = {"setting": FRICTION, "at": (0.0, 10.0, 30.0), "values": (1.0, 0.5, 0.9)}
    return SettingChange(**(known | keys))


STEPS, RAMPS = change(), change(between="linear")
CYCLE = change(period=40.0)
WAVE = change(between="linear", period=40.0)
PLACES = change(
    between="linear", at=(0.0, 4.0), values=((0.0, 0.0, 1.0), (4.0, 0.0, 3.0))
)


@pytest.mark.parametrize(
    ("table", "point", "value"),
    [
        (STEPS, 0, 1.0), (STEPS, 9.9, 1.0), (STEPS, 10, 0.5), (STEPS, 30, 0.9),
        (STEPS, 1e6, 0.9),
        (CYCLE, 39.9, 0.9), (CYCLE, 40, 1.0), (CYCLE, 50, 0.5), (CYCLE, 4030, 0.9),
        # 1.0 to 0.5 over 10, then up to 0.9 over 20.
        (RAMPS, 0, 1.0), (RAMPS, 5, 0.75), (RAMPS, 5.9, 0.75), (RAMPS, 10, 0.5),
        (RAMPS, 20, 0.7), (RAMPS, 30, 0.9), (RAMPS, 77, 0.9),
        # From 0.9 back to 1.0 over the last 10.
        (WAVE, 35, 0.95), (WAVE, 40, 1.0), (WAVE, 45, 0.75),
        (PLACES, 1, (1.0, 0.0, 1.5)), (PLACES, 4, (4.0, 0.0, 3.0)),
    ],
)  # fmt: skip
def test_values_of_steps_ramps_and_cycles(
    table: SettingChange, point: float, value: object
) -> None:
    assert value_at(table, point) == pytest.approx(value)


def test_points_repeat_with_the_period() -> None:
    assert list(change_points(STEPS, 50)) == [10, 30]
    assert list(change_points(CYCLE, 100)) == [10, 30, 40, 50, 70, 80, 90]


CHANGING = """
simulation.friction = 0.9
environment.light = [1, 0, 0.3]
fitness = {function = "target", parameters = {reach_m = 0.1}}
[[changes]]
setting = "simulation.friction"
at = [0, 100]
values = [0.8, 0.3]
[[changes]]
setting = "fitness.parameters.targets"
at = [0, 200]
values = [[[1, 0]], [[0, 1], [0, 2]]]
[[islands]]
[[islands]]
changes = [{setting = "environment.light", at = [0], values = [[0, 2, 0.3]]}]
"""


def test_settings_have_the_values_of_a_point_and_nothing_else_changes() -> None:
    here, there = (island_experiment(parse(CHANGING), number) for number in (0, 1))
    early, late = (settings_at(here, point) for point in (99, 200))
    assert (early.simulation.friction, late.simulation.friction) == (0.8, 0.3)
    assert early.fitness.parameters == {"reach_m": 0.1, "targets": ((1.0, 0.0),)}
    assert late.fitness.parameters["targets"] == ((0.0, 1.0), (0.0, 2.0))
    assert early.changes == () != here.changes
    assert early.environment == here.environment
    assert settings_at(here, 0) is settings_at(here, 50)
    assert evaluation_settings_of(there, 7).light == (0.0, 2.0, 0.3)
    assert evaluation_settings_of(there).simulation.friction == 0.9
    assert b'"values":[0.8,0.3]' in evaluation_settings(here)


def test_slope_direction_turns_gravity_and_0_is_uphill_along_x() -> None:
    slope = "environment = {slope_deg = 30.0, slope_direction_deg = %s}"
    east, north = (parse(slope % angle).environment for angle in ("0.0", "90.0"))
    assert east.down == pytest.approx((-0.5, 0.0, -(0.75**0.5)))
    assert north.down == pytest.approx((0.0, -0.5, -(0.75**0.5)), abs=1e-12)
    assert str(east.down[1]) == "0.0"


def table(
    setting: str = FRICTION, at: str = "[0, 9]", values: str = "[1, 2]", rest: str = ""
) -> str:
    return f"[[changes]]\nsetting = '{setting}'\nat = {at}\nvalues = {values}\n{rest}"


LIGHT = "environment.light"
MISTAKES = [
    (
        table("simulation.fricton"),
        r"changes\[0\].setting: must be one of .* mean 'simulation.friction'",
    ),
    (table(PUSH), rf"setting: must be .*, got '{PUSH}'"),
    (table() + table(), r"changes\[1\].setting: two changes are of 'simulation.fri"),
    (table(at="[5, 9]"), r"changes\[0\].at: must begin with 0, got 5"),
    (table(at="[0, 0]"), "at: must be ascending, got 0 after 0"),
    (table(at="[0, -1]"), r"changes\[0\].at\[1\]: must be a number >= 0.0, got -1"),
    (table(at="[]"), r"changes\[0\].at: "),
    (table(values="[1]"), r"changes\[0\].values: must be 2, one for each of at, got 1"),
    (table(values="[1, -2]"), r"values\[1\]: friction: must be .* >= 0.0, got -2.0"),
    (table(values="[1, nan]"), r"values\[1\]: must be finite, got nan"),
    (table(values="[1, 'a']"), r"changes\[0\].values\[1\]: "),
    (table("environment.slope_deg", values="[0, 45]"), r"slope_deg: must be .* < 45"),
    (table(rest="period = 9"), "period: must be > 9, the last of at, got 9"),
    (table(rest="between = 'lin'"), "between: .* 'hold', 'linear', got 'lin'"),
    (table(LIGHT, "[0]", "[[1, 1, 1]]"), r"setting: needs environment.light = \["),
    (
        "arena.light = [1, 1, 1]\n" + table(LIGHT, "[0]", "[[1, 1, 1]]"),
        "setting: needs environment.light in place of arena.light",
    ),
    (
        f"{LIGHT} = [1, 1, 1]\n" + table(LIGHT, "[0]", "[[1, 1]]"),
        r"values\[0\]: light: .* length 3, got",
    ),
    ("[[islands]]\nchanges = [{setting = 'x', at = [0], values = [1]}]", r"islands\[0"),
]


@pytest.mark.parametrize(("text", "message"), MISTAKES, ids=str)
def test_wrong_changes_are_refused(text: str, message: str) -> None:
    check_refused(text, message)


def test_all_numbers_that_may_change_do() -> None:
    numbers = [name for name in CHANGEABLE if name != LIGHT]
    found = parse("".join(table(name, values="[0.5, 0.25]") for name in numbers))
    assert settings_at(found, 9).simulation.torque_factor == 0.25
