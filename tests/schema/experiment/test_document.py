"""The experiment document: defaults, accepted documents, reading and settings."""

import math
from pathlib import Path

import pytest
from msgspec import convert

from schema.errors import ExperimentError
from schema.experiment.document import (
    ArenaWorld,
    Experiment,
    Measures,
    Simulation,
    Space,
    body_space,
    island_experiment,
    references,
    steps_of,
)
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
    shipped_experiments,
)
from schema.experiment.identity import Origin
from schema.experiment.learning import Learning
from schema.experiment.robust import Robust
from schema.experiment.settings import (
    EvaluationSettings,
    arena_settings,
    breeding_settings,
    evaluation_settings,
    evaluation_settings_of,
    read_arena_settings,
    read_breeding_settings,
    read_evaluation_settings,
)
from schema.parts import BUILT_IN
from tests.documents import parse, parse_experiment

PLUGINS = Path(__file__).parents[2] / "plugins"


@pytest.fixture
def users_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a user's package on the import path."""
    monkeypatch.syspath_prepend(PLUGINS)


def test_defaults_are_the_thesis() -> None:
    experiment = parse("")
    space, selection = experiment.space, experiment.selection
    limits = (space.min_parts, space.max_parts, space.max_inputs, space.max_outputs)
    assert limits == (3, 30, 10, 10)
    assert space.max_hidden == 10
    assert (experiment.generation.parts_mean, experiment.generation.parts_sd) == (12, 5)
    assert experiment.generation.p_connect_neurons == 0.1
    variation = experiment.variation
    assert variation.p_delete_subtree == variation.p_swap_subtree == 0.05
    assert variation.p_duplicate_subtree == 0.1
    assert (variation.body_epsilon, variation.brain_epsilon) == (0.05, 0.1)
    assert (selection.population, selection.children) == (15, 15)
    assert (selection.tournament_size, selection.max_mating_attempts) == (4, 5)
    assert (experiment.births, experiment.window) == (3000, 15)
    clock = experiment.simulation
    assert clock.timestep_s * clock.brain_steps == pytest.approx(1 / 8)
    assert clock.timestep_s * clock.pose_steps == pytest.approx(1 / 5)
    assert clock.timestep_s * clock.window_steps == pytest.approx(12.0)
    fitness = experiment.fitness
    assert (fitness.path_weight, fitness.straight_weight, fitness.limit) == (1, 5, 1)


def test_scenario_3_is_the_thesis() -> None:
    experiment = read_experiment("scenario3")
    arena, clock = experiment.arena, experiment.simulation
    assert arena is not None
    assert (arena.founder_interval_s, arena.birth_interval_s) == (1, 15)
    assert (arena.cull_interval_s, arena.sample_interval_s) == (30, 5)
    assert arena.snapshot_interval_s == 100
    assert (arena.population_floor, arena.population_limit) == (8, 30)
    assert (arena.survive_share_of_mean, arena.full_cull_share) == (0.7, 0.7)
    assert (arena.birth_radius_m, arena.birth_distance_m) == (2, 0.25)
    assert (arena.drop_m, arena.wall_diameter_m, arena.light) == (0.25, 0, None)
    assert (experiment.selection.population, experiment.births) == (15, 3000)
    assert (clock.warmup_steps, clock.window_steps) == (600, 2400)
    assert steps_of(arena.birth_interval_s, clock) == 3000


def test_sections_are_off_by_default() -> None:
    experiment = parse("")
    assert (experiment.arena, experiment.robust, experiment.learning) == (None,) * 3
    assert experiment.selection.culling is None
    assert experiment.selection.reevaluation is None
    assert experiment.simulation.evaluation_s is None
    assert parse("[robust]").robust == Robust()
    assert parse("[learning]").learning == Learning()
    with pytest.raises(ExperimentError, match=r"has no \[arena\]"):
        arena_settings(experiment, Origin())


def test_empty_culling_table_has_the_values_of_an_arena() -> None:
    culling = parse("[selection.culling]").selection.culling
    assert culling is not None
    assert (culling.population_limit, culling.population_floor) == (30, 8)
    assert (culling.survive_share_of_mean, culling.full_cull_share) == (0.7, 0.7)
    # A birth every 15 s, a cull every 30 s.
    assert culling.interval == 2


