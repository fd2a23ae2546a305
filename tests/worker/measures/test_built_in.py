"""Values of the built-in measures, worked out by hand."""

from typing import Any

import numpy as np
import pytest

from schema.experiment.document import Measures
from schema.robot.robot import Part, Robot
from schema.robot.trace import Trace
from worker.measures.functions import BUILT_IN, measures_of


def value(name: str, trace: Trace) -> float:
    (found,) = measures_of(Measures(names=(name,)))
    return found.value(trace)


def trace(*points: tuple[float, float, float], **channels: Any) -> Trace:  # noqa: ANN401
    """Return a trace through some points, a second apart."""
    return Trace(1.0, np.array(points, dtype=float), channels)


def standing(count: int, **channels: Any) -> Trace:  # noqa: ANN401
    return trace(*[(0.0, 0.0, 0.1)] * count, **channels)


def about_z(*degrees: float) -> np.ndarray[Any, Any]:
    half = np.radians(degrees) / 2
    zero = np.zeros(len(degrees))
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1)


def test_velocities_of_legs_of_3_and_4_metres() -> None:
    found = trace((0, 0, 0), (3, 0, 0), (3, 4, 0))
    assert value("path_velocity", found) == 3.5
    assert value("straight_velocity", found) == 2.5


def test_turning_adds_turns_to_both_sides() -> None:
    """30 degrees left and 60 right in 2 s."""
    found = standing(3, core_attitude=about_z(0, 30, -30))
    assert value("turning", found) == pytest.approx(np.radians(45))


def test_turning_takes_the_shorter_way_across_180_degrees() -> None:
    found = standing(2, core_attitude=about_z(170, -170))
    assert value("turning", found) == pytest.approx(np.radians(20))


def test_turning_ignores_roll() -> None:
    roll = np.array([(1.0, 0, 0, 0), (np.sqrt(0.5), np.sqrt(0.5), 0, 0)])
    assert value("turning", standing(2, core_attitude=roll)) == pytest.approx(0.0)


def test_energy_is_that_at_the_end() -> None:
    assert value("energy", standing(3, energy=np.array([0.0, 1.5, 2.5]))) == 2.5


def test_cost_of_transport_of_2_kg_over_5_metres() -> None:
    """98.1 J for 2 kg over 5 m: 98.1 / (2 * 9.81 * 5) = 1."""
    found = trace(
        (0, 0, 0.2), (3, 4, 0.1), energy=np.array([0, 98.1]), mass=2.0, gravity=9.81
    )
    assert value("cost_of_transport", found) == pytest.approx(1.0)


def test_cost_of_transport_of_a_still_robot_is_that_of_a_millimetre() -> None:
    found = standing(2, energy=np.array([0, 9.81]), mass=1.0, gravity=9.81)
    assert value("cost_of_transport", found) == pytest.approx(1000.0)


def test_height_is_the_mean() -> None:
    assert value("height", trace((0, 0, 0.1), (1, 0, 0.3), (1, 5, 0.2))) == (
        pytest.approx(0.2)
    )


def part(kind: str) -> Part:
    return Part(kind, 0, 0, 0, 0, (), 0)


@pytest.mark.parametrize(
    ("kinds", "places", "share"),
    [
        ("C", [(0, 0, 0)], 1.0),
        # Both arms have a mirror image in the plane of x and z.
        ("CBB", [(0, 0, 0), (0, 0.1, 0), (0, -0.1, 0)], 1.0),
        # Of an arm along x and one along y, one is on its plane in either case.
        ("CBB", [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], 2 / 3),
        # Opposite parts of different kinds; both planes leave the core and nothing
        # else, or the whole line.
        ("CBH", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.1, 0)], 1 / 3),
        ("CBB", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.1, 0)], 1.0),
        # 2 cm from the mirrored place is too far, 5 mm is not.
        ("CBB", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.12, 0)], 1 / 3),
        ("CBB", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.105, 0)], 1.0),
    ],
)
def test_body_symmetry(
    kinds: str, places: list[tuple[float, float, float]], share: float
) -> None:
    robot = Robot(tuple(part(kind) for kind in kinds))
    found = standing(2, part_position=np.array(places), robot=robot)
    assert value("body_symmetry", found) == pytest.approx(share)


def test_joint_effort_is_the_mean_of_absolute_torques() -> None:
    torque = np.array([(1.0, -3.0), (0.0, 2.0)])
    assert value("joint_effort", standing(2, joint_torque=torque)) == 1.5
    assert value("joint_effort", standing(2, joint_torque=np.zeros((2, 0)))) == 0.0


def test_contact_share_counts_parts_and_samples() -> None:
    contact = np.array([(True, False, False, False), (True, True, False, False)])
    assert value("contact_share", standing(2, contact=contact)) == 0.375


def test_every_built_in_measure_names_its_unit() -> None:
    for name, function in BUILT_IN.items():
        text = function.__doc__ or ""
        assert "[" in text.splitlines()[0], name
