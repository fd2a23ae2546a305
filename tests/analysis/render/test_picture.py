"""Tests of rendered pictures and their files."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from msgspec.structs import replace
from PIL import Image

from analysis.render.command import render
from analysis.render.files import NoPictures, gait_strip, save_film, save_picture
from analysis.render.film import RobotFilm
from analysis.render.flags import parser
from analysis.render.framing import framed
from analysis.render.picture import RobotRenderer
from analysis.render.ray_caster import RayCaster
from schema.experiment.environment import Environment
from schema.formats.files import settings_of, write_robot
from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.robot import Part, Robot

SIZE = (160, 120)
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
ROBOT = Robot(
    (
        Part("Core", -1, -1, -1, 0, RED),
        Part("FixedBrick", 0, 2, 0, 0, BLUE),
        Part("FixedBrick", 1, 1, 0, 0, BLUE),
    ),
    Brain(tuple(Neuron("input", INPUT, 0) for _ in range(6))),
)


@pytest.fixture(params=["gl", "rays"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Choose what renders; tests/conftest.py has loaded the graphics library."""
    name = str(request.param)
    if name == "rays":
        monkeypatch.setenv("MUJOCO_GL", "disable")
        return name
    with RobotRenderer(ROBOT, settings_of(None), size=(16, 16)) as made:
        if isinstance(made.stage._renderer, RayCaster):
            pytest.skip("no EGL or OSMesa that works")
    return name


@pytest.fixture
def renderer(engine: str) -> Iterator[RobotRenderer]:
    with RobotRenderer(ROBOT, settings_of(None), size=(160, 120)) as made:
        assert isinstance(made.stage._renderer, RayCaster) == (engine == "rays")
        yield made


def mostly(picture: np.ndarray, channel: int) -> np.ndarray:
    """Return the pixels (row, column) in which one channel is twice any other."""
    others = np.delete(picture.astype(int), channel, axis=2).max(axis=2)
    return np.argwhere(picture[..., channel].astype(int) > 2 * others + 20)


def test_parts_are_rendered_at_their_places_in_their_colours(
    renderer: RobotRenderer,
) -> None:
    picture = renderer.picture()
    assert picture.shape == (120, 160, 3)
    red, blue = mostly(picture, 0), mostly(picture, 2)
    assert len(red) > 100
    assert len(blue) > 40
    # Bricks at +x; the camera looks along (-0.64, 0.77), so +x is to its right, and
    # nearer to it, which is lower.
    assert blue.mean(axis=0)[1] > red.mean(axis=0)[1]
    # The robot is in the middle: floor all around.
    seen = np.vstack([red, blue])
    assert seen.min(axis=0).min() > 2
    assert (seen.max(axis=0) < (117, 157)).all()


def test_objects_and_the_light_are_rendered_and_do_not_move_the_camera(
    renderer: RobotRenderer,
) -> None:
    """A green box that moves freely far away, and the light close by."""
    box = '<geom type="box" size=".1 .1 .1" rgba="0 1 0 1"/>'
    body = f'<body pos="5 0 0.1"><freejoint/>{box}</body>'
    environment = Environment(
        light=(-0.15, 0.0, 0.05),
        scenery=f"<mujoco><worldbody>{body}</worldbody></mujoco>",
    )
    settings = replace(settings_of(None), environment=environment)
    with RobotRenderer(ROBOT, settings, size=(160, 120)) as wild:
        pose = np.array([0, 0, 0.0225, 1, 0, 0, 0, 5, 0, 0.1, 1, 0, 0, 0], float)
        assert pose.shape == (wild.model.nq,)
        far = wild.picture(pose)
        pose[7:9] = 0.15, 0.15
        near = wild.picture(pose)
    plain = renderer.picture(pose[:7])
    assert len(mostly(far, 1)) == 0
    assert len(mostly(near, 1)) > 40
    red, moved = mostly(plain, 0), mostly(far, 0)
    assert moved.mean(axis=0) == pytest.approx(red.mean(axis=0), abs=3.0)
    # Yellow: red and green, no blue.
    yellow = [
        ((image[..., :2] > 120).all(axis=2) & (image[..., 2] < 90)).sum()
        for image in (plain, far)
    ]
    assert yellow[0] == 0
    assert yellow[1] > 20


def test_a_pose_moves_the_robot_before_a_fixed_camera(renderer: RobotRenderer) -> None:
    pose = np.array([0.0, 0.0, 0.0225, 1.0, 0.0, 0.0, 0.0])
    there = pose.copy()
    there[0] += 0.05
    frame = np.array([0.05, 0.0, 0.02]), 1.0
    one = mostly(renderer.picture(pose, frame), 0).mean(axis=0)
    other = mostly(renderer.picture(there, frame), 0).mean(axis=0)
    assert other[1] > one[1] + 5
    follows = [mostly(renderer.picture(at), 0).mean(axis=0) for at in (pose, there)]
    assert follows[0] == pytest.approx(follows[1], abs=1.5)


