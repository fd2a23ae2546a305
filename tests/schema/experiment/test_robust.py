"""The section [robust]: accepted and refused values."""

import pytest

from schema.experiment.document import island_experiment
from schema.experiment.file import read_experiment
from schema.experiment.robust import Robust
from schema.experiment.settings import evaluation_settings_of
from tests.documents import check_refused, parse


def test_it_is_off_unless_the_section_is_there() -> None:
    assert parse("").robust is None
    assert evaluation_settings_of(parse("")).robust is None
    assert parse("[robust]").robust == Robust()
    assert read_experiment("robust").robust == Robust(draws=4, take="mean")


def test_an_island_may_have_its_own() -> None:
    text = "[robust]\ndraws = 3\n[[islands]]\n[[islands]]\nrobust = {take = 'least'}"
    found = parse(text)
    own = [evaluation_settings_of(island_experiment(found, n)).robust for n in (0, 1)]
    assert own == [Robust(draws=3), Robust(draws=3, take="least")]


def test_arenas_may_have_off_line_neighbours_with_it() -> None:
    text = "[[islands]]\nrobust = {}\n[[islands]]\narena = {}"
    found = parse(text)
    assert [island_experiment(found, n).robust for n in (0, 1)] == [Robust(), None]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[robust]\ndraws = 0", "robust.draws: must be .* >= 1, got 0"),
        ("[robust]\ntake = 'last'", "robust.take: must be one of 'mean', 'least', 'q"),
        ("[robust]\nmass = [0, 1]", r"robust.mass\[0\]: must be a number > 0.0, got 0"),
        (
            "[robust]\nfriction = [1.1, 0.9]",
            r"robust.friction: must be \[least, greatest\], got \[1.1, 0.9\]",
        ),
        ("[robust]\nfrictoin = [1, 1]", "no such key; did you mean 'friction'"),
        ("[arena]\n[robust]", "robust: is for off-line evaluations; the robots of an"),
        (
            "[robust]\n[[islands]]\n[[islands]]\narena = {}",
            r"islands\[1\]: robust: is for off-line evaluations",
        ),
        (
            "[arena]\n[simulation]\nstart_deg = [0, 1, 0]",
            "simulation.start_deg: is for off-line evaluations",
        ),
    ],
)
def test_refused_values_name_the_key(text: str, message: str) -> None:
    check_refused(text, message)
