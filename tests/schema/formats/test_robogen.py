"""RoboGen's robots: poses derived from its frames, names and errors."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schema import robogen_parts
from schema.errors import InvalidRobot
from schema.formats.files import read_robot
from schema.formats.robogen_json import robot_from_robogen_json
from schema.formats.robogen_text import robot_from_robogen_text
from schema.parts import BUILT_IN, PartType
from schema.robot.brain import Connection
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot

# A starfish as RoboGen's manual describes one, with numbers of our own.
STARFISH = """\
0 CoreComponent Heart 0
\t0 ActiveHinge HipL 1
\t\t0 FixedBrick ThighL 1
\t\t\t0 ActiveHinge KneeL 0
\t1 ActiveHinge HipR 3
\t2 I HipF 0
\t\t0 F ThighF 1
\t3 PassiveHinge HipB 0
\t\t0 TouchSensor ToeB 0

Heart sigmoid
KneeL oscillator

Heart 2 HipL 0 0.5
ToeB 1 Heart 6 -1.25
Heart 6 KneeL 0 3
HipR 0 HipR 0 0.125

HipL 0 0.75
HipR 0 simple -0.5
KneeL 0 Oscillator 2 -0.25 0.9
KneeL 1 oscillator 1 0 1
"""


def read(text: str) -> Robot:
    return robot_from_robogen_text(text, "it.txt", BUILT_IN)


def axes(robot: Robot, part: int) -> tuple[list[float], list[float]]:
    """Return a part's own y and z in the frame of the core."""
    rotations, _ = place_parts(robot, shapes_of(robot, BUILT_IN))
    return rotations[part][:, 1].round(9).tolist(), rotations[part][:, 2].tolist()


def test_parts_have_the_poses_of_robogen() -> None:
    robot = read(STARFISH)
    kinds = [part.kind for part in robot.parts]
    assert kinds.count("ActiveHinge") == 4
    # Its slots are left, right, front, back: -x, +x, -y, +y.
    _, positions = place_parts(robot, shapes_of(robot, BUILT_IN))
    of_core = [index for index, part in enumerate(robot.parts) if part.parent == 0]
    ways = [np.sign(positions[index][:2].round(6)).tolist() for index in of_core]
    assert ways == [[0, -1], [0, 1], [1, 0], [-1, 0]]
    assert [kinds[index] for index in of_core] == [
        "ActiveHinge", "Hinge", "ActiveHinge", "ActiveHinge",
    ]  # fmt: skip


def test_quarter_turns_rotate_the_axis_of_a_hinge() -> None:
    robot = read(STARFISH)
    # By hand from its tangents: without a turn the axis (own y) is upright in front
    # and level at the sides; 1 and 3 quarter turns raise it at the sides.
    for index, part in enumerate(robot.parts):
        if part.kind == "ActiveHinge" and part.parent == 0:
            assert np.abs(axes(robot, index)[0]).tolist() == [0.0, 0.0, 1.0]
    knee = robot.parts.index(
        next(part for part in robot.parts if part.kind == "ActiveHinge" and part.parent)
    )
    assert abs(axes(robot, knee)[0][2]) < 1e-9
    level = read("0 E C 0\n\t0 I left 0\n\t2 I front 1\n")
    assert abs(axes(level, 1)[0][2]) < 1e-9
    assert abs(axes(level, 2)[0][2]) < 1e-9


def test_bricks_are_level_for_any_orientation() -> None:
    for turn in range(4):
        for slot in range(4):
            text = (
                f"0 E C 0\n\t{slot} I hip 1\n\t\t0 F brick {turn}\n\t\t\t1 F next 2\n"
            )
            robot = read(text)
            for part in (2, 3):
                assert axes(robot, part)[1] == pytest.approx([0, 0, 1], abs=1e-9)


