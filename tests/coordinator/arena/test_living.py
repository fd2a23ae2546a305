"""Living robots of an arena: places of insertion."""

from math import atan2, dist, hypot

import numpy as np
import pytest

from coordinator.arena.living import draw_place
from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import ArenaSection


def draws(seed: int) -> BufferedRng:
    return BufferedRng(np.random.default_rng(seed))


def test_places_are_uniform_in_radius_and_angle() -> None:
    source = draws(1)
    places = [draw_place(source, (), ArenaSection()) for _ in range(4000)]
    radii = np.array([hypot(*place) for place in places])
    assert radii.max() <= 2.0
    assert radii.mean() == pytest.approx(1.0, abs=0.03)
    assert (radii < 0.5).mean() == pytest.approx(0.25, abs=0.02)
    angles = np.array([atan2(y, x) for x, y in places])
    assert angles.mean() == pytest.approx(0.0, abs=0.1)


def test_places_keep_their_distance_if_five_tries_allow_it() -> None:
    others = [(0.1 * number, 0.0) for number in range(-10, 11)]
    kept = 0
    for seed in range(200):
        place = draw_place(draws(seed), others, ArenaSection())
        kept += all(dist(place, other) >= 0.25 for other in others)
    assert kept >= 195


def test_the_last_try_is_taken_if_no_place_is_free() -> None:
    source, reference = draws(3), draws(3)
    everywhere = [(0.2 * x, 0.2 * y) for x in range(-10, 11) for y in range(-10, 11)]
    place = draw_place(source, everywhere, ArenaSection())
    tries = [draw_place(reference, (), ArenaSection()) for _ in range(5)]
    assert place == tries[-1]
    assert source.number() == reference.number()


def test_the_first_free_place_is_taken() -> None:
    source, reference = draws(4), draws(4)
    first, second = (draw_place(reference, (), ArenaSection()) for _ in range(2))
    assert draw_place(source, [first], ArenaSection()) == second
