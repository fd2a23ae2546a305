"""Tests of the places of cameras, by hand."""

import numpy as np
import pytest

from analysis.render.framing import framed


def test_a_sphere_touches_the_narrowest_edge() -> None:
    """Seen along +x, at 45 degrees a sphere of radius 1 is sqrt(2) away."""
    centre = np.array([[3.0, 4.0, 5.0]])
    point, distance = framed(centre, np.ones(1), 0.0, 0.0, (1.0, 2.0, 3.0))
    assert point == pytest.approx([3, 4, 5])
    assert distance == pytest.approx(2**0.5)


def test_points_at_the_left_end_and_nearer_to_the_camera_are_seen() -> None:
    """Of points at y = -2 and 2, the camera is 2 / 0.5 from the nearer one.

    They are 1 before and behind the middle of the view along +x.
    """
    points = np.array([[9.0, -2.0, 0.0], [11.0, 2.0, 0.0]])
    point, distance = framed(points, np.zeros(2), 0.0, 0.0, (1.0, 1.0, 0.5))
    assert point == pytest.approx([10, 0, 0])
    assert distance == pytest.approx(1 + 2 / 0.5)