def test_neurons_and_connections() -> None:
    robot = read(STARFISH)
    named = {(n.layer, n.part, n.kind): n for n in robot.brain.neurons}
    assert len(robot.brain.neurons) == 6 + 2 + 4 + 2
    parameters = sorted(n.parameters for n in robot.brain.neurons if n.parameters)
    assert parameters == [
        (-0.5, 1.0), (0.0, 1.0), (0.0, 1.0), (0.75, 1.0), (1.0, 0.0, 1.0),
        (2.0, -0.25, 0.9),
    ]  # fmt: skip
    assert ("hidden", 0, "Sigmoid") in named
    # The oscillator at the knee has no inputs.
    weights = sorted(edge.weight for edge in robot.brain.connections)
    assert weights == [-1.25, 0.125, 0.5]


NO_IMU = """\
0 CoreComponentNoIMU C 0
\t0 ActiveHinge H 0

C simple
C sigmoid

C 0 H 0 1.5
C 1 C 0 0.5

C 0 simple 0.25
"""


def test_hidden_neurons_of_a_core_without_imu_count_from_0() -> None:
    """Its six inputs have no number in the file, and no connection."""
    robot = read(NO_IMU)
    assert [neuron.layer for neuron in robot.brain.neurons[6:]] == [
        "output", "hidden", "hidden",
    ]  # fmt: skip
    assert robot.brain.neurons[7].parameters == (0.25, 1.0)
    assert robot.brain.connections == (Connection(7, 6, 1.5), Connection(8, 7, 0.5))
    with_imu = NO_IMU.replace("NoIMU", "").replace("C 1 C 0", "C 7 C 6")
    assert read(with_imu.replace("\nC 0", "\nC 6")) == robot
    assert read("0 N C 0\n\nC simple\n\nC 0 C 0 1\n") == read(
        "0 E C 0\n\nC simple\n\nC 6 C 6 1\n"
    )
    with pytest.raises(InvalidRobot, match=r"it\.txt: no neuron 2 on part 'C'"):
        read(NO_IMU.replace("C 1", "C 2"))


def test_bar_parameters_are_converted() -> None:
    robot = read("0 E C 0\n\t0 ParametricJoint bar 2 0.05 -60 0\n")
    length, alpha, beta = robot.parts[1].parameters[:3]
    assert (length, beta) == (50.0, 0.0)
    assert alpha == pytest.approx(-1.0471975512)


@pytest.mark.parametrize(
    ("length_m", "alpha_deg", "expected"),
    [
        (float(np.float32(0.1)), 0.0, (100.0, 0.0)),
        (float(np.float32(0.02)), 0.0, (20.0, 0.0)),
        (
            0.05,
            float(np.nextafter(np.float32(90), np.float32(91))),
            (50.0, math.pi / 2),
        ),
        (0.05, -90.00000763, (50.0, -math.pi / 2)),
        # Within its range, a number stays what the file has.
        (float(np.float32(0.06)), 0.0, (1000 * float(np.float32(0.06)), 0.0)),
    ],
)
def test_ranges_allow_for_single_precision(
    length_m: float, alpha_deg: float, expected: tuple[float, float]
) -> None:
    """RoboGen's longest bar has 0.1 m, which it writes as 0.10000000149011612."""
    text = f"0 E C 0\n\t0 B bar 2 {length_m!r} {alpha_deg!r} 0\n"
    written: dict[str, Any] = document()
    bar = {"type": "ParametricJoint", "orientation": 2}
    numbers = [{"paramValue": each} for each in (length_m, alpha_deg, 0.0)]
    written["body"]["part"][1] |= {**bar, "evolvableParam": numbers}
    written["brain"] = {}
    of_json = robot_from_robogen_json(json.dumps(written), "it", BUILT_IN)
    for robot in (read(text), of_json):
        assert robot.parts[1].parameters[:2] == expected


