"""Kinds of plug-ins that make genomes: encodings and brain types.

The half of a brain type that ticks belongs to the room of the worker; the commands,
which may import all rooms, give its check.
"""

from collections.abc import Callable, Iterator

import msgspec

from coordinator.evolution import brains, encodings
from coordinator.evolution.check_brain_genes import check_brain_genes
from coordinator.evolution.check_encoding import check_encoding
from schema.experiment.brains import BRAIN_METHODS
from schema.experiment.check import check_experiment
from schema.experiment.document import (
    BrainSection,
    Encoding,
    Experiment,
    island_count,
    island_experiment,
)
from schema.experiment.kinds import Kind, Use
from schema.plugins.load import load_object

_BY_HAND = Experiment(name="check")
"""Experiment in which a plug-in of the command line is checked."""


def _is_class_of(members: tuple[str, ...], plugin: object) -> bool:
    is_class = isinstance(plugin, type)
    return is_class and all(hasattr(plugin, name) for name in members)


def _encoding_use(experiment: Experiment) -> Use:
    """Return the use of an island's encoding."""
    path = experiment.encoding.type

    def load() -> object:
        # What is wrong elsewhere is not this plug-in's fault.
        check_experiment(experiment, experiment.name)
        return load_object(path, encodings.WHERE, encodings.BUILT_IN)

    def check(_: object) -> None:
        encodings.encoding_of(experiment)
        check_encoding(experiment)

    return Use(encodings.WHERE, path, load, check)


def _encodings(experiment: Experiment) -> Iterator[Use]:
    numbers = range(island_count(experiment))
    for own in dict.fromkeys(island_experiment(experiment, each) for each in numbers):
        yield _encoding_use(own)


ENCODING = Kind(
    "encoding",
    encodings.BUILT_IN,
    lambda plugin: _is_class_of(encodings.METHODS, plugin),
    lambda path: _encoding_use(
        msgspec.structs.replace(_BY_HAND, encoding=Encoding(type=path))
    ),
    _encodings,
)


def brain_kind(check_control: Callable[[Experiment], None]) -> Kind:
    """Return the kind of brain types.

    Args:
        check_control: checks the half of a brain type that ticks.
    """

    def use(experiment: Experiment) -> Use:
        brain = experiment.brain

        def load() -> object:
            return load_object(brain.type, "brain.type", brains.BUILT_IN)

        def check(_: object) -> None:
            check_experiment(experiment, "brain.type")
            check_brain_genes(experiment)
            check_control(experiment)

        return Use("brain.type", brain.type, load, check)

    return Kind(
        "brain",
        brains.BUILT_IN,
        lambda plugin: _is_class_of(BRAIN_METHODS, plugin),
        lambda path: use(
            msgspec.structs.replace(_BY_HAND, brain=BrainSection(type=path))
        ),
        lambda experiment: (use(experiment),),
    )
