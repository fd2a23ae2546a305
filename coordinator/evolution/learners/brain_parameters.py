"""Parameters of a brain that are learnt, as shares of their ranges."""

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from schema.experiment.learning import Learning
from schema.parts import Parameter
from schema.robot.brain import Brain, NeuronKinds


class BrainParameters:
    """The parameters of a brain that an experiment lets robots learn.

    Parameters that never mutate are left out. The order is that of the neurons and
    then of the connections of the brain.
    """

    def __init__(self, rules: Learning, kinds: NeuronKinds) -> None:
        low, high = rules.weight_limits
        self._weight = Parameter("weight", low, high, low)
        self._has_weights = rules.what != "neurons"
        self._kinds = kinds if rules.what != "weights" else {}

    def read(self, brain: Brain) -> tuple[float, ...]:
        """Return the parameters of a brain as shares of their ranges, from 0 to 1.

        A value outside its range becomes the nearest end of the range.
        """
        return tuple(
            min(max((value - own.low) / (own.high - own.low), 0.0), 1.0)
            for own, value in self._values(brain)
        )

    def written(self, brain: Brain, shares: Sequence[float]) -> Brain:
        """Return a brain with other parameters, shares of ranges as ``read`` returns.

        Everything that is not learnt stays the same.
        """
        new = iter(shares)
        neurons = tuple(
            replace(
                neuron,
                parameters=tuple(
                    _value(own, next(new)) if _is_learnt(own) else value
                    for own, value in zip(
                        self._kinds[neuron.kind], neuron.parameters, strict=True
                    )
                ),
            )
            if neuron.kind in self._kinds
            else neuron
            for neuron in brain.neurons
        )
        connections = brain.connections
        if self._has_weights:
            connections = tuple(
                replace(edge, weight=_value(self._weight, next(new)))
                for edge in connections
            )
        return Brain(neurons, connections)

    def _values(self, brain: Brain) -> Iterator[tuple[Parameter, float]]:
        for neuron in brain.neurons:
            own = self._kinds.get(neuron.kind, ())
            if own:
                for each, value in zip(own, neuron.parameters, strict=True):
                    if _is_learnt(each):
                        yield each, value
        if self._has_weights:
            for edge in brain.connections:
                yield self._weight, edge.weight


def _is_learnt(own: Parameter) -> bool:
    return own.is_mutable and own.high > own.low


def _value(own: Parameter, share: float) -> float:
    # Rounding must not carry a value out of its range.
    return min(max(own.low + (own.high - own.low) * share, own.low), own.high)