@pytest.mark.parametrize("length_m", ["0.1000001", "0.101", "0.0199999", "-0.1"])
def test_more_than_rounding_beyond_a_range_is_refused(length_m: str) -> None:
    with pytest.raises(InvalidRobot, match=r"part 'bar': connection_length: must be"):
        read(f"0 E C 0\n\t0 B bar 2 {length_m} 0 0\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it.txt:1: must be the core"),
        ("0 Core C 0", "it.txt:1: part 'C': type 'Core' is not supp"),
        ("0 E C 0\n\t0 J w 0 0.04", "it.txt:2: part 'w': type 'ActiveWheel' is"),
        ("0 E C 0\n\t0 F a", "it.txt:2: must be TABS SLOT TYPE NAME"),
        ("0 E C 0\n\t0 F a 4", "it.txt:2: part 'a': orientation must be 0..3, got 4"),
        ("0 E C 0\n\t0 B a 0 0.05", "it.txt:2: part 'a': Parametric.* takes 3"),
        ("0 E C 0\n\t0 B a 0 0.05 x 0", "it.txt:2: must be a number, got 'x'"),
        ("0 E C 0\n\t0 B a 0 0.5 0 0", r"it.txt: part 'a': .*_length: must be"),
        ("0 E C 0\n\t0 F a 0\n\t0 F b 0", "it.txt:3: part 'b': slot 0 of 'C' is taken"),
        ("0 E C 0\n\t0 F a 0\n\t\t3 F b 0", "it.txt:3: part 'b': 'a' has 3 free slots"),
        ("0 E C 0\n\t\t0 F a 0", "it.txt:2: tabs must be 1..1, got 2"),
        ("0 E C 0\n0 F a 0", "it.txt:2: tabs must be 1..1, got 0"),
        ("0 E C 0\n\t0 F C 0", "it.txt:2: duplicate part 'C'"),
        ("0 E C 0\n\nX sigmoid", "it.txt:3: no part 'X'"),
        ("0 E C 0\n\nC gauss", "it.txt:3: must be one of simple, .*got 'gauss'"),
        ("0 E C 0\n\n\nC 0 C 9 1", "it.txt: no neuron 9 on part 'C'"),
        ("0 E C 0\n\n\nC 0 C", "it.txt:4: must be PART NUMBER PART NUMBER WEIGHT"),
        ("0 E C 0\n\nC simple\n\n\nC 6 Simple", "it.txt:6: must be a number"),
        ("0 E C 0\n\n\n\nC 6 oscillator 1 2", "it.txt:5: oscillator takes 3 numbers"),
        ("0 E C 0\n\n\n\n\nC", "it.txt:6: a fifth section"),
    ],
)  # fmt: skip
def test_errors_name_the_line(text: str, message: str) -> None:
    with pytest.raises(InvalidRobot, match=message):
        read(text)


def document() -> dict[str, object]:
    """Return a hinge on a core, in the keys of RoboGen's evolution."""
    return {
        "id": 1,
        "body": {
            "part": [
                {"id": "C", "type": "CoreComponent", "root": True, "orientation": 0},
                {"id": "H", "type": "ActiveHinge", "root": False, "orientation": 1},
            ],
            "connection": [{"src": "C", "dest": "H", "srcSlot": 0, "destSlot": 0}],
        },
        "brain": {
            "neuron": [
                {"id": "C-0", "layer": "input", "type": "simple", "bodyPartId": "C",
                 "ioId": 0, "gain": 1.0},
                {"id": "H-0", "layer": "output", "type": "sigmoid", "bodyPartId": "H",
                 "ioId": 0, "bias": 0.25, "gain": 0.5},
            ],
            "connection": [{"src": "C-0", "dest": "H-0", "weight": 2}],
        },
    }  # fmt: skip


