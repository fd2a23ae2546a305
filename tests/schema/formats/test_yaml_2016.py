"""Robots in the YAML form of 2016: the published walker."""

from schema.formats.files import robot_from_yaml
from schema.formats.yaml import robot_to_yaml
from schema.parts import BUILT_IN
from schema.robot.brain import Connection, Neuron
from schema.robot.robot import Robot, check_robot

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


def read(text: str) -> Robot:
    robot = robot_from_yaml(text, "its.yaml", BUILT_IN)
    check_robot(robot, BUILT_IN)
    return robot


def test_the_published_walker() -> None:
    robot = read(walker())
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
    assert read(robot_to_yaml(robot, BUILT_IN)) == robot


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
    brain = read(HAND).brain
    assert brain.neurons[6:] == (
        Neuron("output", "Simple", 1, (0.0, 0.5)),
        Neuron("hidden", "Oscillator", 0, (5.0, 0.5, 1.0)),
        Neuron("hidden", "Sigmoid", 1, (0.0, 0.25)),
    )
    assert brain.connections == (Connection(1, 7, -0.5), Connection(8, 6, 0.0))
    bare = read("id: 3\nbody: {id: c, type: Core, children: {0: {type: ActiveHinge}}}")
    assert bare.brain.neurons[6:] == (Neuron("output", "Simple", 1, (0.0, 0.5)),)
