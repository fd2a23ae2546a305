"""Modules with shared weights as data: the neuron type of the brain type ``modular``.

Each part has a module, a recurrent network of ``MODULE_NEURONS`` neurons; the first one
of a part with a motor is its output, all others are hidden. The states x of a module,
from -1 to 1, follow from sensor readings s of its part, and from the previous states
of its own module, that of its parent and those of its children::

    x_i = tanh(b_i + V_i s / 10 + W_i x + P_i x_parent + sum over children of C_i x')
    output_i = (1 + x_i) / 2

All modules of a robot have the same b, W, P and C, and the V of each type of part is
its own, so that they fit any body. They are written at each neuron and connection.
Source: own definition, after Huang, Mordatch and Pathak, One policy to control them
all: shared modular policies for agent-agnostic control, 2020, where messages are
learnt outputs; here a message is the state.
"""

from schema.parts import Parameter
from schema.robot.brain import Layer, NeuronKinds

MODULE_NEURON = "ModuleNeuron"
MODULE_NEURONS = 2
"""Number of neurons of a module: two can oscillate."""
SENSOR_GAIN = 0.1
"""Accelerations are around 10 m/s^2, states around 1."""
WEIGHT = Parameter("weight", -2.0, 2.0, 0.0)
MODULE_KINDS: NeuronKinds = {MODULE_NEURON: (Parameter("bias", -1.0, 1.0, 0.0),)}
"""The only neuron type of a ``modular`` brain."""

Role = tuple[str, str, int, int]
"""What a shared weight connects: layer of the source, relation, both places.

The relation is that of the source's module to the target's, ``own``, ``parent`` or
``child``; of an input it is the type of its part. Places are as of ``place_of``.
"""


def place_of(layer: Layer, offset: int) -> int:
    """Return the place of a neuron in its module, of an input in its part.

    Hidden neurons count from the last place down: with a motor or without, the same
    neuron has the same place.
    """
    return MODULE_NEURONS - 1 - offset if layer == "hidden" else offset
