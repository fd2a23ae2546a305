"""Robots from other projects: forms of the published YAML and of RoboGen's dumps.

The files here are own, in the forms of the files that docs/robots_elsewhere.md lists.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from schema.errors import InvalidRobot
from schema.formats.files import read_robot, robot_from_yaml
from schema.formats.yaml import robot_to_yaml
from schema.parts import BUILT_IN
from schema.robot.brain import Connection, Neuron
from schema.robot.robot import Robot, check_robot

BODY = """\
body:
  id: Core
  type: CoreComponent
  children:
    0:
      id: Hip
      type: ActiveHinge
      orientation: -90
      children: {1: {id: Leg, type: FixedBrick, orientation: 270.0, label: ''}}
    2:
      slot: 1
      id: Tail
      type: Hinge
      params: {red: 0.04, green: 0.26, blue: 0.72}
    3: {id: Feeler, type: TouchSensor}
"""
# As evolved from 2018 on: own names of inputs and outputs, not all inputs listed.
BRAIN = """\
brain:
  type: neural-network
  neurons:
    node1: {id: node1, layer: output, part_id: Hip, type: Oscillator}
    core1: {id: core1, layer: input, part_id: Core, type: Input}
    core2: {id: core2, layer: input, part_id: Core, type: Input}
    touch: {id: touch, layer: input, part_id: Feeler, type: Input}
    inner: {id: inner, layer: hidden, part_id: Leg, type: Sigmoid}
  connections:
  - {dst: inner, src: core2, weight: -0.5}
  - {dst: node1, src: inner, weight: 1.5}
  - {dst: inner, src: touch, weight: 0.25}
  params:
    node1: {amplitude: 3.2, period: 7.25, phase_offset: 4.75}
    inner: {bias: 0.5}
