"""Random draws: values and frequencies."""

from collections import Counter

import numpy as np
import pytest

from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from schema.parts import Parameter
from schema.robot.ids import BirthId

N = 20_000


@pytest.fixture
def draws() -> BufferedRng:
    return BufferedRng(np.random.default_rng(5))


def test_numbers_are_those_of_the_stream() -> None:
    mine, theirs = BufferedRng(np.random.default_rng(3)), np.random.default_rng(3)
    assert [mine.number() for _ in range(1000)] == theirs.random(1000).tolist()


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1, 2**32, 2**40 + 5, 2**64 - 1])
@pytest.mark.parametrize(
    "key", [(0, 0, 0, 0, 2), (3, 1, 41, 5, 20), (*[2**32 - 1] * 4, 2)]
)
def test_a_stream_is_that_of_numpys_seed_and_key(
    seed: int, key: tuple[int, ...]
) -> None:
    run, island, number, attempt, purpose = key
    birth = BirthId(island, number)
    mine = stream(seed, run, birth, attempt, Purpose(purpose))
    words = np.random.SeedSequence(seed, spawn_key=key)
    assert mine.random(9).tolist() == np.random.default_rng(words).random(9).tolist()


def test_samples_are_without_replacement_and_uniform_in_each_place(
    draws: BufferedRng,
) -> None:
    first, last = Counter[int](), Counter[int]()
    for _ in range(N):
        sample = draws.sample(range(6), 4)
        assert len(set(sample)) == 4
        first[sample[0]] += 1
        last[sample[3]] += 1
    for found in (first, last):
        assert all(abs(n - N / 6) < 5 * (N * 5 / 36) ** 0.5 for n in found.values())


def test_nearby_values_move_by_a_share_and_stay_in_range(draws: BufferedRng) -> None:
    moving = Parameter("p", -1.0, 1.0, 0.0)
    fixed = Parameter("c", 0.0, 1.0, 0.5, is_mutable=False)
    moved = [draws.nearby((moving, fixed), (0.9, 0.3), 0.1) for _ in range(N)]
    assert {colour for _, colour in moved} == {0.3}
    values = [value for value, _ in moved]
    # 0.9 of 0.9, and a tenth of U(-1, 1).
    assert 0.71 <= min(values) < 0.7102
    assert 0.9098 < max(values) <= 0.91
    assert np.mean(values) == pytest.approx(0.81, abs=5 * 0.2 / 12**0.5 / N**0.5)
    edge = 0.1 + 0.2
    narrow = Parameter("n", edge, edge, edge)
    assert all(draws.nearby((narrow,), (edge,), 0.05) == (edge,) for _ in range(100))
    assert draws.nearby((moving,), (0.25,), 0.0) == (0.25,)


def test_normal_numbers_have_their_mean_and_deviation(draws: BufferedRng) -> None:
    found = [draws.normal(12.0, 5.0) for _ in range(N)]
    assert np.mean(found) == pytest.approx(12.0, abs=5 * 5 / N**0.5)
    assert np.std(found) == pytest.approx(5.0, rel=0.03)
    assert draws.normal(7.0, 0.0) == 7.0


@pytest.mark.parametrize("worst", [0.0, 1.0 - 2.0**-53])
def test_normal_numbers_are_finite_at_both_ends(
    draws: BufferedRng, worst: float
) -> None:
    draws.number = iter([worst]).__next__
    assert abs(draws.normal(0.0, 1.0)) < 10.0


@pytest.mark.parametrize("expected", [0.0, 0.25, 0.5, 1.0, 2.75])
def test_rounding_keeps_the_mean(draws: BufferedRng, expected: float) -> None:
    found = [draws.rounded(expected) for _ in range(N)]
    assert all(abs(n - expected) < 1.0 for n in found)
    assert np.mean(found) == pytest.approx(expected, abs=5 * 0.5 / N**0.5)
