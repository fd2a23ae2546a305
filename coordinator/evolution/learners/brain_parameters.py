"""Parameters of a brain that are learnt, as shares of their ranges."""

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from schema.experiment.brains import element_names, neuron_kinds, weight_range
from schema.experiment.document import BrainSection, Space
from schema.experiment.learning import Learning
from schema.parts import Parameter
from schema.robot.brain import Brain
from schema.robot.origins import names_of
from schema.robot.robot import Robot

Shares = dict[object, float]
"""Shares of ranges by what is learnt: a weight or a parameter of a neuron."""


class BrainParameters:
    """The parameters of a brain that an experiment lets robots learn.

    Parameters that never mutate are left out. The order is that of the neurons and
    then of the connections of the brain. Parameters that a brain type shares between
    its neurons or connections are one parameter.
    """

    def __init__(self, rules: Learning, brain: BrainSection, space: Space) -> None:
        low, high = rules.weight_limits or weight_range(brain)
        self._weight = Parameter("weight", low, high, low)
        self._has_weights = rules.what != "neurons"
        self._kinds = neuron_kinds(brain, space) if rules.what != "weights" else {}
        self._names = element_names(brain)

    def read(self, robot: Robot) -> tuple[float, ...]:
        """Return the parameters of a brain as shares of their ranges, from 0 to 1.

        A value outside its range becomes the nearest end of the range.
        """
        return (*self._shares(robot).values(),)

    def sample(self, robot: Robot, other: Robot) -> tuple[float, ...] | None:
        """Return the parameters of a robot with those that it and another one share.

        A share is as of ``read``. They have a parameter in common if its neuron, or
        both ends of its connection, have the same name. Returns None if they have none,
        or if a part has no origin by which its neurons are named.
        """
        genes = (part.gene for part in (*robot.parts, *other.parts))
        if self._names is names_of and not all(genes):
            return None
        own, given = self._shares(robot), self._shares(other)
        if own.keys().isdisjoint(given):
            return None
        return tuple(given.get(name, share) for name, share in own.items())

    def written(self, robot: Robot, shares: Sequence[float]) -> Robot:
        """Return a robot with other parameters, shares of ranges as ``read`` returns.

        Everything that is not learnt stays the same.
        """
        new = dict(zip(self._shares(robot), shares, strict=True))
        names, edges = self._names(robot)
        neurons = tuple(
            replace(
                neuron,
                parameters=tuple(
                    _value(own, new[name, place]) if _is_learnt(own) else value
                    for place, (own, value) in enumerate(
                        zip(self._kinds[neuron.kind], neuron.parameters, strict=True)
                    )
                ),
            )
            if neuron.kind in self._kinds
            else neuron
            for name, neuron in zip(names, robot.brain.neurons, strict=True)
        )
        connections = robot.brain.connections
        if self._has_weights:
            connections = tuple(
                replace(edge, weight=_value(self._weight, new[name]))
                for name, edge in zip(edges, connections, strict=True)
            )
        return Robot(robot.parts, Brain(neurons, connections))

    def _shares(self, robot: Robot) -> Shares:
        found: Shares = {}
        for name, own, value in self._values(robot):
            share = (value - own.low) / (own.high - own.low)
            found.setdefault(name, min(max(share, 0.0), 1.0))
        return found

    def _values(self, robot: Robot) -> Iterator[tuple[object, Parameter, float]]:
        names, edges = self._names(robot)
        for name, neuron in zip(names, robot.brain.neurons, strict=True):
            for place, each in enumerate(self._kinds.get(neuron.kind, ())):
                if _is_learnt(each):
                    yield (name, place), each, neuron.parameters[place]
        if self._has_weights:
            for name, edge in zip(edges, robot.brain.connections, strict=True):
                yield name, self._weight, edge.weight


def _is_learnt(own: Parameter) -> bool:
    return own.is_mutable and own.high > own.low


def _value(own: Parameter, share: float) -> float:
    # Rounding must not carry a value out of its range.
    return min(max(own.low + (own.high - own.low) * share, own.low), own.high)
