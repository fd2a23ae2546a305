"""Sections on islands and migration: meaning, and errors."""

from pathlib import Path

import pytest

from schema.errors import ExperimentError
from schema.experiment.document import Experiment, island_count, island_experiment
from schema.experiment.file import experiment_from_text, experiment_text, read_draft
from schema.experiment.migration import Migration, migrant_count
from tests.documents import parse_experiment

TWO_KINDS = """
name = "two-kinds"
births = 90
[selection]
window = 3
[[islands]]
count = 4
[islands.migration]
epoch = 30
[[islands]]
births = 40
[islands.selection]
population = 20
[islands.arena]
population_limit = 25
[migration]
topology = "ring"
migrants = 2
"""


def parse(text: str = "", old: str = "", new: str = "") -> Experiment:
    document = text or TWO_KINDS
    assert old in document
    return parse_experiment(document.replace(old, new) if old else document, "x.toml")


def test_an_experiment_without_islands_is_one() -> None:
    experiment = parse('name = "alone"')
    assert island_count(experiment) == 1
    assert island_experiment(experiment, 0) == experiment


def test_islands_change_the_keys_that_they_name() -> None:
    experiment = parse()
    assert island_count(experiment) == 5
    first, last = (island_experiment(experiment, number) for number in (0, 4))
    assert (first.births, first.selection.population, first.arena) == (90, 15, None)
    assert (last.births, last.selection.population) == (40, 20)
    assert last.selection.window == first.selection.window == 3
    assert last.arena is not None
    assert (last.arena.population_limit, last.arena.population_floor) == (25, 8)
    assert first.migration == Migration(topology="ring", epoch=30, migrants=2)
    assert last.migration == Migration(topology="ring", migrants=2)
    assert first.islands == last.islands == ()


def test_archipelago_text_round_trip() -> None:
    experiment = parse()
    assert experiment_from_text(experiment_text(experiment)) == experiment


def test_island_number_out_of_range_is_refused() -> None:
    for number in (-1, 5):
        with pytest.raises(ValueError, match=r"0\.\.4"):
            island_experiment(parse(), number)


def test_births_of_a_flag_replace_those_of_each_island(tmp_path: Path) -> None:
    """Those of the document, which the flag replaces, are invalid."""
    text = TWO_KINDS.replace("births = 90", 'births = "x"').replace("= 40", "= 1")
    (tmp_path / "two.toml").write_text(text)
    (experiment,) = read_draft(str(tmp_path / "two.toml"), 70).checked()
    assert {island_experiment(experiment, each).births for each in range(5)} == {70}
    with pytest.raises(ExperimentError, match=r"two\.toml with --births 14: .*births"):
        read_draft(str(tmp_path / "two.toml"), 14).checked()


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('"ring"', '"rong"', "topology"),
        ('"ring"', '"unconnected"', "unconnected islands cannot"),
        ('"ring"', '"edges"', "pairs of islands, got none"),
        ('"ring"', '"edges"\nedges = [[0, 5]]', r"0\.\.4, got \[0, 5\]"),
        ('"ring"', '"edges"\nedges = [[1, 1]]', "two islands"),
        ('"ring"', '"edges"\nedges = [[0, 1], [0, 1]]', "twice"),
        ('"ring"', '"edges"\nedges = [[0, -1]]', r"edges\[0\]\[1\]"),
        ('"ring"', '"ring"\nedges = [[0, 1]]', "needs topology"),
        ('"ring"', '"random-regular"\ndegree = 3', "even"),
        ('"ring"', '"random-regular"\ndegree = 5', "< 5"),
        ('"ring"', '"small-world"\ndegree = 3', "even"),
        ("epoch = 30", "epoch = 76", "would end with birth 90"),
        ("births = 40", "births = 20", r"island 4"),
        ("migrants = 2", "migrants = 0", "migrants"),
        ("migrants = 2", "migrants = 0.03", "rounds to 0"),
        ("migrants = 2", "migrants = 16", "<= 15"),
        ("migrants = 2", 'replaced = "none"', r"varies.*island 0"),
        ("migrants = 2", 'replaced = "rule"', r'"rule" is for.*off-line.*island 4'),
        (
            "count = 4",
            'count = 4\nselection.survivors = "map-elites"',
            'must be "rule"',
        ),
        ("epoch = 30", 'topology = "star"', "the same on all islands"),
        ("epoch = 30", "epok = 30", r"islands\[0\]\.migration\.epok.*'epoch'"),
        ("population = 20", "population = 3", r"islands\[1\]: selection"),
        ("[islands.arena]", "[islands.space]", r"islands\[1\]\.space: no such key"),
    ],
)
def test_inconsistent_migration_is_refused_in_one_line(
    old: str, new: str, why: str
) -> None:
    with pytest.raises(ExperimentError, match=why) as error:
        parse(old=old, new=new)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('[migration]\ntopology = "ring"', "at least two islands"),
        ("[migration]\nepoch = 30", "unconnected"),
        ("islands = 3", "islands: must be a list"),
        ("[islands]\ncount = 2", r"must be \[\[islands"),
        ("[[islands]]\n[islands.migration]\nepoch = 3", "migration: is missing"),
        ("[[islands]]\ncount = 0", "count"),
        (
            '[[islands]]\ncount = 2\n[migration]\ntopology = "ring"\nepoch_s = 9.0',
            "arenas",
        ),
        (
            (
                "[selection]\npopulation = 5\n[[islands]]\ncount = 2\n"
                '[migration]\ntopology = "ring"\nhandling = "evict"'
            ),
            "at least 5",
        ),
    ],
)
def test_migration_that_never_happens_is_refused(text: str, why: str) -> None:
    with pytest.raises(ExperimentError, match=why):
        parse(f'name = "x"\n{text}')


def test_unconnected_topology_without_other_keys_is_accepted() -> None:
    text = '[[islands]]\ncount = 2\n[migration]\ntopology = "unconnected"'
    assert island_count(parse(f'name = "x"\n{text}')) == 2


@pytest.mark.parametrize(
    ("migrants", "population", "count"),
    [(1, 15, 1), (3, 2, 2), (0.2, 15, 3), (0.1, 14, 1), (1.0, 15, 15), (0.03, 15, 0)],
)
def test_number_of_migrants(migrants: float, population: int, count: int) -> None:
    assert migrant_count(Migration(migrants=migrants), population) == count