def test_islands_may_have_sections_of_their_own() -> None:
    text = "[robust]\ndraws = 3\n[learning]\nbudget = 3\n[[islands]]\n[[islands]]\n"
    both = parse(f"{text}robust = {{take = 'least'}}\nlearning = {{sigma = 0.1}}")
    here, there = (island_experiment(both, number) for number in (0, 1))
    assert here.robust == evaluation_settings_of(here).robust == Robust(draws=3)
    assert there.robust == Robust(draws=3, take="least")
    assert here.learning == Learning(budget=3)
    assert there.learning == Learning(budget=3, sigma=0.1)
    mixed = parse("[[islands]]\nrobust = {}\n[[islands]]\narena = {}")
    assert [island_experiment(mixed, n).robust for n in (0, 1)] == [Robust(), None]


@pytest.mark.parametrize(
    "text",
    [
        "[selection]\nwindow = 1",
        "[selection]\npopulation = 8\n[selection.culling]\npopulation_limit = 9",
        "[selection.culling]\nfull_cull_share = 0.02",
        "[selection.reevaluation]\nshare = 1",
        "[simulation]\nevaluation_s = [12.0, 12.0]",
        "[simulation]\nwarmup_steps = 600\nevaluation_s = [15, 20]",
        "[[calibration]]\npart = 'Core'\nsensor = {delay_s = 0.375}",
        '[arena]\npopulation_floor = 2\n[selection]\nparents = "random"',
        '[arena]\n[selection]\nparents = "none"',
        (
            "[selection.culling]\n[[islands]]\ncount = 2\n"
            "[migration]\ntopology = 'ring'\nreplaced = 'none'"
        ),
    ],
)
def test_limits_of_the_allowed_values_are_accepted(text: str) -> None:
    parse(text)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "test.toml: name: must not be empty, got ''"),
        (" ", "name: must not be empty, got ' '"),
        ("a\\u0000b", "name: must be printable, got 'a\\\\x00b'"),
        ("a" * 201, "name: must be <= 200 bytes .*, got 201"),
        ("ä" * 34, "name: must be <= 200 bytes .*, got 204"),
    ],
)
def test_names_that_no_folder_can_have_are_refused(name: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=message):
        parse_experiment(f'name = "{name}"', "test.toml")


@pytest.mark.parametrize("name", ["a" * 200, "ä" * 33, "a/b c"])
def test_names_that_a_folder_can_have_are_accepted(name: str) -> None:
    assert parse_experiment(f'name = "{name}"', "test.toml").name == name


def test_name_is_required() -> None:
    with pytest.raises(ExperimentError, match="name"):
        parse_experiment("", "test.toml")


CORE = "schema.parts:CORE"


@pytest.mark.usefixtures("users_package")
@pytest.mark.parametrize(
    ("types", "message"),
    [
        (["schema.parts:HINGE"], "must contain one core, got 0"),
        ([CORE, "schema.parts:HINGE"], "at least one type must have a motor"),
        ([CORE, CORE], "two part types are named 'Core'"),
        ([CORE, "flippers:FLIPER"], "space.part_types: .* mean 'flippers:FLIPPER'"),
    ],
)
def test_part_types_without_core_or_motor_are_refused(
    types: list[str], message: str
) -> None:
    with pytest.raises(ExperimentError, match=message):
        parse(f"[space]\npart_types = {types}")


@pytest.mark.usefixtures("users_package")
def test_part_types_of_users_and_built_in_ones_mix() -> None:
    names = [CORE, "flippers:FLIPPER", "schema.parts:ACTIVE_HINGE"]
    experiment = parse(f"[space]\npart_types = {names}")
    types = body_space(experiment.space)
    assert list(types) == ["Core", "Flipper", "ActiveHinge"]
    assert types["Flipper"].inputs == 1
    settings = read_breeding_settings(breeding_settings(experiment))
    assert body_space(settings.space) == types


def test_beta_of_bars_is_zero_in_planar_bodies_only() -> None:
    planar, free = body_space(Space()), body_space(Space(planar=False))
    bar = "ParametricBarJoint"
    assert planar[bar] is BUILT_IN[bar]
    length, alpha, beta = free[bar].own_parameters
    assert (beta.low, beta.high) == (0.0, math.pi)
    assert (length, alpha) == planar[bar].own_parameters[:2]


