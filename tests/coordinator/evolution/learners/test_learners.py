"""Learners: against hand-made quadratics, and what they ask and are told."""

from collections.abc import Callable
from math import inf
from pathlib import Path

import numpy as np
import pytest
from cmaes import CMA

from coordinator.evolution.learners.learner import NewbornLearner, Points, check_learner
from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.learning import LEARNERS, Learning
from tests.docs.page_runner import blocks_of

Function = Callable[[tuple[float, ...]], float]


def sphere(point: tuple[float, ...]) -> float:
    """Return 0 at (0.7, 0.7, ...), less elsewhere."""
    return -float(sum((each - 0.7) ** 2 for each in point))


def ellipsoid(point: tuple[float, ...]) -> float:
    """Return the sphere with axes that differ by a factor of up to 100."""
    most = max(1, len(point) - 1)
    weights = [100.0 ** (at / most) for at in range(len(point))]
    return -float(np.dot(weights, (np.array(point) - 0.4) ** 2))


def search(
    learner: str, function: Function, start: tuple[float, ...], budget: int, seed: int
) -> float:
    """Return the best value of a search."""
    own = NewbornLearner(Learning(learner=learner), start)
    points: Points = (start,)
    values = [function(start)]
    while len(values) < budget:
        rng = np.random.default_rng([seed, len(values)])
        new = own.ask(rng, budget - len(values))
        batch = (*points, *new) if len(points) == 1 == len(values) else new
        values += map(function, new)
        own.tell((batch, tuple(values[-len(batch) :])))
    return max(values)


@pytest.mark.parametrize("function", [sphere, ellipsoid])
@pytest.mark.parametrize("learner", ["cma-es", "(1+1)-es"])
def test_learners_beat_random_search_on_quadratics(
    learner: str, function: Function
) -> None:
    """In five dimensions, after 200 trials: less than a third of what random leaves."""
    start = (0.1, 0.9, 0.2, 0.5, 0.3)
    for seed in range(5):
        own = search(learner, function, start, 200, seed)
        base = search("random", function, start, 200, seed)
        assert own > 0.3 * base


@pytest.mark.parametrize("learner", LEARNERS)
def test_built_in_learners_keep_their_contract(learner: str) -> None:
    check_learner(Learning(learner=learner))


def test_cma_es_is_that_of_the_library() -> None:
    """Compare with the library's own loop.

    The first generation includes the start point.
    """
    start = (0.2, 0.8, 0.5)
    own = NewbornLearner(Learning(sigma=0.1), start)
    library = CMA(np.array(start), 0.1, bounds=np.array([[0.0, 1.0]] * 3))
    size = library.population_size
    assert size == 4 + int(3 * np.log(3))
    for number, count in enumerate((size - 1, size, size)):
        points = own.ask(np.random.default_rng(number), 100)
        library.reseed_rng(int(np.random.default_rng(number).integers(2**32)))
        wanted = [library.ask() for _ in range(count)]
        assert points == tuple(tuple(each.tolist()) for each in wanted)
        told = points if number else (start, *points)
        own.tell((told, tuple(map(sphere, told))))
        library.tell([(np.array(each), -sphere(each)) for each in told])


def test_a_generation_may_be_cut_by_the_budget() -> None:
    own = NewbornLearner(Learning(), (0.5,) * 8)
    assert len(own.ask(np.random.default_rng(1), 3)) == 3
    assert len(own.ask(np.random.default_rng(1), 100)) == 9


def test_a_population_may_be_given() -> None:
    own = NewbornLearner(Learning(parameters={"population": 6}), (0.5,) * 8)
    assert len(own.ask(np.random.default_rng(1), 100)) == 5


def test_one_plus_one_by_hand() -> None:
    """Steps are 1.5 times as wide after success, and 1.5^-1/4 after failure."""
    own = NewbornLearner(Learning(learner="(1+1)-es", sigma=0.01), (0.5, 0.5))

    def step(origin: tuple[float, ...]) -> float:
        (point,) = own.ask(np.random.default_rng(3), 10)
        one = np.random.default_rng(3).standard_normal(2)
        return float(((np.array(point) - origin) / one).mean())

    assert step((0.5, 0.5)) == pytest.approx(0.01)
    own.tell((((0.5, 0.5), (0.6, 0.6)), (1.0, 2.0)))
    assert step((0.6, 0.6)) == pytest.approx(0.015)
    own.tell((((0.7, 0.7),), (1.5,)))
    assert step((0.6, 0.6)) == pytest.approx(0.015 * 1.5**-0.25)
    own.tell((((0.1, 0.1),), (-inf,)))
    assert step((0.6, 0.6)) == pytest.approx(0.015 * 1.5**-0.5)


def test_the_learner_of_the_page_keeps_its_contract(
    own_module: Callable[[str], str],
) -> None:
    page = Path(__file__).parents[4] / "docs" / "learning.md"
    (text,) = blocks_of(page, "python")
    own = f"{own_module(text)}:Halves"
    check_learner(Learning(learner=own, parameters={"points": 3}))


OWN = """
import numpy as np
from msgspec import Struct

class Grid:
    class Parameters(Struct):
        step: float = 0.5

    def __init__(self, start, sigma, parameters):
        self.start, self.step, self.asked = start, parameters.step, 0

    def ask(self, rng, most):
        return {answer}

    def counted(self):
        self.asked += 1
        return [self.start / self.asked]

    def tell(self, points, fitness):
        pass
"""


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ("[self.start * self.step]", ""),
        ("[self.start + 1.0]", r"ask: must return numbers from 0 to 1, got 1.25"),
        ("self.start", r"1 to 23 points of 1 numbers, got shape \(1,\)"),
        ("np.zeros((99, len(self.start)))", r"1 to 23 points .* shape \(99, 1\)"),
        ("'abc'", "1 to 23 points"),
        ("1 / 0", r"\w+.py:5: raised ZeroDivisionError: division by zero \(\w"),
        ("[rng.random(len(self.start))]", ""),
        ("[np.random.random(len(self.start))]", "must want the same when it was"),
        ("self.counted()", "must want the same when it was"),
    ],
)  # fmt: skip
def test_own_learners_are_checked(
    own_module: Callable[[str], str], answer: str, message: str
) -> None:
    name = own_module(OWN.format(answer=answer))
    rules = Learning(learner=f"{name}:Grid", parameters={"step": 0.25})
    if not message:
        check_learner(rules)
        return
    with pytest.raises(ExperimentError, match=message):
        check_learner(rules)


def test_unknown_learners_and_parameters_are_refused() -> None:
    with pytest.raises(UnknownPlugin, match="did you mean 'random'"):
        NewbornLearner(Learning(learner="rendom"), (0.5,))
    with pytest.raises(ExperimentError, match=r"learning.parameters.size: no such key"):
        NewbornLearner(Learning(parameters={"size": 3}), (0.5,))
    with pytest.raises(ExperimentError, match="allowed: none"):
        NewbornLearner(Learning(learner="random", parameters={"a": 1}), (0.5,))