def test_a_strip_has_rows_of_five_pictures_with_their_times_below() -> None:
    pictures = [np.full((20, 80, 3), 10 * number, np.uint8) for number in range(7)]
    strip = gait_strip(pictures, ["1.25 s", "1.50 s", "1.25 s", *map(str, range(4))])
    assert strip.shape == (2 * 35, 5 * 80, 3)
    assert strip[0, ::80, 0].tolist() == [0, 10, 20, 30, 40]
    assert strip[35, ::80, 0].tolist() == [50, 60, 255, 255, 255]
    first, other, again, *_ = np.split(strip[20:35], 5, axis=1)
    assert (first < 100).any()
    assert (first != other).any()
    assert (first == again).all()


def test_files_open_again(tmp_path: Path) -> None:
    pictures = [np.full((4, 6, 3), 120 * number, np.uint8) for number in range(3)]
    save_picture(pictures[1], tmp_path / "one.png")
    assert np.array_equal(np.array(Image.open(tmp_path / "one.png")), pictures[1])
    save_film(pictures, tmp_path / "film.gif", 0.12)
    with Image.open(tmp_path / "film.gif") as film:
        assert getattr(film, "n_frames", 0) == 3
        assert film.info["duration"] == 120
    with pytest.raises(NoPictures, match="cannot be written"):
        save_picture(pictures[0], tmp_path / "no" / "one.png")


@pytest.mark.parametrize("ending", [".mp4", ".webm"])
def test_a_video_has_all_pictures_at_their_rate(tmp_path: Path, ending: str) -> None:
    av = pytest.importorskip("av")
    pictures = [np.full((33, 48, 3), 10 * number, np.uint8) for number in range(20)]
    path = tmp_path / f"film{ending}"
    save_film(pictures, path, 0.04)
    with av.open(str(path)) as film:
        (stream,) = film.streams
        frames = [one.to_ndarray(format="rgb24") for one in film.decode(video=0)]
        assert stream.average_rate == 25
    assert len(frames) == 20
    # Their colours are stored for squares of four pixels.
    assert frames[0].shape == (32, 48, 3)
    assert [one.mean() for one in frames] == pytest.approx(
        [10 * number for number in range(20)], abs=4
    )


def simulate(*_: object, **__: object) -> NoReturn:
    """Fail: flags are checked before the simulation."""
    raise AssertionError("words come first")


def main(words: list[str]) -> int:
    """Run ``revolve robot render``."""
    return render(parser().parse_args(words[1:]), simulate)


@pytest.fixture
def robot_file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    write_robot(ROBOT, path)
    return path


def test_a_strip_is_a_picture_and_not_longer_than_the_evaluation(
    robot_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = robot_file.with_suffix(".png")
    words = ["robot render", str(robot_file), str(out)]
    message = r"--gait 49: must be <= 48, the number of ticks in the second half"
    with pytest.raises(NoPictures, match=message):
        main([*words, "--gait", "49"])
    # One less is what there is, and goes on to the simulation.
    with pytest.raises(AssertionError, match="words come first"):
        main([*words, "--gait", "48"])
    assert capsys.readouterr().err.endswith(f"\nrendering {out}\n")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("a.yaml a.jpg", r"a.jpg: must end in one of .png, .gif, .mp4, .webm, got"),
        ("a.yaml a.gif --gait 5", r"a.gif: --gait needs a \.png"),
        ("a.yaml b.yaml a.png --gait 5", "--gait: shows one robot, got several"),
        ("a.yaml a.mp4 --background transparent", "--background transparent needs a"),
        ("a.yaml a.png --trail", "a.png: --trail needs a film: .gif, .mp4, .webm"),
        ("a.yaml a.png --seconds 2", "a.png: --seconds needs a film"),
    ],
)
def test_flags_without_a_meaning_are_refused(words: str, why: str) -> None:
    with pytest.raises(NoPictures, match=why):
        main(["robot render", *words.split()])


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("--size 8", "must be a whole number in 16..4096, got '8'"),
        ("--size 200x", "must be a whole number in 16..4096, got ''"),
        ("--background pink", "one of white, black, grey, #RRGGBB, transparent, got"),
        ("--fps 51", "must be a whole number in 1..50, got '51'"),
    ],
)
def test_values_of_flags_are_refused(
    words: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["a.yaml", "a.png", *words.split()])
    assert why in capsys.readouterr().err


def test_a_picture_shows_the_whole_of_a_long_robot(engine: str) -> None:
    assert engine
    bricks = [Part("FixedBrick", n, 1, 0, 0, BLUE) for n in range(1, 10)]
    parts = (*ROBOT.parts[:1], Part("FixedBrick", 0, 0, 0, 0, BLUE), *bricks)
    with RobotRenderer(Robot(parts, ROBOT.brain), settings_of(None), size=SIZE) as made:
        found = mostly(made.picture(), 2)
    assert (found > 0).all()
    assert (found < (119, 159)).all()
    # It fills the picture.
    assert (np.ptp(found, axis=0) > np.array([120, 160]) * 0.7).any()