def test_json_and_text_give_the_same_robot() -> None:
    robot = robot_from_robogen_json(json.dumps(document()), "it.json", BUILT_IN)
    text = "0 E C 0\n\t0 I H 1\n\n\nC 0 H 0 2\n\nH 0 0.25\n"
    assert robot.parts == read(text).parts
    assert robot.brain.neurons[6].parameters == (0.25, 0.5)
    assert robot.brain.connections == (Connection(0, 6, 2.0),)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("body", "part", 1, "id"), "C", r"it:1: .*part\[1\].id: duplicate part 'C'"),
        (("body", "part", 1, "type"), 3, "part 'H': type '3' is not supported"),
        (("body", "part", 0, "root"), False, "exactly one must be the root, got 0"),
        (("body", "connection"), [], "it: body.part: 'H' is not attached"),
        (("body", "connection", 0, "src"), "X", r"\[0\].src: must be one of C, H"),
        (("body", "connection", 0, "src"), "H", "slot 0 is taken"),
        (("body", "connection", 0, "srcSlot"), 4, "part 'H': 'C' has no slot 4"),
        (("brain", "connection", 0, "dest"), "X", r"\[0\].dest: must be one of C-0"),
        (("brain", "neuron", 1, "type"), "x", "it:1: type: must be one of"),
        (("brain", "neuron", 1, "layer"), "x", r"neuron\[1\].layer: must be one of in"),
        (("brain", "neuron", 1, "bodyPartId"), "X", "no neuron 0 on part 'X'"),
        (("brain", "neuron", 1, "ioId"), 3, "no neuron 3 on part 'H'"),
        (("brain", "neuron", 1, "id"), "C-0", r"\[1\].id: duplicate neuron 'C-0'"),
        (("brain", "neuron", 1, "bodyPartId"), "C", r"\[1\].ioId: part 'C' has two ne"),
        (("brain", "neuron", 1, "layer"), "hidden", "it: part 'H' has two neurons 0"),
        (("brain",), 3, "it:1: brain: must be a mapping"),
        (("body", "part"), 3, "it:1: body.part: must be a list"),
        (("body", "part", 1, "root"), "yes", "root: must be one of true, false"),
        (("brian",), {}, "it:1: brian: no such key; did you mean 'brain'"),
        (("brain", "neurons"), [], "brain.neurons: no such key; did"),
        (("brain", "neuron", 1, "gian"), 2, r"neuron\[1\].gian: no such key; did"),
        (("brain", "connection", 0, "w"), 2, r"\[0\].w: no such key; allowed"),
        (("body", "part", 1, "slot"), 1, r"part\[1\].slot: no such key"),
    ],
)  # fmt: skip
def test_errors_name_the_path(
    path: tuple[str | int, ...], value: object, message: str
) -> None:
    changed = document()
    inner: object = changed
    for key in path[:-1]:
        inner = inner[key]  # type: ignore[index]
    inner[path[-1]] = value  # type: ignore[index]
    with pytest.raises(InvalidRobot, match=message):
        robot_from_robogen_json(json.dumps(changed), "it", BUILT_IN)


def test_json_of_a_core_without_imu() -> None:
    """Its hidden neuron is number 0; a wrong weight is named by its ends."""
    changed = NO_IMU.replace("C sigmoid\n", "").replace("C 1 C 0", "H 0 C 0")
    robot = read(changed)
    found: dict[str, Any] = document()
    found["body"]["part"][0]["type"] = "CoreComponentNoIMU"
    found["body"]["part"][1]["orientation"] = 0
    hidden, motor = found["brain"]["neuron"]
    hidden |= {"layer": "hidden", "bias": 0.25}
    motor |= {"bias": 0.0, "gain": 1.0}
    edges = [
        {"src": "C-0", "dest": "H-0", "weight": 1.5},
        {"src": "H-0", "dest": "C-0", "weight": 0.5},
    ]
    found["brain"]["connection"] = edges
    assert robot_from_robogen_json(json.dumps(found), "it", BUILT_IN) == robot
    edges[1]["weight"] = math.inf
    text = json.dumps(found).replace("Infinity", "1e999")
    with pytest.raises(InvalidRobot, match=r"connection\[1\].weight: must be a finite"):
        robot_from_robogen_json(text, "it", BUILT_IN)


