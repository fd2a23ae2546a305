"""Robot files: round trips, and errors in one line."""

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject
from msgspec.structs import replace

from schema.errors import InvalidRobot, MalformedMessage, RevolveError
from schema.formats.files import read_robot, robot_from_yaml, write_robot
from schema.formats.yaml import robot_to_yaml
from schema.parts import BUILT_IN
from schema.robot.brain import INPUT, Brain, Connection, Neuron
from schema.robot.genome import develop
from schema.robot.robot import Part, Robot, check_robot
from schema.wire.protobuf import encode_robot
from tests.schema.robots import node, random_robots

TEXT = """\
body:
  id: trunk
  type: Core
  gene: 3
  children:
    2:
      slot: 0
      id: leg
      type: ActiveHinge
      orientation: 90
      params: {red: 1}
      children:
        1:
          slot: 0
          type: ParametricBarJoint
          params: {connection_length: 20.5, alpha: 1e-3}
    0: {slot: 0, type: TouchSensor}
brain:
  neurons:
  - {part: trunk, layer: hidden, type: Simple, params: {bias: -1.0e-5}}
  - {id: out, part: leg, layer: output, type: Oscillator}
  connections:
  - {source: trunk-in-2, target: out, weight: 0.25}
  - {source: part-1-in-1, target: trunk-hidden-0, weight: .5}
"""


def read(text: str) -> Robot:
    return robot_from_yaml(text, "mine.yaml", BUILT_IN)


@given(robot=random_robots())
def test_yaml_round_trip(robot: Robot) -> None:
    text = robot_to_yaml(robot, BUILT_IN)
    again = read(text)
    # A repr tells -0.0 from 0.0 and every bit of a float.
    assert repr(again) == repr(robot)
    assert robot_to_yaml(again, BUILT_IN) == text


def test_defaults_of_omitted_keys() -> None:
    robot = read(TEXT)
    check_robot(robot, BUILT_IN)
    assert [part.kind for part in robot.parts] == [
        "Core",
        "TouchSensor",
        "ActiveHinge",
        "ParametricBarJoint",
    ]
    core, touch, hinge, bar = robot.parts
    assert (core.gene, touch.gene) == (3, 0)
    assert (touch.parent, touch.parent_slot, touch.slot) == (0, 0, 0)
    assert (hinge.parent_slot, hinge.orientation) == (2, 90)
    assert hinge.parameters == (1.0, 0.5, 0.5)
    assert bar.parameters == (20.5, 0.001, 0.0, 0.5, 0.5, 0.5)
    assert robot.brain.neurons[6:] == (
        Neuron("input", "Input", 1),
        Neuron("input", "Input", 1),
        Neuron("output", "Oscillator", 2, (5.0, 0.0, 1.0)),
        Neuron("hidden", "Simple", 0, (-1e-5, 0.5)),
    )
    assert robot.brain.connections == (Connection(2, 8, 0.25), Connection(7, 9, 0.5))


def test_body_without_a_brain() -> None:
    assert len(read("body: {type: Core}").brain.neurons) == 6


