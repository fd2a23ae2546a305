"""Robots of a core and some parts, for tests of robot files and models."""

from schema.parts import BUILT_IN, BodySpace
from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.robot import Part, Robot

GREY = (0.5, 0.5, 0.5)
CORE = Part("Core", -1, -1, -1, 0, GREY)


def robot_of(*parts: Part, space: BodySpace = BUILT_IN) -> Robot:
    """Return a core with parts, all inputs, and a simple output for each motor."""
    kinds = [space[part.kind] for part in (CORE, *parts)]
    inputs = [Neuron("input", INPUT, at) for at, kind in enumerate(kinds)
              for _ in range(kind.inputs)]  # fmt: skip
    outputs = [Neuron("output", "Simple", at, (0.0, 0.5))
               for at, kind in enumerate(kinds) if kind.outputs]  # fmt: skip
    return Robot((CORE, *parts), Brain((*inputs, *outputs)))
