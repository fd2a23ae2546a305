"""Who dies of an arena's mature, and where the born are put."""

from math import atan2, dist, hypot

import msgspec
import numpy as np
import pytest

from coordinator.arena.place import draw_place
from coordinator.evolution.culling import select_culled
from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.selection import Individual
from schema.experiment.document import Arena
from schema.robot.genome import Node
from schema.robot.ids import BirthId

CORE = Node("Core", -1, 0, ())


def mature(*fitness: float) -> list[Individual]:
    return [
        Individual(BirthId(0, number), CORE, each, 1, None)
        for number, each in enumerate(fitness)
    ]


def culled(fitness: list[float], **rules: float) -> tuple[str, list[int]]:
    arena = msgspec.structs.replace(Arena(), **rules)
    reason, found = select_culled(mature(*fitness), arena)
    return reason, [one.birth.number for one in found]


def test_exactly_the_share_of_the_mean_lives() -> None:
    # Mean 1.0, limit 0.5: one half is enough, a little less is not.
    fitness = [0.5, 0.499, 1.501, 1.5, *([1.0] * 8)]
    assert culled(fitness, survive_share_of_mean=0.5) == ("selection", [1])


def test_the_weakest_go_first_and_eight_stay() -> None:
    fitness = [0.03, 0.01, 0.02, *([1.0] * 7)]
    assert culled(fitness) == ("selection", [1, 2])


def test_of_equals_the_younger_goes() -> None:
    assert culled([0.0, 0.0, 0.0, *([1.0] * 7)]) == ("selection", [2, 1])


@pytest.mark.parametrize("count", [0, 1, 7, 8])
def test_up_to_the_floor_nobody_dies(count: int) -> None:
    assert culled([0.0, *([1.0] * 7)][:count])[1] == []


def test_a_full_arena_of_equals_loses_seven_tenths() -> None:
    assert culled([1.0] * 29) == ("selection", [])
    reason, found = culled([1.0] * 30)
    assert (reason, len(found)) == ("cull", 21)
    assert found == list(range(29, 8, -1))


def test_one_weak_robot_spares_a_full_arena() -> None:
    assert culled([0.1, *([1.0] * 29)]) == ("selection", [0])


def test_the_floor_holds_in_a_cull_too() -> None:
    assert len(culled([1.0] * 30, population_floor=12)[1]) == 18


def draws(seed: int) -> BufferedRng:
    return BufferedRng(np.random.default_rng(seed))


def test_places_are_uniform_in_radius_and_angle() -> None:
    source = draws(1)
    places = [draw_place(source, (), Arena()) for _ in range(4000)]
    radii = np.array([hypot(*place) for place in places])
    assert radii.max() <= 2.0
    assert radii.mean() == pytest.approx(1.0, abs=0.03)
    assert (radii < 0.5).mean() == pytest.approx(0.25, abs=0.02)
    angles = np.array([atan2(y, x) for x, y in places])
    assert angles.mean() == pytest.approx(0.0, abs=0.1)


def test_a_place_keeps_its_distance_if_five_tries_allow_it() -> None:
    others = [(0.1 * number, 0.0) for number in range(-10, 11)]
    kept = 0
    for seed in range(200):
        place = draw_place(draws(seed), others, Arena())
        kept += all(dist(place, other) >= 0.25 for other in others)
    assert kept >= 195


def test_the_last_of_five_tries_is_taken_where_none_is_free() -> None:
    source, reference = draws(3), draws(3)
    everywhere = [(0.2 * x, 0.2 * y) for x in range(-10, 11) for y in range(-10, 11)]
    place = draw_place(source, everywhere, Arena())
    tries = [draw_place(reference, (), Arena()) for _ in range(5)]
    assert place == tries[-1]
    assert source.number() == reference.number()


def test_the_first_free_place_is_taken() -> None:
    source, reference = draws(4), draws(4)
    first, second = (draw_place(reference, (), Arena()) for _ in range(2))
    assert draw_place(source, [first], Arena()) == second