def test_only_own_measures_name_modules() -> None:
    text = "[measures]\nnames = ['height', 'my_lab:limp']\nparameters.limp = {a = 0.5}"
    experiment = parse(text)
    names, parameters = ("height", "my_lab:limp"), {"limp": {"a": 0.5}}
    assert experiment.measures == Measures(names=names, parameters=parameters)
    assert experiment.measures.labels == ("height", "limp")
    assert "my_lab:limp" in references(experiment)
    assert "height" not in references(experiment)


def test_settings_hold_the_sections_that_an_answer_depends_on() -> None:
    experiment = parse("births = 40\n[fitness]\nlimit = 2.0")
    settings = read_evaluation_settings(evaluation_settings(experiment))
    assert settings == EvaluationSettings(
        space=experiment.space,
        simulation=experiment.simulation,
        fitness=experiment.fitness,
    )
    # More births or another seed do not make other requests.
    assert evaluation_settings(experiment) == evaluation_settings(
        parse("births = 50\n[fitness]\nlimit = 2.0")
    )


def test_settings_and_text_round_trip() -> None:
    experiment = parse("[arena]\nlight = [0.0, 1.0, 2.5]\nrecord_touches = true")
    origin = Origin(seed=5, run=2, island=3)
    settings = read_arena_settings(arena_settings(experiment, origin))
    assert settings.origin == origin
    assert settings.arena == convert(experiment.arena, ArenaWorld, from_attributes=True)
    assert settings.simulation == experiment.simulation
    assert experiment_from_text(experiment_text(experiment)) == experiment
    with pytest.raises(ExperimentError, match="experiment of a run"):
        experiment_from_text("{}")


@pytest.mark.parametrize("settings", [b"", b"{}", b"[1]", b"\xff", b'{"space": 1}'])
def test_malformed_settings(settings: bytes) -> None:
    for read in (read_breeding_settings, read_evaluation_settings):
        with pytest.raises(ExperimentError, match="settings of a request: "):
            read(settings)


def test_inconsistent_settings_of_requests_are_refused() -> None:
    """An evaluation that skips the end of its window would never end."""
    clock = Simulation(window_steps=1000, pose_steps=48)
    settings = evaluation_settings(Experiment(name="x", simulation=clock))
    with pytest.raises(ExperimentError, match=r"request: simulation\.window_steps: "):
        read_evaluation_settings(settings)
    pushed = arena_settings(parse("[arena]"), Origin())
    pushed = pushed.replace(b'"push_impulse":0.0', b'"push_impulse":0.1')
    with pytest.raises(ExperimentError, match=r"push_impulse: is for off-line"):
        read_arena_settings(pushed)


def test_document_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    for encoding in ("utf-8", "utf-8-sig"):
        path.write_text('name = "test"\nbirths = 60', encoding)
        assert read_experiment(str(path)).births == 60
    path.write_bytes(b"name = '\xff'")
    for name in (path, tmp_path / "none.toml"):
        with pytest.raises(ExperimentError, match="cannot be read"):
            read_experiment(str(name))
    with pytest.raises(ExperimentError, match="scenario99: no such experiment"):
        read_experiment("scenario99")


@pytest.mark.parametrize("name", shipped_experiments())
def test_shipped_experiment_is_well_formed(name: str) -> None:
    read_experiment(name)


def test_keys_that_no_longer_exist_are_left_out_of_stored_documents() -> None:
    plain = parse("[[islands]]\ncount = 2\n[islands.variation]\np_swap_subtree = 0.5")
    text = experiment_text(plain)
    old = text.replace(
        '"p_swap_subtree"', '"hidden_rounding":"half-up","p_swap_subtree"'
    )
    old = old.replace('"births"', '"gone":[{"a":1}],"births"', 1)
    assert old.count("hidden_rounding") == 2
    assert experiment_from_text(old) == plain
    with pytest.raises(ExperimentError, match=r"experiment of a run: .* `gone`"):
        experiment_from_text(old, is_resumed=True)
    assert experiment_from_text(text, is_resumed=True) == plain
