"""The section of an arena: accepted documents and errors of wrong ones."""

import pytest

from schema.errors import ExperimentError
from schema.experiment.document import steps_of
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
)
from schema.experiment.identity import Origin
from schema.experiment.settings import arena_settings, read_arena_settings
from tests.documents import check_refused, parse


def test_scenario_3_is_the_thesis() -> None:
    experiment = read_experiment("scenario3")
    arena, clock = experiment.arena, experiment.simulation
    assert arena is not None
    assert arena.founder_interval_s == 1
    assert arena.birth_interval_s == 15
    assert arena.cull_interval_s == 30
    assert arena.sample_interval_s == 5
    assert arena.snapshot_interval_s == 100
    assert (arena.population_floor, arena.population_limit) == (8, 30)
    assert (arena.survive_share_of_mean, arena.full_cull_share) == (0.7, 0.7)
    assert (arena.birth_radius_m, arena.birth_distance_m, arena.drop_m) == (
        2,
        0.25,
        0.25,
    )
    assert arena.wall_diameter_m == 0
    assert arena.light is None
    assert experiment.selection.population == 15
    assert experiment.births == 3000
    assert (clock.warmup_steps, clock.window_steps) == (600, 2400)
    assert clock.warmup_steps * clock.timestep_s == pytest.approx(3.0)
    assert steps_of(arena.birth_interval_s, clock) == 3000


def test_off_line_is_the_default() -> None:
    assert parse("").arena is None
    assert parse("[arena]").arena is not None
    with pytest.raises(ExperimentError, match=r"has no \[arena\]"):
        arena_settings(parse(""), Origin())


def test_settings_and_text_round_trip() -> None:
    experiment = parse("[arena]\nlight = [0.0, 1.0, 2.5]\nrecord_touches = true")
    origin = Origin(seed=5, run=2, island=3)
    settings = read_arena_settings(arena_settings(experiment, origin))
    assert settings.origin == origin
    assert settings.arena == experiment.arena
    assert settings.simulation == experiment.simulation
    assert experiment_from_text(experiment_text(experiment)) == experiment


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[arena]\nbirth_interval = 1",
            r"arena.birth_interval: .*'birth_interval_s'\?",
        ),
        ("arena = 3", "arena: must be a table"),
        (
            "[arena]\nlight = [nan, 0.0, 1.0]",
            r"light\[0\]: must be finite, got nan",
        ),
        ("[arena]\npopulation_limit = 0", "arena.population_limit: .*, got 0"),
        ("[arena]\npopulation_floor = 31", r"limit: must be >= .*, 31, got 30"),
        ("[arena]\npopulation_limit = 14", r"selection.population, 15, got 14"),
        ("[arena]\npopulation_floor = 4", "floor: must be >= 5, .*, got 4"),
        ("[arena]\nbirth_interval_s = 15.1", "birth_interval_s: .* 1 s, .* got 15.1"),
        ("[arena]\nsample_interval_s = 0.001", "sample_interval_s: must be a whole"),
        ("[arena]\nfounder_interval_s = 0.5", "founder_interval_s: .* 1 s, the common"),
        ("[arena]\n[simulation]\nwarmup_steps = 601", "warmup_steps: .* 40, got 601"),
        ('[arena]\n[selection]\nsurvivors = "random"', "survival in an arena"),
        ("[arena]\nsplit_distance_m = 0.01", "split_distance_m: must be >= "),
    ],
)
def test_wrong_arena(text: str, message: str) -> None:
    check_refused(text, message)


def test_arena_without_tournaments_needs_a_smaller_floor() -> None:
    rules = '[arena]\npopulation_floor = 2\n[selection]\nparents = "random"'
    assert parse(rules).selection.parents_needed == 2
    assert parse('[arena]\n[selection]\nparents = "none"').arena is not None