def test_invalid_json_is_refused() -> None:
    for text, message in (
        ("{\n]", "it:2: not valid JSON"),
        ('{"id": 1, "id": 2}', "^it:1: not valid JSON: key 'id' is given twice$"),
    ):
        with pytest.raises(InvalidRobot, match=message):
            robot_from_robogen_json(text, "it", BUILT_IN)


def test_files_of_editors_of_windows_are_read(tmp_path: Path) -> None:
    """They begin with a byte order mark, and their lines end in CR LF."""
    for name, text in (("star.txt", STARFISH), ("arm.json", json.dumps(document()))):
        (tmp_path / name).write_text(text)
        plain = read_robot(tmp_path / name)
        lines = text.replace("\n", "\r\n")
        (tmp_path / name).write_text(lines, encoding="utf-8-sig", newline="")
        assert read_robot(tmp_path / name) == plain


@pytest.mark.parametrize("ending", [".txt", ".json"])
def test_content_selects_the_form(tmp_path: Path, ending: str) -> None:
    """Saved by a browser, JSON may be called robot.txt."""
    star, arm = (tmp_path / f"{name}{ending}" for name in ("star", "arm"))
    star.write_text(STARFISH)
    arm.write_text(f"\n{json.dumps(document())}")
    assert read_robot(star) == read(STARFISH)
    assert len(read_robot(arm).parts) == 2


@pytest.mark.parametrize(
    ("ending", "message"),
    [(".txt", r"must be the core|TABS"), (".json", "must be a mapping")],
)
def test_a_file_of_neither_form_is_that_of_its_ending(
    tmp_path: Path, ending: str, message: str
) -> None:
    file = tmp_path / f"it{ending}"
    for text in ("", "hello"):
        file.write_text(text)
        with pytest.raises(InvalidRobot, match=message):
            read_robot(file)


SPACE_2016 = {
    name: kind
    for kind in vars(robogen_parts).values()
    if isinstance(kind, PartType) and (name := kind.name) in BUILT_IN
}


def test_dimensions_of_2016() -> None:
    # Grams and millimetres, as in RoboGen's sources.
    def mass_g(name: str, *values: float) -> float:
        shape = SPACE_2016[name].shape((*values, 0.5, 0.5, 0.5))
        return 1000.0 * sum(box.mass for box in shape.boxes)

    for name, grams in (
        ("Core", 44.5), ("FixedBrick", 10.2), ("ActiveHinge", 18), ("Hinge", 6),
        ("TouchSensor", 3),
    ):  # fmt: skip
        assert mass_g(name) == pytest.approx(grams)
    # 50 mm of bar, 6 of stub and half of a 5 mm cylinder at 1.37 g/cm, two plates.
    bar = mass_g("ParametricBarJoint", 50.0, 0.3, 0.0)
    assert bar == pytest.approx(2 + 1.37 * (5.0 + 0.6 + 0.5))
    straight = SPACE_2016["ParametricBarJoint"].shape((50.0, 0.0, 0.0, 0, 0, 0))
    reach = straight.slots[1].position[0] - straight.slots[0].position[0]
    assert reach == pytest.approx(0.0015 + 0.006 + 0.05 + 0.0015)


def test_both_part_sets_accept_the_same_robots() -> None:
    assert robot_from_robogen_text(STARFISH, "it", SPACE_2016) == read(STARFISH)
    for name, kind in SPACE_2016.items():
        ours = BUILT_IN[name]
        values = tuple(parameter.default for parameter in ours.parameters)
        turned = [(s.normal, s.tangent, s.segment) for s in kind.shape(values).slots]
        assert turned == [
            (s.normal, s.tangent, s.segment) for s in ours.shape(values).slots
        ]
