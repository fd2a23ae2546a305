"""Places of births, and sizes of populations in any world."""

import random
from math import atan2, dist, hypot

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.arena.arena import Arena
from coordinator.arena.living import draw_place
from coordinator.evolution.random_streams import BufferedRng
from coordinator.islands.events import Record, Started
from schema.experiment.document import ArenaSection
from schema.robot.ids import BirthId
from tests.coordinator.arena_world import DT, ArenaRun, World, experiment
from tests.coordinator.breeding import reject_some


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


fixed = settings(max_examples=12, derandomize=True, database=None, deadline=None)


@given(
    luck=st.integers(0, 2**32),
    limit=st.integers(15, 30),
    floor=st.integers(5, 15),
    share=st.floats(0.0, 1.5),
)
@fixed
def test_floor_and_limit_hold_in_every_world(
    luck: int, limit: int, floor: int, share: float
) -> None:
    def fit(birth: BirthId, step: int) -> float:
        return random.Random(f"{luck} {birth} {step}").random()  # noqa: S311

    def diverges(birth: BirthId, step: int) -> bool:
        return random.Random(f"{birth} {step} {luck}").random() < 0.002  # noqa: S311

    rules = {
        "population_limit": limit,
        "population_floor": floor,
        "survive_share_of_mean": share,
    }
    lived = ArenaRun(
        Arena(experiment(45, **rules), 3, 0), World(fit, diverges), reject_some
    )
    while not lived.commands or lived.waiting:
        before = lived.arena.step
        found = lived.turn() if lived.commands else lived.tell(Started())
        assert len(lived.arena.population) <= limit
        culled = [
            one
            for one in found
            if isinstance(one, Record)
            and one.table == "deaths"
            and one.row["reason"] in ("selection", "cull")
        ]
        if culled:
            assert lived.arena.step > before
            since = {
                one: lived.world.step - then for one, then in lived.world.born.items()
            }
            mature = [one for one, age in since.items() if age * DT >= 15.0]
            assert len(mature) - len(culled) >= floor
    assert lived.arena.births <= 45
