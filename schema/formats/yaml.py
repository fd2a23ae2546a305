"""Robots as YAML, the form for people.

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

A parameter that is not written has its default, an orientation or gene is 0, an id
is ``part-<index>`` and for neurons ``<part>-in-k``, ``<part>-out-k`` or
``<part>-hidden-k``. Input neurons are there because sensors are: they are only
named, never written. Floats are written so that they are read back bit for bit.
"""

from typing import Any

import yaml

from schema.formats.yaml_2016 import RevolveReader, is_of_revolve
from schema.formats.yaml_node import compose
from schema.formats.yaml_reader import VERSION, Reader
from schema.parts import BodySpace, Parameter
from schema.robot.brain import NEURON_TYPES, neuron_names
from schema.robot.robot import Part, Robot, check_robot


def robot_to_yaml(robot: Robot, space: BodySpace) -> str:
    """Return the text of a robot.

    Raises:
        InvalidRobot: the robot is not well formed in this body space.
    """
    check_robot(robot, space)
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
                    "params": _named(NEURON_TYPES[neuron.kind], neuron.parameters),
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
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None)


def robot_from_yaml(text: str, file: str, space: BodySpace) -> Robot:
    """Return the robot of a text, in this form or in Revolve's own.

    Args:
        text: the document.
        file: its name, for messages.
        space: the part types that it may use.

    Raises:
        InvalidRobot: not YAML, an unknown or missing key, part type or name, a value
            of a wrong type, a robot that is not well formed in this body space. The
            message names file, line and field.
    """
    document = compose(text, file)
    reader = RevolveReader if is_of_revolve(document) else Reader
    return reader(space, file).read(document)


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
