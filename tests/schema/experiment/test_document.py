"""The experiment document: accepted documents and errors of wrong ones."""

import math
from pathlib import Path

import pytest

from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.check import check_experiment
from schema.experiment.document import Experiment, Simulation, Space, body_space
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
    shipped_experiments,
)
from schema.experiment.settings import (
    EvaluationSettings,
    evaluation_settings,
    read_evaluation_settings,
    read_vetting_settings,
    vetting_settings,
)
from schema.parts import BUILT_IN
from tests.documents import check_refused, parse, parse_experiment

PLUGINS = Path(__file__).parents[2] / "plugins"
NAME = 'name = "test"\n'


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
    assert experiment.births == 3000
    assert experiment.window == 15
    clock = experiment.simulation
    assert clock.timestep_s * clock.brain_steps == pytest.approx(1 / 8)
    assert clock.timestep_s * clock.pose_steps == pytest.approx(1 / 5)
    assert clock.timestep_s * clock.window_steps == pytest.approx(12.0)
    fitness = experiment.fitness
    assert (fitness.path_weight, fitness.straight_weight, fitness.limit) == (1, 5, 1)


def test_window_may_be_smaller_than_a_generation() -> None:
    assert parse("[selection]\nwindow = 1").window == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("birth = 3", r"test.toml: birth: no such key; did you mean 'births'\?"),
        ("[variation]\np_swap = 0.1", r"variation.p_swap: .* 'p_swap_subtree'\?"),
        ("[space]\nmax_part = 9", r"space.max_part: .* 'max_parts'\?; allowed: part_"),
        ("[selektion]\nwindow = 1", "did you mean 'selection'"),
        ("zzzz = 1", "zzzz: no such key; allowed: name, births"),
        ('births = "many"', r"births: must be a whole number, got 'many'"),
        ("births = 0", r"births: .*>= 1.*, got 0"),
        ("births = 2.5", "births: "),
        ("[variation]\nbody_epsilon = 1.5", r"variation.body_epsilon: .*, got 1.5"),
        ("[variation]\nbody_epsilon = nan", "variation.body_epsilon: "),
        ("[generation]\nparts_mean = nan", "generation.parts_mean: "),
        ("[generation]\nparts_sd = inf", "generation.parts_sd: "),
        ("[simulation]\ntimestep_s = inf", "simulation.timestep_s: "),
        ("[simulation]\nsensor_noise = -0.1", "simulation.sensor_noise: .*, got -0.1"),
        ("[simulation]\nsensor_noise = inf", "simulation.sensor_noise: .*, got inf"),
        (
            "[simulation]\nactuator_noise = 2e6",
            r"actuator_noise: .*<= 1.*, got 2000000",
        ),
        (
            '[simulation]\nactuator_noise = "a"',
            "simulation.actuator_noise: .*, got 'a'",
        ),
        ("[simulation]\nactor_noise = 1", "no such key; did you mean 'actuator_noise'"),
        (
            '[selection]\nparents = "rank"',
            "selection.parents: must be one of 'tournament', .* 'none' or .*'rank'",
        ),
        (
            '[selection.reevaluation]\nfitness = "meen"',
            r"selection.reevaluation.fitness: .*, got 'meen'; did you mean 'mean'\?",
        ),
        (
            '[[islands]]\n[islands.selection]\nsurvivors = "bets"',
            r"islands.0.: selection.survivors: .*, got 'bets'; did you mean 'best'\?",
        ),
        (
            "[vetting]\nmode = 3",
            "vetting.mode: must be one of 'overlap', 'contact', got 3",
        ),
        ("space = 3", "space: must be a table"),
        ("[space]\npart_types = [1]", r"space.part_types\[0\]: .*, got 1"),
        ("[[", "test.toml: not valid TOML: "),
    ],
)
def test_wrong_document(text: str, message: str) -> None:
    check_refused(text, message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[space]\nmin_parts = 31", "space.min_parts: must be <= .* = 30, got 31"),
        ("[space]\nmin_parts = 1\nmax_parts = 1", "space.max_parts: must be > 1"),
        ("[space]\nmax_inputs = 5", "space.max_inputs: must be >= 6"),
        ("[selection]\npopulation = 4", "a tournament of 4 .* needs >= 5, got 4"),
        (
            '[selection]\npopulation = 1\nparents = "random"',
            "two parents need >= 2, got 1",
        ),
        (
            "[selection]\nchildren = 9\nkeep_parents = false",
            "selection.children: must be >= selection.population = 15",
        ),
        ("births = 14", "births: must be >= selection.population = 15, got 14"),
        ("[selection]\nwindow = 16", "window: must be <= .* = 15, got 16"),
        ("[simulation]\npose_steps = 41", "must be a multiple .* = 41, got 2400"),
    ],
)
def test_impossible_experiment(text: str, message: str) -> None:
    check_refused(text, message)


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


