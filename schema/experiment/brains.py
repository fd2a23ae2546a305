"""Neuron types and brain types that an experiment names, loaded and checked."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar, cast

from msgspec import Struct

from schema.errors import ExperimentError
from schema.experiment.document import BrainSection, Experiment, Space, body_space
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.parts import BodySpace
from schema.plugins.check_neuron_type import check_neuron_type
from schema.plugins.contract import broken
from schema.plugins.load import load_object
from schema.plugins.origin import naming_plugin
from schema.plugins.parameters import read_parameters
from schema.plugins.protocols import BrainType, NeuronType
from schema.robot.brain import NeuronKinds, Widths
from schema.robot.cpg import CpgParameters, cpg_neurons
from schema.robot.modular import MODULE_KINDS, WEIGHT
from schema.robot.neurons import BUILT_IN_NEURONS
from schema.robot.origins import names_of, roles_of
from schema.robot.robot import Robot

Half = TypeVar("Half")

_BRAIN_METHODS = ("outputs", "grow", "prune", "vary", "pack", "bank")
_TYPE = "brain.type"


class NoParameters(Struct, frozen=True):
    """Parameters of a plug-in that declares none."""


Names = Callable[[Robot], tuple[Sequence[object], Sequence[object]]]
"""Returns names of neurons and of connections; equal names are one of both."""


class _BuiltIn(NamedTuple):
    """What coordinator and worker, which have one half each, agree on."""

    parameters: type[Struct]
    neurons: Callable[[Any, tuple[NeuronType, ...]], NeuronKinds]
    weights: tuple[float, float] = (0.0, 1.0)
    names: Names = names_of


def kinds_of(types: Sequence[NeuronType]) -> NeuronKinds:
    """Return the parameters of neuron types by name."""
    return {kind.name: kind.parameters for kind in types}


_BUILT_IN = {
    "network": _BuiltIn(NoParameters, lambda _, types: kinds_of(types)),
    "cpg": _BuiltIn(CpgParameters, lambda parameters, _: cpg_neurons(parameters)),
    "modular": _BuiltIn(
        NoParameters, lambda *_: MODULE_KINDS, (WEIGHT.low, WEIGHT.high), roles_of
    ),
}
_OWN = _BUILT_IN["network"]
"""Weights and names of a user's brain type."""


@lru_cache(maxsize=64)
def neuron_types(names: tuple[str, ...]) -> tuple[NeuronType, ...]:
    """Return the neuron types of an experiment, in its order.

    Raises:
        ExperimentError: no such type, none, two of one name, or a broken contract.
    """
    where = "space.neuron_types"
    types: dict[str, NeuronType] = {}
    for path in names:
        built_in: Mapping[str, NeuronType] = BUILT_IN_NEURONS
        kind: Any = load_object(path, where, built_in)
        if ":" in path:
            with naming_plugin(where, kind, path):
                kind = kind() if isinstance(kind, type) else kind
                check_neuron_type(kind)
        if kind.name in types:
            raise ExperimentError(f"{where}: two types are named {kind.name!r}")
        types[kind.name] = kind
    if not types:
        raise ExperimentError(f"{where}: must name at least one type, got none")
    return tuple(types.values())


def types_of(
    settings: Experiment | EvaluationSettings | ArenaSettings,
) -> tuple[BodySpace, NeuronKinds]:
    """Return the part types and the neuron types that robots may have, by name.

    Raises:
        ExperimentError: no such type, a broken contract, or wrong parameters.
    """
    return body_space(settings.space), neuron_kinds(settings.brain, settings.space)


def neuron_kinds(brain: BrainSection, space: Space) -> NeuronKinds:
    """Return the neuron types that robots may have; errors as of ``types_of``."""
    if ":" in brain.type:
        return _own_brain(brain, space.neuron_types).neurons
    built_in = load_object(brain.type, _TYPE, _BUILT_IN)
    parameters = _parameters(brain, built_in.parameters)
    return built_in.neurons(parameters, neuron_types(space.neuron_types))


def weight_range(brain: BrainSection) -> tuple[float, float]:
    """Return the least and the greatest random weight of a brain type."""
    return _BUILT_IN.get(brain.type, _OWN).weights


def element_names(brain: BrainSection) -> Names:
    """Return what names the neurons and connections of a brain type's robots.

    Robots whose names are equal have them in common: by the origin of their parts, or
    because all robots of the type have them. Elements of one name share their numbers.
    """
    return _BUILT_IN.get(brain.type, _OWN).names


def brain_half(
    brain: BrainSection,
    space: Space,
    built_in: Mapping[str, Callable[[Any, tuple[NeuronType, ...]], Half]],
) -> Half:
    """Return the half of a brain type that one room needs; errors as of ``types_of``.

    ``built_in`` has that half of the built-in types, by short name.
    """
    if ":" in brain.type:
        # An own class has both halves.
        return cast("Half", _own_brain(brain, space.neuron_types))
    half = load_object(brain.type, _TYPE, built_in)
    parameters = _parameters(brain, _BUILT_IN[brain.type].parameters)
    return half(parameters, neuron_types(space.neuron_types))


def widths(space: Space) -> Widths:
    """Return the greatest numbers of neurons in an experiment."""
    return Widths(space.max_inputs, space.max_outputs, space.max_hidden)


@lru_cache(maxsize=64)
def _own_brain(brain: BrainSection, names: tuple[str, ...]) -> BrainType:
    """Return the brain type of a user's module, with its parameters."""
    no_types: Mapping[str, type[BrainType]] = {}
    found = load_object(brain.type, _TYPE, no_types, _BRAIN_METHODS)
    types = neuron_types(names)
    parameters = _parameters(brain, getattr(found, "Parameters", NoParameters))
    with naming_plugin(_TYPE, found, brain.type):
        if not isinstance(found, type):
            raise broken("", "be a class", came=f"a {type(found).__name__}")
        made: BrainType = cast("Any", found)(parameters, types)
        if not made.neurons:
            raise broken("neurons", "name at least one neuron type", came="none")
    return made


def _parameters(brain: BrainSection, kind: type[Struct]) -> Struct:
    return read_parameters(brain.parameters, kind, "brain.parameters")