def test_a_part_is_attached_by_its_slot_0_unless_it_names_another() -> None:
    assert read(TEXT.replace("slot: 0, type: T", "type: T", 1)) == read(TEXT)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("type: ActiveHinge", "type: ActivHinge", 9, "'leg': type: .*mean 'Active"),
        ("orientation", "orientaton", 10, "no such key; did you mean 'orientation'"),
        ("red: 1", "redd: 1", 11, r"params.redd: no such key.*'red'\?; allowed: red,"),
        ("red: 1", "red: 2", 11, r"red: must be in \[0.0, 1.0\], got 2"),
        ("red: 1", "red: blue", 11, "params.red: must be a finite number, got 'blue'"),
        ("red: 1", "red: .nan", 11, "params.red: must be a finite number"),
        ("red: 1", "red: 1e999", 11, "params.red: must be a finite number"),
        ("red: 1", "red: [1]", 11, "params.red: must be a word, got a list"),
        ("{red: 1}", "7", 11, "params: must be a mapping, got '7'"),
        ("orientation: 90", "orientation: 91", 10, "orientation: must be one of"),
        ("orientation: 90", "orientation: x", 10, "must be a whole number, got 'x'"),
        ("    2:", "    4:", 7, "'leg': parent_slot: Core has slots 0..3, got 4"),
        ("    2:", "    0:", 17, "key '0' is given twice"),
        ("    2:", "    two:", 6, "must be a slot number"),
        ("    2:", "    007:", 6, "must be a slot number"),
        ("    2:", "    -1:", 6, "must be a slot number"),
        ("    2:", "    [1, 2]:", 6, "a key must be a word or a number"),
        ("      slot: 0\n", "      slot: 5\n", 7, "slot: ActiveHinge has slots 0..1"),
        ("id: leg", "id: trunk", 8, "id: duplicate part name 'trunk'"),
        ("id: leg", "id:", 8, "id: must be a word, got nothing"),
        ("gene: 3", "gene: -3", 4, "gene: must be"),
        ("gene: 3", "slot: 3", 4, "slot: no such key"),
        ("gene: 3", "type: Core", 4, "key 'type' is given twice"),
        ("type: TouchSensor", "type: Core", 17, "exactly the first part"),
        ("part: leg", "part: lag", 21, "part: must be one of trunk, .*mean 'leg'"),
        ("layer: output", "layer: input", 21, "must be one of output, hidden"),
        ("Oscillator", "Oscilator", 21, "'out': type: .*did you mean 'Oscillator'"),
        ("id: out", "id: trunk-in-0", 21, "duplicate neuron name 'trunk-in-0'"),
        ("bias", "period", 20, "period: no such key.*; allowed: bias, gain"),
        ("target: out", "target: trunk-in-1", 23, "target: must not be an input"),
        ("target: out", "target: oat", 23, "target: must be one of .*mean 'out'"),
        (", weight: .5", "", 24, r"connections\[1\].weight: is missing"),
        ("  neurons:", "  nurons:", 19, "brain.nurons: .*'neurons'"),
        ("- {id: out, part", "- {id: out; part", 21, "not valid YAML: "),
        ("brain:\n", "brian:\n", 18, "brian: no such key; did you mean 'brain'"),
        ("body:\n", "revolve_robot: 2\nbody:\n", 1, "must be 1, got 2"),
    ],
)
def test_errors_name_file_line_and_field(
    old: str, new: str, line: int, message: str
) -> None:
    assert old in TEXT
    expected = rf"^mine\.yaml:{line}: .*{message}"
    with pytest.raises(InvalidRobot, match=expected) as error:
        read(TEXT.replace(old, new, 1))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "# nothing",
        "3",
        "[]",
        "body:",
        "body: 1",
        "body: {type: Core}\nbrain: []",
        "body: {type: Core}\nbrain: {neurons: 3}",
        "body: {type: Core}\nbrain: {neurons: [1]}",
        "body: {type: Core}\n---\nbody: {type: Core}",
        "body: &a {type: Core, children: {0: *a}}",
        "body: !!python/object:os.system {type: Core}\nx: 1",
        "body: \x00",
        "body: {type: Core",
        "\tbody: x",
        "body: " + "[" * 3000,
        "body: " + "{a: " * 3000,
        "a: " * 20,
        "{? [a]: b}",
    ],
)
def test_other_documents_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(InvalidRobot, match=r"^mine\.yaml:?") as error:
        read(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (r'{"a\nb": 1}', "mine.yaml:2: body.a b: no such key"),
        (r'{"\e[2Jid": 1}', "mine.yaml:2: body.?[2Jid: no such key"),
        (r'{"i\u202ed": 1}', "mine.yaml:2: body.i?d: no such key"),
        (
            r"""{type: Core, id: "a\nb"}
brain: {neurons: [{part: c, layer: output, type: Simple}]}""",
            "mine.yaml:3: brain.neurons[0].part: must be one of a b, got 'c'",
        ),
    ],
)
def test_names_of_a_file_cannot_break_the_line_of_an_error(
    inside: str, message: str
) -> None:
    with pytest.raises(InvalidRobot) as caught:
        read(f"revolve_robot: 1\nbody: {inside}")
    assert str(caught.value).startswith(message)
    assert str(caught.value).isprintable()


@given(data=st.data())
def test_any_damage_leaves_a_robot_or_is_refused(data: DataObject) -> None:
    place = data.draw(st.integers(0, len(TEXT) - 1))
    patch = data.draw(st.text(st.characters(max_codepoint=127), max_size=3))
    damaged = TEXT[:place] + patch + TEXT[place + 1 :]
    try:
        robot = read(damaged)
    except InvalidRobot:
        return
    check_robot(robot, BUILT_IN)


@pytest.mark.parametrize("ending", [".yaml", ".yml", ".pb", ".YAML", ".xml"])
def test_file_round_trip(tmp_path: Path, ending: str) -> None:
    robot, path = read(TEXT), tmp_path / f"robot{ending}"
    write_robot(robot, path)
    assert read_robot(path) == robot
    is_text = path.read_bytes().startswith(b"revolve_robot: 1\n")
    assert is_text == (ending not in {".pb", ".xml"})


@pytest.mark.parametrize("name", ["robot", "robot.toml", "robot.pb.gz"])
def test_another_ending_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(InvalidRobot, match=r"must end in one of \.yaml, \.yml, \.pb"):
        write_robot(read(TEXT), path)
    assert not path.exists()
    with pytest.raises(InvalidRobot, match="must end in one of"):
        read_robot(path)


def test_files_that_cannot_be_read_or_written(tmp_path: Path) -> None:
    for name in ("none.pb", "none.xml"):
        with pytest.raises(InvalidRobot, match=rf"{name}: cannot be read: No such"):
            read_robot(tmp_path / name)
    path = tmp_path / "folder.yaml"
    path.mkdir()
    with pytest.raises(InvalidRobot, match="cannot be written: Is a directory"):
        write_robot(read(TEXT), path)
    (path / "best.yaml").write_text(TEXT)
    for folder in (path, tmp_path):
        with pytest.raises(InvalidRobot, match=r"a folder; the best .*/best\.yaml$"):
            read_robot(folder)


