"""Robots as YAML, the form for people: its description and writer.

::

    revolve_robot: 1
    body:
      id: part-0
      type: Core
      gene: 1
      params: {red: 0.5, green: 0.5, blue: 0.5}
      children:
        2:                       # slot of the core
          slot: 0                # own slot
          id: leg
          type: ActiveHinge
          orientation: 90
    brain:
      neurons:
      - {id: leg-out-0, part: leg, layer: output, type: Oscillator}
      connections:
      - {source: part-0-in-2, target: leg-out-0, weight: 0.25}

Defaults of omitted keys: a parameter its default, a slot of a part's own, an
orientation or gene 0, an id ``part-<index>``, and for neurons ``<part>-in-k``,
``<part>-out-k`` or ``<part>-hidden-k``. Input neurons follow from the sensors:
connections name them, but they are not written. Floats are written with all digits and
read back bit for bit.
"""

from typing import Any

import yaml

from schema.errors import InvalidRobot
from schema.formats.document import compose
from schema.parts import BodySpace, Parameter
from schema.robot.brain import NeuronKinds, neuron_names
from schema.robot.cpg import BUILT_IN_KINDS
from schema.robot.robot import Part, Robot, check_robot

VERSION = 1


def robot_to_yaml(
    robot: Robot, space: BodySpace, kinds: NeuronKinds = BUILT_IN_KINDS
) -> str:
    """Return the YAML text of a robot.

    Raises:
        InvalidRobot: a robot that is not well formed, nested too deeply (a chain of
            about 150 parts), or of a text beyond the limits of reading.
    """
    check_robot(robot, space, kinds)
    entries: list[dict[str, Any]] = []
    for index, part in enumerate(robot.parts):
        entries.append(_part_entry(part, index, space))
        if index:
            siblings = entries[part.parent].setdefault("children", {})
            siblings[part.parent_slot] = entries[index]
    names = neuron_names(robot.brain, [entry["id"] for entry in entries])
    document = {
        "revolve_robot": VERSION,
        "body": entries[0],
        "brain": {
            "neurons": [
                {
                    "id": name,
                    "part": entries[neuron.part]["id"],
                    "layer": neuron.layer,
                    "type": neuron.kind,
                    "params": _named(kinds[neuron.kind], neuron.parameters),
                }
                for name, neuron in zip(names, robot.brain.neurons, strict=True)
                if neuron.layer != "input"
            ],
            "connections": [
                {
                    "source": names[edge.source],
                    "target": names[edge.target],
                    "weight": float(edge.weight),
                }
                for edge in robot.brain.connections
            ],
        },
    }
    try:
        text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
        compose(text, "")
    except (RecursionError, InvalidRobot) as error:
        why = "too large" if isinstance(error, InvalidRobot) else "nested too deeply"
        raise InvalidRobot(f"{why} for YAML: a .pb file holds any robot") from None
    return text


def _part_entry(part: Part, index: int, space: BodySpace) -> dict[str, Any]:
    entry = {} if index == 0 else {"slot": part.slot}
    return entry | {
        "id": f"part-{index}",
        "type": part.kind,
        "orientation": part.orientation,
        "gene": part.gene,
        "params": _named(space[part.kind].parameters, part.parameters),
    }


def _named(
    parameters: tuple[Parameter, ...], values: tuple[float, ...]
) -> dict[str, float]:
    pairs = zip(parameters, values, strict=True)
    return {parameter.name: float(value) for parameter, value in pairs}