def test_a_transparent_picture_looks_as_one_on_its_page(engine: str) -> None:
    """Blue on grey as drawn there; shadows darken any page."""
    assert engine
    grey = (0.5, 0.5, 0.5)
    shown = {"one": (ROBOT, settings_of(None))}
    start = np.array([0.0, 0.0, 0.0225, 1.0, 0.0, 0.0, 0.0])
    pictures = []
    for background in ("transparent", grey):
        options = parser().parse_args(["a.yaml", "a.png"])
        options.size, options.background = SIZE, background
        with RobotFilm(shown, [start], options) as film:
            pictures.append(film[0].astype(float))
    clear, drawn = pictures
    opaque = clear[..., 3:] / 255.0
    assert opaque[0, 0, 0] == 0.0
    assert opaque[60, 80, 0] == 1.0
    put = clear[..., :3] * opaque + 127.5 * (1.0 - opaque)
    assert np.abs(put - drawn).mean() < 1.5


NO_LIBRARY = "import ctypes.util; ctypes.util.find_library = lambda name: None"
"""A new process would load MuJoCo with EGL if it could."""
SCRIPT = """
from analysis.render.picture import RobotRenderer
from analysis.render.stage import choose_engine
choose_engine()
from tests.analysis.render.test_picture import ROBOT, settings_of
for _ in range(2):
    with RobotRenderer(ROBOT, settings_of(None), size=(40, 30)) as renderer:
        print(renderer.picture().shape)
"""


@pytest.mark.parametrize(
    ("chosen", "before", "said"),
    [("", NO_LIBRARY, "no EGL or OSMesa here"), ("bogus", "", "MUJOCO_GL is disable")],
)
def test_a_machine_without_graphics_gets_pictures_and_one_line(
    monkeypatch: pytest.MonkeyPatch, chosen: str, before: str, said: str
) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    if chosen:
        monkeypatch.setenv("MUJOCO_GL", chosen)
    command = [sys.executable, "-c", before + SCRIPT]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "(30, 40, 3)\n" * 2, done.stderr
    *_, line = done.stderr.splitlines()
    assert len(done.stderr.splitlines()) == (2 if chosen else 1)
    assert line == f"robots are drawn without OpenGL: {said}"


@pytest.mark.parametrize("engine", ["gl"], indirect=True)
def test_both_engines_draw_the_same_robot(
    renderer: RobotRenderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parts cover the same pixels, but for their edges."""
    monkeypatch.setenv("MUJOCO_GL", "disable")
    with RobotRenderer(ROBOT, settings_of(None), size=(160, 120)) as other:
        pictures = [renderer.picture(), other.picture()]
    for channel in (0, 2):
        first, second = ({*map(tuple, mostly(one, channel))} for one in pictures)
        assert len(first ^ second) < 0.15 * len(first)


def test_a_shadow_falls_away_from_the_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """From 1 m it falls 0.5 m to the camera's right and 0.35 m ahead of it.

    The camera looks along (cos 130, sin 130) degrees.
    """
    monkeypatch.setenv("MUJOCO_GL", "disable")
    core = Robot(ROBOT.parts[:1], ROBOT.brain)
    low, high = (np.array([0, 0, z, 1, 0, 0, 0]) for z in (0.0225, 1.0))
    with RobotRenderer(core, settings_of(None), size=SIZE) as made:
        spot = 0.5 * np.array([0.766, 0.643, 0]) + 0.35 * np.array([-0.643, 0.766, 0])
        bright, dark = (made.picture(pose, (spot, 1.0))[60, 80] for pose in (low, high))
    assert (dark < 0.8 * bright).all()


def test_framing_shows_the_whole_shadow_of_a_robot_in_the_air(
    renderer: RobotRenderer,
) -> None:
    pose = np.array([0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
    picture = renderer.picture(pose)
    is_grey = np.ptp(picture.astype(int), axis=2) < 30
    dark = np.argwhere(is_grey & (picture.max(axis=2) < 160))
    assert len(dark) > 50
    assert (dark > 0).all()
    assert (dark < (119, 159)).all()


def test_the_nearest_points_touch_the_rim_at_both_sides() -> None:
    """Seen along +x, at 45 degrees; the rim is 12 % of a picture's width.

    Of points at y = -2 and 2, 1 before and behind the middle, the first is at
    2 - s from the view, the other at 2 + s, so that both touch: (2 - s) / (d - 1) =
    (2 + s) / (d + 1) = 0.88, so d = 2 / 0.88 and s = 0.88.
    """
    points = np.array([[9.0, -2.0, 0.0], [11.0, 2.0, 0.0]])
    point, distance = framed(points, 0.0, 0.0, (1.0, 1.0))
    assert point == pytest.approx([10, -0.88, 0], abs=0.02)
    assert distance == pytest.approx(2 / 0.88, abs=0.02)


def test_texts_of_any_length_leave_room_for_themselves() -> None:
    picture = np.zeros((30, 160, 3), np.uint8)
    short, long = (gait_strip([picture], [text]) for text in ("1.0 s", "energy " * 5))
    assert short.shape == long.shape
    for strip in (short, long):
        columns = np.flatnonzero((strip[30:] < 128).any(axis=(0, 2)))
        assert 0 < columns.min() < columns.max() < 159
