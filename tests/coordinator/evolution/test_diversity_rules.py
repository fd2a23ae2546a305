"""Rules that keep diversity: examples, and pyribs and pymoo as second opinions."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import numpy as np
import pytest

from coordinator.evolution.breeding import Individual
from coordinator.evolution.diversity.cells import Curiosity, MapElites
from coordinator.evolution.diversity.fronts import (
    AgeLayered,
    AgeLayers,
    crowding_distances,
    front_numbers,
)
from coordinator.evolution.diversity.novelty import (
    Competition,
    DominatedNovelty,
    Novelty,
    NoveltySearch,
)
from coordinator.evolution.diversity.ranking import RankSelection
from coordinator.evolution.members import Member, Relatives
from coordinator.evolution.rules import rule_of
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Measures, SelectionSection
from schema.experiment.grid import Grid, cell_of
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot

GRID = Grid(measures=("a", "b"), bounds=((0, 2), (0, 1)), bins=(4, 5))
EXPERIMENT = Experiment("test", measures=Measures(names=("a", "b")), grid=GRID)
RNG = np.random.default_rng(0)


def chain(genome: bytes) -> Robot:
    bricks = (Part("FixedBrick", at, 1, 0, 0, ()) for at in range(len(genome) - 1))
    return Robot((Part("Core", -1, -1, -1, 0, ()), *bricks))


def members(
    rows: Sequence[tuple[float, float, float]],
    first: int = 0,
    parents: Mapping[int, Sequence[int]] = {},
    genomes: Mapping[int, int] = {},
) -> list[Member]:
    """Return individuals of a fitness and two measures; nan is a failed one."""
    born = []
    for number, (fitness, *values) in enumerate(rows, start=first):
        made = Individual(
            BirthId(0, number),
            b"." * genomes.get(number, 1),
            fitness,
            rank=1,
            generation=0,
            has_failed=np.isnan(fitness),
            parents=tuple(BirthId(0, at) for at in parents.get(number, ())),
            measures=dict(zip(GRID.measures, values, strict=True)),
        )
        born.append(made)
    return Relatives(chain).members(born)


def test_novelty_is_the_mean_distance_to_the_nearest() -> None:
    rule = Novelty(NoveltySearch(nearest=2, every=2, capacity=2), EXPERIMENT)
    # As shares of the grid at 0, 0.5 and 1 along the first measure.
    population = members([(0, 0, 0), (0, 1, 0), (0, 2, 0)])
    assert rule.ranks(population) == [-0.75, -0.5, -0.75]
    rule.update(members([(0, 0, 0.1), (0, 2, 0.1), (0, 1, 0.2)], first=10))
    assert list(rule.archive([])) == ["0:10", "0:12"]
    assert rule.ranks(population)[0] == pytest.approx(-(0.1 + 0.5) / 2)
    rule.update(members([(0, 0, 0.3), (0, 0, 0.4)], first=13))
    assert list(rule.archive([])) == ["0:12", "0:14"]


def test_a_threshold_archives_the_novel_of_a_brood() -> None:
    rule = Novelty(NoveltySearch(nearest=1, threshold=0.3), EXPERIMENT)
    rule.update(members([(0, 0, 0), (0, 0.2, 0), (0, 2, 1)]))
    assert list(rule.archive([])) == ["0:2"]


def test_dominated_novelty_is_the_distance_to_the_nearest_fitter() -> None:
    rule = DominatedNovelty(Competition(nearest=1), EXPERIMENT)
    population = members([(3, 0, 0), (1, 2, 0), (2, 0, 0.25), (2, 1, 1), (3, 1, 1)])
    means = [-rank for rank in rule.ranks(population)]
    assert means == pytest.approx([inf, 1.0, 0.25, 0.0, inf])


def test_fronts_and_crowding_of_a_worked_example() -> None:
    values = np.array([[1, 5], [2, 3], [4, 1], [3, 4], [5, 5], [1, 5.0]])
    assert front_numbers(values).tolist() == [0, 0, 0, 1, 2, 0]
    front = np.array([[0, 4], [1, 2], [2, 1], [4, 0.0]])
    assert crowding_distances(front).tolist() == [inf, 0.5 + 0.75, 0.75 + 0.5, inf]


def test_map_elites_keeps_the_fittest_of_each_cell_and_enough_for_parents() -> None:
    elites = MapElites(None, EXPERIMENT)
    rule = RankSelection(elites, None)
    rows = [(1, 0.1, 0), (2, 0.2, 0), (2, 0.3, 0), (0.5, 2, 1), (9, 0.1, 0.5)]
    population = members([*rows, (np.nan, 0, 0)])
    assert sorted(rule.select(population, 2, RNG)) == [1, 3, 4]
    assert sorted(rule.select(population, 5, RNG)) == [0, 1, 2, 3, 4]
    assert [*elites.archive(population)] == ["0/0", "0/2", "3/4"]


def test_curiosity_rewards_parents_whose_children_enter() -> None:
    rule = Curiosity(None, EXPERIMENT)
    founders = members([(1, 0, 0), (1, 2, 0)])
    rule.update(founders)
    lines = {2: (0, 1), 3: (0,), 4: (1,)}
    rule.update(members([(2, 0, 0), (1, 0, 0), (0.5, 1, 1)], 2, lines))
    assert rule.ranks(founders) == [-(1 - 0.5), -(1 + 1)]


def test_a_body_is_as_old_as_its_structure() -> None:
    rule = AgeLayered(AgeLayers(layer=2), EXPERIMENT)
    bodies = {0: 3, 1: 3, 2: 3, 3: 5}
    population = members([(4, 0, 0), (3, 0, 0)], genomes=bodies)
    rule.update(population)
    brood = members([(2, 0, 0), (1, 0, 0)], 2, {2: (0, 1), 3: (0, 1)}, bodies)
    # The new body of 3 is younger; 2 has that of its parents, and is less fit.
    assert rule.ranks([*population, *brood]) == [(0, -4), (1, -3), (2, -2), (0, -1)]
    rule.update(brood)
    heir = members([(0.5, 0, 0)], 8, {8: (2, 3)}, {8: 5})
    fronts = [front for front, _ in rule.ranks([*population, *brood, *heir])]
    assert fronts == [0, 0, 1, 0, 1]


def test_a_population_is_ranked_once_for_all_its_children(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[int] = []

    def ranks(_rule: Any, population: Sequence[Member]) -> list[int]:  # noqa: ANN401
        calls.append(len(population))
        return [0] * len(population)

    monkeypatch.setattr(AgeLayered, "ranks", ranks)
    selection = SelectionSection(parents="age-layered")
    experiment = Experiment("test", selection=selection)
    rule = rule_of(experiment, "parents", Relatives(chain))
    population = members([(1, 0, 0)] * 9)
    for _ in range(3):
        rule.places(2, population, np.random.default_rng(1))
    rule.update(population)
    rule.places(2, population, np.random.default_rng(1))
    assert calls == [9, 9]


@pytest.mark.parametrize(
    ("rule", "parameters", "message"),
    [
        ("map-elites", {}, "selection.survivors: needs the section .grid."),
        ("map-elites", {"bins": 3}, "survivors_parameters.bins: no such key"),
        ("nsga2", {}, "must have a key 'objectives'"),
        ("nsga2", {"objectives": {"fitness": "max"}}, "must be a table of length >= 2"),
        (
            "nsga2",
            {"objectives": {"fitness": "max", "c": "min"}},
            "must be of .* 'c'",
        ),
        ("novelty", {"nearest": 0}, "survivors_parameters.nearest: must be .* >= 1"),
    ],
)
def test_a_rule_that_lacks_what_it_needs_is_refused(
    rule: str, parameters: dict[str, Any], message: str
) -> None:
    selection = SelectionSection(survivors=rule, survivors_parameters=parameters)
    experiment = Experiment("test", selection=selection)
    with pytest.raises(ExperimentError, match=message):
        rule_of(experiment, "survivors", Relatives(chain))


@pytest.mark.long
def test_fronts_and_crowding_are_those_of_pymoo() -> None:
    sorting = pytest.importorskip("pymoo.util.nds.non_dominated_sorting")
    metrics = pytest.importorskip("pymoo.operators.survival.rank_and_crowding.metrics")
    rng = np.random.default_rng(1)
    for objectives in (2, 3, 4) * 10:
        values = rng.random((60, objectives)).round(rng.integers(1, 12))
        fronts = sorting.NonDominatedSorting().do(values)
        expected = {at: n for n, front in enumerate(fronts) for at in front.tolist()}
        assert front_numbers(values).tolist() == [expected[at] for at in range(60)]
        for front in fronts:
            theirs = metrics.get_crowding_function("cd").do(values[front])
            ours = crowding_distances(values[front]) / objectives
            assert ours == pytest.approx(theirs, rel=1e-12)


@pytest.mark.long
def test_cells_and_competition_are_those_of_pyribs() -> None:
    archives = pytest.importorskip("ribs.archives")
    rng = np.random.default_rng(2)
    bounds = [*zip(*GRID.bounds, strict=True)]
    grid = archives.GridArchive(
        solution_dim=1, dims=GRID.bins, ranges=[*zip(*bounds, strict=True)]
    )
    elites = RankSelection(MapElites(None, EXPERIMENT), None)
    survivors = list[Member]()
    for first in range(0, 300, 15):
        rows = rng.normal([0, 1, 0.5], [1, 0.6, 0.3], (15, 3))
        pool = [*survivors, *members([*map(tuple, rows.tolist())], first)]
        grid.add(np.arange(first, first + 15)[:, None], rows[:, 0], rows[:, 1:])
        survivors = [pool[at] for at in elites.select(pool, 1, rng)]
        ours = {cell_of(GRID, one.measures): one.birth.number for one in survivors}
        cells = grid.int_to_grid_index(grid.data("index")).tolist()
        theirs = grid.data("solution")[:, 0].astype(int).tolist()
        assert ours == dict(zip(map(tuple, cells), theirs, strict=True))
    dns = archives.DNSArchive(solution_dim=1, measure_dim=2, capacity=40, k_neighbors=3)
    shares = [[one.measures["a"] / 2, one.measures["b"]] for one in survivors]
    fitness = [one.fitness for one in survivors]
    theirs = dns.compute_dns(np.array(shares), np.array(fitness))
    rule = DominatedNovelty(Competition(nearest=3), EXPERIMENT)
    assert [-rank for rank in rule.ranks(survivors)] == pytest.approx(theirs)
