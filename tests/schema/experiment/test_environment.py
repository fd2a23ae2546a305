"""Ground and scenery in experiment documents."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.experiment.document import Space, island_experiment
from schema.experiment.environment import FLAT, Environment, gravity_vector, relief
from schema.experiment.file import experiment_from_text, experiment_text
from schema.experiment.identity import Origin
from schema.experiment.settings import (
    arena_settings,
    evaluation_settings_of,
    read_arena_settings,
)
from tests.documents import check_refused, parse, parse_experiment

WALL = '<mujoco><worldbody><geom type="box" size="1 1 1"/></worldbody></mujoco>'


def test_ground_is_flat_by_default() -> None:
    assert parse("").environment == FLAT
    assert FLAT.is_even
    # Not -0.0: it would change the sign of zeros in what robots feel.
    assert repr(gravity_vector(FLAT, 9.81)) == "(0.0, 0.0, -9.81)"


def test_light_is_a_place_of_the_world_off_line_and_in_arenas() -> None:
    text = "[environment]\nlight = [1.0, 0.0, 0.5]\n"
    assert parse(text).environment.light == (1.0, 0.0, 0.5)
    for arena in ("[arena]\nlight = [1.0, 0.0, 0.5]\n", "[arena]\n"):
        settings = read_arena_settings(arena_settings(parse(text + arena), Origin()))
        assert settings.light == (1.0, 0.0, 0.5)
    differs = r"light: differs from environment.light = \[1.0, 0.0, 0.5\], got \[2.0"
    check_refused(text + "[arena]\nlight = [2.0, 0.0, 0.5]\n", differs)


def test_a_robot_of_an_arena_has_its_light_when_it_is_evaluated_alone() -> None:
    arena = parse("[arena]\nlight = [2.0, 0.0, 0.5]\n")
    assert arena.environment.light is None
    settings = evaluation_settings_of(arena)
    assert settings.environment.light == (2.0, 0.0, 0.5)
    assert evaluation_settings_of(parse("[arena]\n")).environment == FLAT


@pytest.mark.parametrize("function", ["light", "worker.tasks:light"])
def test_the_task_light_needs_a_light(function: str) -> None:
    text = f'[fitness]\nfunction = "{function}"\n'
    check_refused(
        text, f"function: '{function}' needs environment.light = .*, got none"
    )
    for table in ("environment", "arena"):
        parse(f"{text}[{table}]\nlight = [1.0, 0.0, 0.5]\n")


def test_a_light_sensor_needs_a_light_on_each_island() -> None:
    types = [*Space().part_types, "schema.parts:LIGHT_SENSOR"]
    text = f"[space]\npart_types = {types}\n"
    problem = (
        "space.part_types: the light sensor of 'LightSensor' needs environment.lig"
    )
    check_refused(text, f"test.toml: {problem}")
    lit, dark = ("environment = {light = [1.0, 0.0, 0.5]}", "arena = {}")
    islands = f"[[islands]]\n{lit}\n[[islands]]\n{dark}\n"
    check_refused(text + islands, rf"islands\[1\]: {problem}")
    for table in ("environment", "arena"):
        parse(f"{text}[{table}]\nlight = [1, 0, 0.5]\n")


@pytest.mark.parametrize(
    ("clock", "longest"),
    [("", 12), ("warmup_steps = 400\n", 14), ("evaluation_s = [12.0, 15.0]\n", 15)],
)
def test_pushes_begin_at_ticks_and_before_the_end(clock: str, longest: int) -> None:
    text = f"[simulation]\n{clock}[environment]\npush_impulse = 0.1\npush_interval_s = "
    parse(f"{text}{longest - 0.125}\n")
    late = f"must be < {longest} s, the longest evaluation, .* got {longest}"
    check_refused(f"{text}{longest}.0\n", f"environment.push_interval_s: {late}")
    for interval in ("0.3", "0.01"):
        check_refused(text + interval, f"whole multiple of 0.125, .* got {interval}")


def test_gravity_pulls_downhill() -> None:
    """At 30 degrees: g / 2 along the slope, and g cos(30 degrees) into the ground."""
    x, y, z = gravity_vector(Environment(slope_deg=30.0), 10.0)
    assert x == pytest.approx(-5.0)
    assert y == 0.0
    assert z == pytest.approx(-10.0 * math.sqrt(0.75))


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
    experiment = parse_experiment(text, str(tmp_path / "mine.toml"))
    here, there = (island_experiment(experiment, number) for number in (0, 1))
    assert here.environment == Environment(slope_deg=5.0)
    assert there.environment == Environment(slope_deg=5.0, scenery=WALL)
    (tmp_path / "worlds" / "wall.xml").unlink()
    assert experiment_from_text(experiment_text(experiment)) == experiment
    assert evaluation_settings_of(here).environment == here.environment
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
    "attribute", ['size="1e300 1 1"', "pos='0 -1.1e6 1'", 'fromto = "0 0 0 0 0 2e6"']
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
