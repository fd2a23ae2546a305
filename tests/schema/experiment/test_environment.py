"""Ground and scenery in experiment documents."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from schema.errors import ExperimentError
from schema.experiment.document import Space, island_experiment
from schema.experiment.environment import FLAT, Environment, gravity_vector, relief
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
)
from schema.experiment.identity import Origin
from schema.experiment.settings import (
    arena_settings,
    evaluation_settings,
    read_arena_settings,
    read_evaluation_settings,
)
from tests.documents import parse_experiment

HEAD = 'name = "mine"\nbirths = 60\n'
WALL = '<mujoco><worldbody><geom type="box" size="1 1 1"/></worldbody></mujoco>'


def refused(text: str) -> str:
    """Return the error of a document, one line."""
    with pytest.raises(ExperimentError) as error:
        parse_experiment(HEAD + text, "mine.toml")
    (line,) = str(error.value).splitlines()
    return line


def test_ground_is_flat_by_default() -> None:
    assert parse_experiment(HEAD, "it").environment == FLAT
    assert FLAT.is_even
    # Not -0.0: it would change the sign of zeros in what robots feel.
    assert repr(gravity_vector(FLAT, 9.81)) == "(0.0, 0.0, -9.81)"


def test_light_is_a_place_of_the_world_off_line_and_in_arenas() -> None:
    text = "[environment]\nlight = [1.0, 0.0, 0.5]\n"
    alone = parse_experiment(HEAD + text, "mine.toml")
    assert alone.environment.light == (1.0, 0.0, 0.5)
    both = text + "[arena]\nlight = [1.0, 0.0, 0.5]\n"
    found = read_arena_settings(
        arena_settings(parse_experiment(HEAD + both, "mine.toml"), Origin())
    )
    assert found.light == (1.0, 0.0, 0.5)
    here = parse_experiment(HEAD + text + "[arena]\n", "mine.toml")
    assert read_arena_settings(arena_settings(here, Origin())).light == (1.0, 0.0, 0.5)
    other = text + "[arena]\nlight = [2.0, 0.0, 0.5]\n"
    assert refused(other) == (
        "mine.toml: arena.light: differs from environment.light = [1.0, 0.0, 0.5], "
        "got [2.0, 0.0, 0.5]; remove one of the two"
    )


def test_a_robot_of_an_arena_has_its_light_when_it_is_evaluated_alone() -> None:
    arena = parse_experiment(HEAD + "[arena]\nlight = [2.0, 0.0, 0.5]\n", "mine.toml")
    assert arena.environment.light is None
    settings = read_evaluation_settings(evaluation_settings(arena))
    assert settings.environment.light == (2.0, 0.0, 0.5)
    dark = parse_experiment(HEAD + "[arena]\n", "mine.toml")
    assert read_evaluation_settings(evaluation_settings(dark)).environment == FLAT


@pytest.mark.parametrize("function", ["light", "worker.tasks:light"])
def test_the_task_light_needs_a_light(function: str) -> None:
    text = f'[fitness]\nfunction = "{function}"\n'
    assert refused(text) == (
        f"mine.toml: fitness.function: '{function}' needs environment.light = "
        "[x, y, z], got none"
    )
    for table in ("environment", "arena"):
        lit = f"{text}[{table}]\nlight = [1.0, 0.0, 0.5]\n"
        assert parse_experiment(HEAD + lit, "it").fitness.function == function


def test_a_light_sensor_needs_a_light_on_each_island() -> None:
    types = [*Space().part_types, "schema.parts:LIGHT_SENSOR"]
    text = f"[space]\npart_types = {types}\n"
    problem = (
        "space.part_types: the light sensor of 'LightSensor' needs environment.light = "
        "[x, y, z], got none"
    )
    assert refused(text) == f"mine.toml: {problem}"
    lit, dark = ("environment = {light = [1.0, 0.0, 0.5]}", "arena = {}")
    islands = [f"[[islands]]\n{each}\n" for each in (lit, dark)]
    assert refused(text + "".join(islands)) == f"mine.toml: islands[1]: {problem}"
    for table in ("environment", "arena"):
        found = parse_experiment(f"{HEAD}{text}[{table}]\nlight = [1, 0, 0.5]\n", "it")
        assert list(found.space.part_types) == types


def test_pushes_are_off_line_and_begin_at_ticks() -> None:
    text = "[environment]\npush_impulse = 0.1\n"
    assert parse_experiment(HEAD + text, "it").environment.push_interval_s == 3.0
    assert refused(text + "push_interval_s = 0.3\n") == (
        "mine.toml: environment.push_interval_s: must be a whole multiple of 0.125 s, "
        "the time between brain ticks, got 0.3"
    )
    assert "must be a whole multiple" in refused(text + "push_interval_s = 0.01\n")
    message = (
        "environment.push_impulse: pushes are for off-line evaluations, not for "
        "arenas; remove it"
    )
    assert refused(text + "[arena]\n") == f"mine.toml: {message}"
    arena = parse_experiment(HEAD + "[arena]\n", "mine.toml")
    pushed = structs.replace(arena, environment=Environment(push_impulse=0.1))
    with pytest.raises(ExperimentError, match=message):
        read_arena_settings(arena_settings(pushed, Origin()))


@pytest.mark.parametrize(
    ("clock", "longest"),
    [("", 12), ("warmup_steps = 400\n", 14), ("evaluation_s = [12.0, 15.0]\n", 15)],
)
def test_there_is_a_push_in_the_longest_evaluation(clock: str, longest: int) -> None:
    text = f"[simulation]\n{clock}[environment]\npush_impulse = 0.1\npush_interval_s = "
    parse_experiment(f"{HEAD}{text}{longest - 0.125}\n", "it")
    assert refused(f"{text}{longest}.0\n") == (
        f"mine.toml: environment.push_interval_s: must be < {longest} s, the longest "
        f"evaluation, or there is no push, got {longest}"
    )


def test_gravity_pulls_downhill() -> None:
    """At 30 degrees: g / 2 along the slope, and g cos(30 degrees) into the ground."""
    x, y, z = gravity_vector(Environment(slope_deg=30.0), 10.0)
    assert x == pytest.approx(-5.0)
    assert y == 0.0
    assert z == pytest.approx(-10.0 * math.sqrt(0.75))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("slope_deg = 45.0", "slope_deg: must be a number < 45.0, got 45.0"),
        ("slope_deg = -1.0", "slope_deg: must be a number >= 0.0, got -1.0"),
        ("roughness_m = -0.1", "roughness_m: must be a number >= 0.0, got -0.1"),
        ("ground_seed = -1", "ground_seed: must be a whole number >= 0, got -1"),
        ("rougness_m = 0.1", "no such key; did you mean 'roughness_m'?"),
        ("roughness_m = 0.1\npatch_m = 0.3", "multiple of environment.patch_m = 0.3"),
        ("roughness_m = 0.1\npatch_m = 9.0", "multiple of environment.patch_m = 9,"),
        ("roughness_m = 0.1\npatch_m = 0.01", "patch_m: must be >= 2 environment"),
        ('scenery = "none.xml"', "environment.scenery: none.xml: cannot be read: "),
        ("scenery = 3", "environment.scenery: must be a text, got 3"),
        (
            'scenery = "<mujoco>"',
            "environment.scenery: not valid XML: no element found",
        ),
    ],
)
def test_wrong_environments_are_refused(text: str, error: str) -> None:
    line = refused(f"[environment]\n{text}")
    assert line.startswith("mine.toml: environment.")
    assert error in line


@pytest.mark.parametrize("text", ["", " \n\t", "\ufeff"])
def test_empty_scenery_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "empty.xml").write_text(text, encoding="utf-8")
    document = 'name = "a"\n[environment]\nscenery = "empty.xml"\n'
    with pytest.raises(ExperimentError, match=r"scenery: empty\.xml: is empty$"):
        parse_experiment(document, str(tmp_path / "a.toml"))


def test_scenery_file_is_read_relative_to_the_document_and_stored(
    tmp_path: Path,
) -> None:
    """On any island; the stored experiment does not need the file."""
    (tmp_path / "worlds").mkdir()
    (tmp_path / "worlds" / "wall.xml").write_text(WALL, encoding="utf-8-sig")
    text = (
        'births = 60\nname = "two"\n[environment]\nslope_deg = 5.0\n'
        "[[islands]]\n[[islands]]\n[islands.environment]\n"
        'scenery = "worlds/wall.xml"\n[islands.arena]\n'
    )
    (tmp_path / "mine.toml").write_text(text)
    experiment = read_experiment(str(tmp_path / "mine.toml"))
    here, there = (island_experiment(experiment, number) for number in (0, 1))
    assert here.environment == Environment(slope_deg=5.0)
    assert there.environment == Environment(slope_deg=5.0, scenery=WALL)
    (tmp_path / "worlds" / "wall.xml").unlink()
    assert experiment_from_text(experiment_text(experiment)) == experiment
    alone = read_evaluation_settings(evaluation_settings(here))
    assert alone.environment == here.environment
    together = read_arena_settings(arena_settings(there, Origin()))
    assert together.environment == there.environment


def test_rough_ground_has_the_given_height_and_descends_to_the_plane() -> None:
    environment = Environment(roughness_m=0.1, patch_m=0.1, extent_m=1.0)
    shares = relief(environment)
    assert shares.shape == (21, 21)
    assert (shares.min(), shares.max()) == (0.0, 1.0)
    for rim in (shares[0], shares[-1], shares[:, 0], shares[:, -1]):
        assert not rim.any()
    # One node from the rim at most half as high: 0.1 m of the 0.2 m that it takes.
    assert 0.0 < shares[1, 1:-1].max() <= 0.6
    assert (shares[2:-2, 2:-2] > 0.0).all()


def test_rough_ground_depends_on_the_ground_seed_only() -> None:
    one = Environment(roughness_m=0.1, ground_seed=1)
    again = Environment(roughness_m=0.1, ground_seed=1, slope_deg=3.0)
    other = Environment(roughness_m=0.1, ground_seed=2)
    assert relief(one).tobytes() == relief(again).tobytes()
    assert np.abs(relief(one) - relief(other)).max() > 0.5
    # Written down: any machine draws the same.
    assert relief(one)[50, 50:52].tolist() == [0.7018105387687683, 0.8332703709602356]


@pytest.mark.parametrize("name", ["surfacevel", "adhesion", "fluidshape", "fluidcoef"])
def test_attribute_without_effect_is_refused(name: str, tmp_path: Path) -> None:
    """A conveyor belt of MuJoCo 4 would stand still here."""
    scenery = f"<mujoco><worldbody><geom size='1' {name}='1'/></worldbody></mujoco>"
    text = f'name = "x"\n[environment]\nscenery = "{scenery}"\n'
    message = f"<geom {name}=...> is not allowed: it has no effect"
    place = r"x\.toml: environment\.scenery"
    with pytest.raises(ExperimentError, match=f"{place}: {message}"):
        parse_experiment(text, str(tmp_path / "x.toml"))
    (tmp_path / "belt.xml").write_text(scenery)
    beside = 'name = "x"\n[environment]\nscenery = "belt.xml"\n'
    with pytest.raises(ExperimentError, match=rf"{place}: belt\.xml: {message}"):
        parse_experiment(beside, str(tmp_path / "x.toml"))


@pytest.mark.parametrize(
    "attribute",
    ['size="1e300 1 1"', "pos='0 -1.1e6 1'", 'fromto = "0 0 0 0 0 2e6"'],
)
def test_scenery_beyond_the_greatest_length_is_refused(attribute: str) -> None:
    def document(attribute: str) -> str:
        default = '<default><geom size="1 1 1"/></default>'
        inside = f"<worldbody><geom {attribute}/></worldbody>"
        scenery = f"<mujoco>{default}{inside}</mujoco>"
        return f"name = 'x'\n[environment]\nscenery = '''{scenery}'''\n"

    message = f"x.toml: environment.scenery: {attribute}: lengths must be <= 1e+06 m"
    with pytest.raises(ExperimentError, match=re.escape(message)):
        parse_experiment(document(attribute), "x.toml")
    parse_experiment(document('size="1e6 1 1"'), "x.toml")


def test_document_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(HEAD)
    plain = read_experiment(str(path))
    path.write_text(HEAD, encoding="utf-8-sig")
    assert read_experiment(str(path)) == plain