"""


def read(text: str) -> Robot:
    return robot_from_yaml(text, "its.yaml", BUILT_IN)


def counts_of(robot: Robot) -> tuple[int, int, int, int]:
    """Return the numbers of parts, joints, neurons and connections."""
    joints = sum(part.kind in {"ActiveHinge", "Hinge"} for part in robot.parts)
    brain = robot.brain
    return len(robot.parts), joints, len(brain.neurons), len(brain.connections)


def counts_in(text: str) -> tuple[int, int, int, int]:
    """Count the same in the text, without the reader."""

    def parts(node: dict[str, Any]) -> Iterator[str]:
        yield node["type"]
        for child in (node.get("children") or {}).values():
            yield from parts(child)

    document = yaml.safe_load(text)
    kinds = Counter(parts(document["body"]))
    brain = document.get("brain") or {}
    neurons = (brain.get("neurons") or {}).values()
    hidden = sum(each.get("layer", "hidden") == "hidden" for each in neurons)
    # A core has 6 inputs, a touch sensor 2, an active hinge one output.
    ends = 6 + 2 * kinds["TouchSensor"] + kinds["ActiveHinge"]
    joints = kinds["ActiveHinge"] + kinds["Hinge"]
    edges = len(brain.get("connections") or ())
    return kinds.total(), joints, ends + hidden, edges


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (BODY, (5, 2, 9, 0)),
        (f"---\nid: example_spider\n{BODY}", (5, 2, 9, 0)),
        (f"{BODY}id: 26\nparents: [3, 7]\n", (5, 2, 9, 0)),
        (f"id: babyA\n{BODY}brain: null\n", (5, 2, 9, 0)),
        (BODY.replace("label: ''", "children: ") + "brain:\n", (5, 2, 9, 0)),
        (f"id: robot_0\n{BODY}{BRAIN}", (5, 2, 10, 3)),
        (BODY + BRAIN.replace("  type: neural-network\n", ""), (5, 2, 10, 3)),
        (f"{BODY}brain: {{neurons: {{}}, connections: []}}", (5, 2, 9, 0)),
    ],
    ids=["body", "id", "parents", "null", "empty", "brain", "no type", "no params"],
)
def test_forms_that_are_read(text: str, expected: tuple[int, ...]) -> None:
    robot = read(text)
    assert counts_of(robot) == counts_in(text) == expected
    assert [part.orientation for part in robot.parts] == [0, 270, 270, 0, 0]
    assert [part.slot for part in robot.parts] == [-1, 0, 0, 1, 0]


def test_own_names_of_inputs_and_outputs_go_in_order() -> None:
    brain = read(BODY + BRAIN).brain
    assert brain.neurons[8:] == (
        Neuron("output", "Oscillator", 1, (7.25, 4.75, 3.2)),
        Neuron("hidden", "Sigmoid", 2, (0.5, 0.5)),
    )
    # core2 is the core's second input, touch the first of the sensor's two.
    assert brain.connections == (
        Connection(1, 9, -0.5),
        Connection(9, 8, 1.5),
        Connection(6, 9, 0.25),
    )


def test_a_body_of_ours_keeps_its_genes() -> None:
    robot = read("body: {type: Core, gene: 7, children: {1: {type: Hinge, slot: 1}}}")
    assert (robot.parts[0].gene, robot.parts[1].slot) == (7, 1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("type: neural-network", "type: bo-cpg", r":17: brain.type: 'bo-cpg' is not s"),
        ("type: FixedBrick", "type: Wheel", r":9: part 'Leg': type: .*got 'Wheel'"),
        ("type: Sigmoid", "type: X-Neuron", r":23: neuron 'inner': type: .*'X-Neuron'"),
        ("Core, type: Input", "Core, type: Simple", r"'core1': type: must be one"),
        ("part_id: Leg", "part_id: Lag", r":23: neuron 'inner': part_id: .*'Leg'"),
        ("part_id: Hip", "part_id: Tail", r"'node1': layer: part 'Tail' has 0 output"),
        ("core1: {", "Hip-out-0: {", r"neuron 'node1': layer: part 'Hip' has 1 outp"),
        ("src: inner", "src: other", r":26: brain.connections\[1\].src: .*'other'"),
        ("dst: node1, src: inner", "dst: inner, src: core2", r":26: .* second conn"),
        ("dst: node1", "dst: core1", r":26: .*target: must not be an input"),
        ("weight: 1.5", "weight: .nan", r":26: brain.connections\[1\].weight: must"),
        ("weight: 1.5", "weight: 1, socket: a", r"connections\[1\].socket: no such"),
        ("inner: {bias", "outer: {bias", r":30: brain.params.outer: unknown"),
        ("bias: 0.5", "tau: 0.5", r":30: neuron 'inner': tau: no such key"),
        ("id: Leg", "id: Hip", r":9: part 'Hip': id: duplicate part name 'Hip'"),
        ("-90", "45", r":8: part 'Hip': orientation: must be one of"),
        ("-90", "0.5", r":8: part 'Hip': orientation: must be a whole number"),
        ("-90", ".inf", r":8: part 'Hip': orientation: must be a finite number"),
        ("{1: {id: Leg", "{0: {id: Leg", r":9: part 'Leg': slot 0 of part 'Hip' is"),
        ("{1: {id: Leg", "{2: {id: Leg", r"part 'Leg': parent_slot: ActiveHinge has"),
        ("slot: 1", "slot: 2", r":11: part 'Tail': slot: Hinge has slots 0..1, got 2"),
        ("0.26", "26", r":14: part 'Tail': green: must be in \[0.0, 1.0\], got 26"),
        ("type: TouchSensor", "type: Core", r":15: part 'Feeler': exact"),
        ("id: Feeler, ", "", r":22: neuron 'touch': part_id: .* got 'Feeler'"),
    ],
)  # fmt: skip
def test_errors_name_the_ids_of_the_file(old: str, new: str, message: str) -> None:
    text = BODY + BRAIN
    assert old in text
    with pytest.raises(InvalidRobot, match=message) as error:
        read(text.replace(old, new, 1))
    assert "\n" not in str(error.value)
    assert "body.parts" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("r5.txt", b'\x08\x04\x12I\n"\n\x02J5\xc2\xf5', "binary RoboGen dump"),
        ("it.dat", b"\x08\x00\x12\xa2", "a binary RoboGen dump"),
        ("gp.txt", b'id: 1286\nbody {\n  part {\n    id: "L41"\n', "RoboGen Protobuf"),
        ("best.txt", b"Fitness: 99 \nRobot-Body\nNodesCount: 17\n", "RoboGen report"),
        ("ir.txt", b"0 E Core 0\n\t1 D Eye 0\n", ":2: part 'Eye': type 'IrSensor' is"),
    ],
)
def test_dumps_of_robogen_are_refused_by_name(
    tmp_path: Path, name: str, data: bytes, message: str
) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InvalidRobot, match=message) as error:
        read_robot(path)
    assert str(error.value).startswith(str(path))
    assert "not supported: " in str(error.value)
    assert "\n" not in str(error.value)


LEGS = ((1, "left", -0.8, 0.2), (2, "right", -0.95, -1.0))


def walker() -> str:
    """Return two legs of hip, thigh, knee and shin, at slots 1 and 2 of the core."""
    lines = ["--- !tol/robot", "id: 0", "body:", "  id: trunk", "  type: CoreComponent",
             "  orientation: 0", "  params: {}", "  children:"]  # fmt: skip
    for slot, side, *_ in LEGS:
        shin = f"{{1: {{id: {side}-shin, type: FixedBrick}}}}"
        knee = f"{{1: {{id: {side}-knee, type: ActiveHinge, children: {shin}}}}}"
        thigh = (
            f"{{1: {{id: {side}-thigh, type: FixedBrick, orientation: 90.0, "
            f"label: meat, children: {knee}}}}}"
        )
        lines += [f"    {slot}:", "      slot: 0", f"      id: {side}-hip",
                  "      type: ActiveHinge", "      orientation: 90",
                  f"      children: {thigh}"]  # fmt: skip
    lines += ["brain:", "  neurons: {}", "  connections: []", "  params:"]
    for _, side, hip_at, knee_at in LEGS:
        for joint, offset in (("hip", hip_at), ("knee", knee_at)):
            lines.append(
                f"    {side}-{joint}-out-0: {{type: Oscillator, period: 0.8, "
                f"phase_offset: {offset}, gain: 1}}"
            )
    return "\n".join(lines)


def read_2016(text: str) -> Robot:
    robot = robot_from_yaml(text, "its.yaml", BUILT_IN)
    check_robot(robot, BUILT_IN)
    return robot


def test_the_published_walker() -> None:
    robot = read_2016(walker())
    leg = ["ActiveHinge", "FixedBrick", "ActiveHinge", "FixedBrick"]
    assert [part.kind for part in robot.parts] == ["Core", *leg, *leg]
    assert [part.parent for part in robot.parts] == [-1, 0, 1, 2, 3, 0, 5, 6, 7]
    assert [part.parent_slot for part in robot.parts[1:]] == [1, 1, 1, 1, 2, 1, 1, 1]
    assert {part.slot for part in robot.parts[1:]} == {0}
    assert [part.orientation for part in robot.parts[1:5]] == [90, 90, 0, 0]
    outputs = [one for one in robot.brain.neurons if one.layer != "input"]
    assert outputs == [
        Neuron("output", "Oscillator", part, (0.8, phase, 1.0))
        for part, phase in ((1, -0.8), (3, 0.2), (5, -0.95), (7, -1.0))
    ]
    assert robot.brain.connections == ()
    # And as ours from then on.
    assert read_2016(robot_to_yaml(robot, BUILT_IN)) == robot


HAND = """\
body: {id: c, type: Core, children: {0: {id: h, type: ActiveHinge}}}
brain:
  neurons:
    late: {layer: hidden, type: Sigmoid, part_id: h, gain: 0.25}
    early: {bias: 0.5}
    h-out-0: {id: h-out-0, layer: output, type: Simple, part_id: h}
    c-in-0: {id: c-in-0, layer: input, type: Input, part_id: c}
  params:
    early: {type: Oscillator, phaseOffset: 0.5}
  connections:
  - {src: c-in-1, dst: early, weight: -0.5}
  - {src: late, dst: h-out-0}
"""


def test_default_outputs_and_hidden_neurons_by_name() -> None:
    brain = read_2016(HAND).brain
    assert brain.neurons[6:] == (
        Neuron("output", "Simple", 1, (0.0, 0.5)),
        Neuron("hidden", "Oscillator", 0, (5.0, 0.5, 1.0)),
        Neuron("hidden", "Sigmoid", 1, (0.0, 0.25)),
    )
    assert brain.connections == (Connection(1, 7, -0.5), Connection(8, 6, 0.0))
    bare = read_2016(
        "id: 3\nbody: {id: c, type: Core, children: {0: {type: ActiveHinge}}}"
    )
    assert bare.brain.neurons[6:] == (Neuron("output", "Simple", 1, (0.0, 0.5)),)
