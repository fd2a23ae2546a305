"""Coupled phase oscillators as data: the neuron type of the brain type ``cpg``.

Oscillator i has frequency f_i [Hz], phase offset p_i [periods], amplitude A_i and
centre c_i. Its state is the deviation d_i of its phase from 2 pi p_i [rad]::

    d_i' = 2 pi f_i + sum over j of coupling * weight_ij * sin(d_j - d_i)
    output_i = c_i + A_i / 2 * sin(d_i + 2 pi p_i)

Coupled oscillators of equal frequency therefore lock to the phase difference
2 pi (p_j - p_i). Source: Ijspeert et al., From swimming to walking with a salamander
robot driven by a spinal cord model, Science 315, 2007, with constant amplitudes.
"""

from typing import Annotated

from msgspec import Meta, Struct

from schema.parts import Parameter
from schema.robot.brain import NEURON_TYPES, NeuronKinds
from schema.robot.modular import MODULE_KINDS

PHASE_OSCILLATOR = "PhaseOscillator"

Frequency = Annotated[float, Meta(gt=0, le=100)]


class CpgParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the brain type ``cpg``.

    Attributes:
        lowest_hz: lowest frequency of an oscillator [Hz].
        highest_hz: highest frequency of an oscillator [Hz].
        coupling: [rad/s] per unit of weight; weights are in [0, 1].
    """

    lowest_hz: Frequency = 0.2
    highest_hz: Frequency = 2.0
    coupling: Annotated[float, Meta(ge=0, le=100)] = 4.0

    def __post_init__(self) -> None:
        """Raise ValueError unless the range is one."""
        if self.lowest_hz > self.highest_hz:
            rule = f"must be <= highest_hz = {self.highest_hz:g}"
            raise ValueError(f"lowest_hz {rule}, got {self.lowest_hz:g}")


def cpg_neurons(parameters: CpgParameters) -> NeuronKinds:
    """Return the only neuron type of a ``cpg`` brain."""
    low, high = parameters.lowest_hz, parameters.highest_hz
    return {
        PHASE_OSCILLATOR: (
            Parameter("frequency", low, high, 0.5 * (low + high), unit="Hz"),
            Parameter("phase_offset", 0.0, 1.0, 0.0, unit="periods"),
            Parameter("amplitude", 0.0, 1.0, 0.5),
            Parameter("centre", 0.0, 1.0, 0.5),
        )
    }


BUILT_IN_KINDS: NeuronKinds = {
    **NEURON_TYPES,
    **cpg_neurons(CpgParameters()),
    **MODULE_KINDS,
}
"""Types of output and hidden neurons of the built-in brain types."""
