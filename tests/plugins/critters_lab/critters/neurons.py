"""A neuron type."""

import numpy as np
from numpy.typing import NDArray

import revolve as rv


class Leaky:
    """Neuron whose potential follows its input slowly; the output is in [0, 1]."""

    name = "Leaky"
    parameters = (
        rv.Parameter("time_s", 0.2, 2.0, 0.5),
        rv.Parameter("bias", -1.0, 1.0, 0.0),
    )
    states = 2

    def step(
        self,
        state: NDArray[np.float64],
        inputs: NDArray[np.float64],
        parameters: NDArray[np.float64],
        tick: rv.Tick,
    ) -> NDArray[np.float64]:
        """Return output and potential of N neurons, (2, N)."""
        time_s, bias = parameters
        share = np.minimum(tick.dt_s / time_s, 1.0)
        potential = state[1] + share * (inputs + bias - state[1])
        output = 0.5 + 0.5 * potential / (1.0 + np.abs(potential))
        return np.stack([output, potential])