@pytest.mark.parametrize(
    ("types", "message"),
    [
        ('"schema.parts:CORE", "schema.parts:WHEEL"', "has no 'WHEEL'"),
        ('"schema.parts:CORE", "no_such_module:X"', "No module named"),
        ('"schema.parts:CORE", "Hinge"', "must be 'module:attribute', got 'Hinge'"),
    ],
)
def test_unknown_plug_in(types: str, message: str) -> None:
    with pytest.raises(UnknownPlugin, match=f"space.part_types: .*{message}"):
        parse(f"[space]\npart_types = [{types}]")


@pytest.mark.parametrize(
    ("types", "message"),
    [
        ('"schema.parts:HINGE"', "must contain exactly one core, got 0"),
        (
            '"schema.parts:CORE", "schema.parts:HINGE"',
            "at least one type must have a motor",
        ),
        ('"schema.parts:CORE", "schema.parts:CORE"', "two part types are named 'Core'"),
        ('"schema.parts:SERVO"', "'schema.parts:SERVO' is not a PartType"),
    ],
)
def test_part_types_without_core_or_motor_are_refused(types: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=message):
        parse(f"[space]\npart_types = [{types}]")


@pytest.mark.usefixtures("users_package")
def test_part_types_of_users_and_built_in_ones_mix() -> None:
    experiment = parse(
        "[space]\npart_types = "
        '["schema.parts:CORE", "flippers:FLIPPER", "schema.parts:ACTIVE_HINGE"]'
    )
    types = body_space(experiment.space)
    assert list(types) == ["Core", "Flipper", "ActiveHinge"]
    assert types["Flipper"].inputs == 1
    settings = read_vetting_settings(vetting_settings(experiment))
    assert body_space(settings.space) == types


@pytest.mark.usefixtures("users_package")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("NOT_A_PART", "is not a PartType"),
        ("FLIPER", "did you mean 'flippers:FLIPPER'"),
        ('FLIPPER", "flippers:SECOND_FLIPPER', "two part types are named 'Flipper'"),
    ],
)
def test_mistakes_in_names_of_part_types_are_reported(name: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=message):
        parse(f'[space]\npart_types = ["schema.parts:CORE", "flippers:{name}"]')


def test_beta_of_bars_is_zero_in_planar_bodies_only() -> None:
    planar, free = body_space(Space()), body_space(Space(planar=False))
    bar = "ParametricBarJoint"
    assert planar[bar] is BUILT_IN[bar]
    length, alpha, beta = free[bar].own_parameters
    assert (beta.low, beta.high) == (0.0, math.pi)
    assert (length, alpha) == planar[bar].own_parameters[:2]


def test_text_round_trip() -> None:
    experiment = parse("births = 40\n[simulation]\ntimestep_s = 0.001")
    assert experiment_from_text(experiment_text(experiment)) == experiment
    with pytest.raises(ExperimentError, match="experiment of a run"):
        experiment_from_text("{}")


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


@pytest.mark.parametrize("settings", [b"", b"{}", b"[1]", b"\xff", b'{"space": 1}'])
def test_malformed_settings(settings: bytes) -> None:
    for read in (read_vetting_settings, read_evaluation_settings):
        with pytest.raises(ExperimentError, match="settings of a request: "):
            read(settings)


def test_settings_whose_window_ends_between_two_samples_are_refused() -> None:
    """An evaluation that skips the end of its window would never end."""
    clock = Simulation(window_steps=1000, pose_steps=48)
    settings = evaluation_settings(Experiment(name="x", simulation=clock))
    message = (
        "settings of a request: simulation.window_steps: must be a multiple of "
        "simulation.pose_steps = 48, got 1000"
    )
    with pytest.raises(ExperimentError, match=message):
        read_evaluation_settings(settings)


def test_document_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(NAME + "births = 60")
    assert read_experiment(str(path)).births == 60
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(ExperimentError, match="cannot be read"):
        read_experiment(str(path))
    with pytest.raises(ExperimentError, match="cannot be read"):
        read_experiment(str(tmp_path / "none.toml"))


def test_unknown_experiment_is_refused() -> None:
    with pytest.raises(ExperimentError, match="scenario99: no such experiment"):
        read_experiment("scenario99")


@pytest.mark.parametrize("name", shipped_experiments())
def test_shipped_experiment_is_well_formed(name: str) -> None:
    check_experiment(read_experiment(name), name)


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
