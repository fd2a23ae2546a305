"""Settings between off-line and on-line: accepted and refused values."""

import pytest

from schema.errors import ExperimentError
from tests.documents import parse


def test_sections_are_off_by_default() -> None:
    experiment = parse("")
    assert experiment.selection.culling is None
    assert experiment.selection.reevaluation is None
    assert experiment.simulation.evaluation_s is None


def test_empty_culling_table_has_the_values_of_an_arena() -> None:
    culling = parse("[selection.culling]").selection.culling
    assert culling is not None
    assert (culling.population_limit, culling.population_floor) == (30, 8)
    assert (culling.survive_share_of_mean, culling.full_cull_share) == (0.7, 0.7)
    # A birth every 15 s, a cull every 30 s.
    assert culling.interval == 2


@pytest.mark.parametrize(
    "text",
    [
        "[selection]\npopulation = 8\n[selection.culling]\npopulation_limit = 9",
        "[selection.culling]\nfull_cull_share = 0.02",
        "[selection.reevaluation]\nshare = 1",
        "[simulation]\nevaluation_s = [12.0, 12.0]",
        "[simulation]\nwarmup_steps = 600\nevaluation_s = [15, 20]",
    ],
)
def test_limits_of_the_allowed_values_are_accepted(text: str) -> None:
    parse(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[selection.culling]\npopulation_floor = 4", "population_floor: must be >= 5"),
        ("[selection.culling]\npopulation_limit = 14", "population_limit: .* 15, got"),
        (
            "[selection.culling]\npopulation_limit = 20\npopulation_floor = 20",
            "population_limit: must be > population_floor .* 21, got 20",
        ),
        ("[selection.culling]\nfull_cull_share = 0.01", "full_cull_share: must remove"),
        (
            '[selection]\nsurvivors = "random"\n[selection.culling]',
            "selection.culling: survival depends on fitness",
        ),
        (
            "[selection]\nkeep_parents = false\n[selection.culling]",
            "selection.culling: survival depends on fitness",
        ),
        (
            "[selection]\nkeep_parents = false\n[selection.reevaluation]",
            "selection.reevaluation: no individual outlives its brood",
        ),
        ("[selection.reevaluation]\nshare = 0", "share: must be a number > 0"),
        ("[selection.reevaluation]\nintervall = 3", "did you mean 'interval'"),
        ("[simulation]\nevaluation_s = [11.9, 30]", "must be >= 12 s, .* got 11.9"),
        (
            "[simulation]\nwarmup_steps = 600\nevaluation_s = [14, 20]",
            "must be >= 15 s",
        ),
        ("[simulation]\nevaluation_s = [30, 20]", r"\[shortest, longest\], got \[30"),
        ("[simulation]\nevaluation_s = [30]", r"length 2, got \[30\]"),
        ("[simulation]\nevaluation_s = [12, inf]", "must be finite"),
        ("[arena]\n[selection.culling]", "selection.culling: arenas have"),
        ("[arena]\n[selection.reevaluation]", "selection.reevaluation: arenas"),
        (
            "[arena]\n[simulation]\nevaluation_s = [12, 20]",
            "evaluation_s: not for arenas",
        ),
    ],
)
def test_inconsistent_sections_are_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=message) as raised:
        parse(text)
    assert str(raised.value).startswith("test.toml: ")
    assert "\n" not in str(raised.value)


def test_replaced_none_needs_a_population_of_varying_size() -> None:
    migration = '[[islands]]\ncount = 2\n[migration]\ntopology = "ring"\n'
    migration += 'replaced = "none"\n'
    parse(f"[selection.culling]\n{migration}")
    with pytest.raises(ExperimentError, match="only with selection"):
        parse(migration)
