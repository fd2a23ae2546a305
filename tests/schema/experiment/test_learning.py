"""The section [learning]: accepted and refused values."""

import pytest

from schema.experiment.document import island_experiment
from schema.experiment.file import read_experiment
from schema.experiment.learning import Learning
from tests.documents import check_refused, parse


def test_it_is_off_unless_the_section_is_there() -> None:
    assert parse("").learning is None
    assert parse("[learning]").learning == Learning()
    assert read_experiment("learning").learning == Learning(budget=20)


def test_an_island_may_have_its_own() -> None:
    text = "[learning]\nbudget = 3\n[[islands]]\n[[islands]]\nlearning = {sigma = 0.1}"
    found = parse(text)
    own = [island_experiment(found, number).learning for number in (0, 1)]
    assert own == [Learning(budget=3), Learning(budget=3, sigma=0.1)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[learning]\nbudget = 0", "learning.budget: must be .* >= 1, got 0"),
        ("[learning]\nbudget = 1001", "learning.budget: must be .* <= 1000, got 1001"),
        ("[learning]\nwhat = 'body'", "learning.what: must be one of 'all', 'wei"),
        ("[learning]\nsigma = 0", "learning.sigma: must be .* > 0.0, got 0"),
        ("[learning]\ninherit = 'all'", "learning.inherit: must be one of 'darw"),
        ("[learning]\nbudjet = 3", "no such key; did you mean 'budget'"),
        (
            "[learning]\nlearner = 'cma'",
            r"learner: must be .*'cma-es', '\(1\+1\)-es', .* 'cma'; did you mean 'cma-",
        ),
        (
            "[learning]\nweight_limits = [1, 1]",
            r"weight_limits: must be \[least, greatest\], got \[1, 1\]",
        ),
        (
            "[arena]\n[learning]\n[simulation]\nwindow_steps = 2440",
            "window_steps: must be a multiple of simulation.brain_steps = 25 with lear",
        ),
        (
            "simulation.warmup_steps = 240\n[learning]\n[[islands]]\n[islands.arena]",
            r"islands\[0\]: simulation.warmup_steps: .* in an arena, got 240",
        ),
        (
            "[learning]\n[selection.reevaluation]",
            "learning: cannot be combined with selection.reevaluation",
        ),
        (
            "[encoding]\ntype = 'cppn'\n[learning]\ninherit = 'lamarckian'",
            "learning.inherit: must be 'darwinian' with encoding.type = 'cppn'",
        ),
    ],
)
def test_refused_values_name_the_key(text: str, message: str) -> None:
    check_refused(text, message)