@pytest.mark.parametrize("ending", [".yaml", ".pb", ".xml", ".urdf"])
def test_a_full_disk_leaves_the_old_file(
    tmp_path: Path,
    full_beyond: Callable[[int], AbstractContextManager[None]],
    ending: str,
) -> None:
    robot, path = read(TEXT), tmp_path / f"robot{ending}"
    write_robot(robot, path)
    old = path.read_bytes()
    with (
        full_beyond(len(old) // 2),
        pytest.raises(InvalidRobot, match="cannot be written: File too large"),
    ):
        write_robot(robot, path)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_a_robot_is_written_where_a_link_leads(tmp_path: Path) -> None:
    link, path = tmp_path / "link.yaml", tmp_path / "robot.yaml"
    link.symlink_to(path)
    write_robot(read(TEXT), link)
    assert link.is_symlink()
    assert read_robot(path) == read(TEXT)


def test_a_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "robot.yaml"
    os.mkfifo(pipe)
    read_end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_robot(read(TEXT), pipe)
    written = os.read(read_end, 100_000).decode()
    os.close(read_end)
    assert read(written) == read(TEXT)
    assert pipe.is_fifo()


def test_damaged_protobuf_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.pb"
    path.write_bytes(encode_robot(read(TEXT))[:-3])
    with pytest.raises(MalformedMessage, match=r"robot\.pb: not the bytes of a Robot"):
        read_robot(path)
    for ending in ("yaml", "xml"):
        path = tmp_path / f"robot.{ending}"
        path.write_bytes(b"body: \xff")
        with pytest.raises(InvalidRobot, match=r"cannot be read: not UTF-8 at byte 6"):
            read_robot(path)


def test_malformed_robot_is_not_written(tmp_path: Path) -> None:
    robot = develop(node("Core"), BUILT_IN)
    broken = replace(robot, brain=replace(robot.brain, neurons=()))
    for ending in (".yaml", ".pb"):
        path = tmp_path / f"robot{ending}"
        with pytest.raises(RevolveError, match="input neurons must belong"):
            write_robot(broken, path)
        assert not path.exists()


def test_deeply_nested_robot_is_written_as_protobuf_only(
    tmp_path: Path, chain: Robot
) -> None:
    """Writing YAML recurses for each level; reading it allows 400 levels."""
    with pytest.raises(InvalidRobot, match=r"it\.yaml: nested too deeply .*\.pb"):
        write_robot(chain, tmp_path / "it.yaml")
    assert list(tmp_path.iterdir()) == []
    write_robot(chain, tmp_path / "it.pb")
    assert read_robot(tmp_path / "it.pb") == chain


def row(kind: str, count: int) -> Robot:
    """Return a core and parts without neurons, each on the last."""
    grey = (0.5, 0.5, 0.5)
    parts = [Part("Core", -1, -1, -1, 0, grey), Part(kind, 0, 2, 0, 0, grey)]
    parts += [Part(kind, index, 1, 0, 0, grey) for index in range(1, count)]
    return Robot(
        tuple(parts), Brain(tuple(Neuron("input", INPUT, 0) for _ in "xyzrpy"))
    )


@pytest.mark.parametrize("count", [397, 999])
def test_robot_of_too_many_bodies_is_not_written_as_mjcf(
    count: int, tmp_path: Path
) -> None:
    """MuJoCo nests their bodies; reading allows 400 levels, three above the first."""
    with pytest.raises(InvalidRobot, match=r"it\.xml: MJCF must have <= .*\.pb"):
        write_robot(row("Hinge", count), tmp_path / "it.xml")
    assert list(tmp_path.iterdir()) == []


def test_longest_robot_of_mjcf_is_read_again(tmp_path: Path) -> None:
    write_robot(row("Hinge", 396), tmp_path / "it.xml")
    assert read_robot(tmp_path / "it.xml") == row("Hinge", 396)


def test_robot_beyond_the_limits_of_reading_is_not_written(tmp_path: Path) -> None:
    small = row("FixedBrick", 10)
    hidden = [Neuron("hidden", "Simple", part, (0.0, 0.5)) for part in range(11)] * 20
    neurons = (*small.brain.neurons, *sorted(hidden, key=lambda each: each.part))
    edges = tuple(
        Connection(source, target, 1 / 3)
        for source in range(100)
        for target in range(6, 226)
    )
    large = Robot(small.parts, Brain(neurons, edges))
    with pytest.raises(InvalidRobot, match=r"it\.yaml: too large for YAML: .*\.pb"):
        write_robot(large, tmp_path / "it.yaml")
    for ending in ("pb", "xml"):
        with pytest.raises(InvalidRobot, match=rf"it\.{ending}: body: .* <= 1000"):
            write_robot(row("FixedBrick", 1000), tmp_path / f"it.{ending}")
    assert list(tmp_path.iterdir()) == []
    write_robot(large, tmp_path / "it.pb")
    assert read_robot(tmp_path / "it.pb") == large
