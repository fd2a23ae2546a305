"""Tests of what pictures of arenas with own rules add."""

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from analysis.render.overlay import Overlay
from schema.robot.ids import BirthId
from schema.wire.updates import ArenaSample

A, B, C = (BirthId(0, number) for number in range(3))
POSES = {A: np.array([0.0, 0.0, 0.05, 1.0]), B: np.array([0.3, 0.4, 0.05, 1.0])}
SAMPLE = ArenaSample(
    0,
    10.0,
    "energy",
    ((A, 0.0), (B, 8.0), (C, 4.0)),
    1.0,
    ((A, B, False), (A, C, False)),
    ((1.0, -1.0, 0.5, 20.0), (0.0, 2.0, 0.25, 5.0)),
)


def lightness(colour: tuple[int, ...]) -> float:
    """Return the lightness L* of a colour of sRGB. Source: CIE 1976; IEC 61966-2-1."""
    c = np.array(colour) / 255
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ (0.2126, 0.7152, 0.0722))
    return 116.0 * float(np.cbrt(luminance)) - 16.0


def test_lightness_of_robots_and_patches_is_even_over_what_they_hold() -> None:
    robots = [BirthId(0, number) for number in range(9)]
    stores = tuple((birth, 3.0 * birth.number) for birth in robots)
    patches = tuple((0.0, 0.0, 1.0, 3.0 * number) for number in range(9))
    overlay = Overlay([replace(SAMPLE, stores=stores, pairs=(), patches=patches)])
    assert overlay.advance(10.0)
    assert overlay.text == "energy: blue 0, yellow 24"
    steps = np.diff([lightness(overlay.colours[birth]) for birth in robots])
    assert steps.min() > 0.5 * steps.mean() > 0
    rods = overlay.rods(10.0, {})
    darker = np.diff([lightness(rod[4]) for rod in rods])
    assert darker.max() < 0.5 * darker.mean() < 0


def test_colours_last_until_the_next_sample_and_keep_their_scale() -> None:
    later = replace(SAMPLE, sim_time_s=15.0, stores=((A, 8.0), (B, 2.0)))
    overlay = Overlay([SAMPLE, later])
    assert not overlay.advance(9.9)
    assert (overlay.colours, overlay.text) == ({}, "")
    assert overlay.advance(10.0)
    first = dict(overlay.colours)
    assert not overlay.advance(14.9)
    assert overlay.advance(15.0)
    assert overlay.colours[A] == first[B]
    assert overlay.colours[B] not in first.values()
    assert overlay.colours[C] == first[C]


@pytest.mark.parametrize(
    ("time_s", "poses", "lines"),
    [(10.0, POSES, 1), (10.99, POSES, 1), (11.0, POSES, 0), (10.0, {A: POSES[A]}, 0)],
)
def test_robots_that_met_are_joined_until_the_next_decision(
    time_s: float, poses: dict[BirthId, np.ndarray], lines: int
) -> None:
    overlay = Overlay([SAMPLE])
    assert overlay.most_rods == 4
    overlay.advance(time_s)
    assert len(overlay.rods(time_s, poses)) == 2 + lines


@pytest.mark.parametrize(("end", "length_m"), [((0.3, 0.4, 0.05), 0.5),
                                               ((0.0, -0.2, 0.2), 0.25),
                                               ((0.0, 0.0, 0.05), 0.0)])  # fmt: skip
def test_a_line_ends_above_its_robots(
    end: tuple[float, float, float], length_m: float
) -> None:
    overlay = Overlay([replace(SAMPLE, pairs=((A, B, True),), patches=())])
    overlay.advance(10.0)
    ((centre, half_m, turn, _, _),) = overlay.rods(10.0, {**POSES, B: np.array(end)})
    along = np.empty(3)
    mujoco.mju_rotVecQuat(along, np.array([0.0, 0.0, half_m]), turn)
    assert 2 * half_m == pytest.approx(length_m, abs=1e-6)
    up = (centre + along - end, centre - along - POSES[A][:3])
    assert up[0] == pytest.approx(up[1], abs=1e-6)
    assert up[0] == pytest.approx([0.0, 0.0, up[0][2]], abs=1e-6)
    assert up[0][2] > 0


def test_lines_of_parents_are_thicker_and_of_another_colour() -> None:
    overlay = Overlay([replace(SAMPLE, pairs=((A, B, False), (A, B, True)))])
    overlay.advance(10.0)
    met, mated = overlay.rods(10.0, POSES)[2:]
    assert mated[3] > 2 * met[3]
    assert mated[4] != met[4]
