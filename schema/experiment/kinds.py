"""Kinds of plug-ins: how one is recognised, what an experiment uses, how it is checked.

A table in each room lists its kinds; the commands put the tables together.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple

import schema.parts
import schema.robogen_parts
from schema.experiment.brains import neuron_types
from schema.experiment.document import Experiment, Space, body_space
from schema.parts import PartType
from schema.plugins.load import load_object, place_of
from schema.plugins.origin import naming_plugin
from schema.plugins.sensor_checks import check_sensor
from schema.plugins.slot_checks import advise_shape, check_slots_and_sensors
from schema.robot.neurons import BUILT_IN_NEURONS


@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """A kind of plug-in. A *section* is what names one, with its parameters.

    Attributes:
        name: of the kind, such as ``fitness``.
        key: of the experiment that names a plug-in, for messages.
        built_in: objects that ship, by the name that an experiment gives them.
        is_one: whether an object is of this kind.
        sections: of an experiment, those of its islands included.
        load: returns the plug-in of a section; raises ``ExperimentError`` if it cannot
            be had.
        check: raises any error if the plug-in of a section breaks its contract; may
            return a warning.
        section: returns the section of a path, with default parameters; by default the
            path itself.
        path: returns the short name or ``module:attribute`` of a section.
    """

    name: str
    key: str
    built_in: Mapping[str, object]
    is_one: Callable[[object], bool]
    sections: Callable[[Experiment], Iterable[Any]]
    load: Callable[[Any], object]
    check: Callable[[Any], str | None]
    section: Callable[[str], Any] = str
    path: Callable[[Any], str] = str


class Use(NamedTuple):
    """A plug-in that an experiment, or the command line, names."""

    kind: Kind
    section: Any

    @property
    def path(self) -> str:
        """Short name or ``module:attribute``."""
        return self.kind.path(self.section)

    def check(self, begin: Callable[[str], None] = lambda _: None) -> tuple[str, str]:
        """Check the plug-in; return where it is defined, and a warning or nothing.

        ``begin`` is called with file and line before the check.

        Raises:
            ExperimentError: one line with key, file and line, and what was expected.
        """
        plugin = self.kind.load(self.section)
        where = place_of(self.path, plugin)
        begin(where)
        with naming_plugin(self.kind.key, plugin, self.path):
            return where, self.kind.check(self.section) or ""


def uses(experiment: Experiment, kinds: Iterable[Kind]) -> list[Use]:
    """Return the plug-ins of some kinds that an experiment names, each once."""
    named = [Use(kind, at) for kind in kinds for at in kind.sections(experiment)]
    return list(dict.fromkeys(named))


def sections_of(experiment: Experiment, name: str) -> list[Any]:
    """Return the sections of a name of an experiment and of its islands."""
    sections = (getattr(at, name) for at in (experiment, *experiment.islands))
    return [section for section in sections if section is not None]


def offered(module: ModuleType, kinds: Iterable[Kind]) -> list[tuple[Kind, str]]:
    """Return the plug-ins that a module offers: kind and attribute, in its order.

    Functions and classes that it imports from other modules are left out.
    """
    plugins: list[tuple[Kind, str]] = []
    for name, value in vars(module).items():
        home = getattr(value, "__module__", module.__name__)
        is_own = home == module.__name__ or not callable(value)
        kind = kind_of(value, kinds) if is_own and not name.startswith("_") else None
        if kind is not None:
            plugins.append((kind, name))
    return plugins


def kind_of(plugin: object, kinds: Iterable[Kind]) -> Kind | None:
    """Return the first kind that an object is of; None if it is of none."""
    return next((kind for kind in kinds if kind.is_one(plugin)), None)


def takes(count: int, plugin: object) -> bool:
    """Return whether an object is a function of so many arguments."""
    if not inspect.isfunction(plugin):
        return False
    try:
        inspect.signature(plugin).bind(*range(count))
    except TypeError:
        return False
    return True


def has(members: Iterable[str], plugin: object) -> bool:
    """Return whether an object has some attributes."""
    return all(hasattr(plugin, name) for name in members)


def is_class(methods: Iterable[str], plugin: object) -> bool:
    """Return whether an object is a class with some methods."""
    return isinstance(plugin, type) and has(methods, plugin)


def _check_part_type(path: str) -> str:
    kind = _load_part_type(path)
    # A space needs a core.
    core = () if kind.is_root else ("schema.parts:CORE",)
    body_space(Space(part_types=(*core, path)))
    check_slots_and_sensors(kind)
    return advise_shape(kind)


def _load_part_type(path: str) -> PartType:
    return load_object(path, "space.part_types", {}, kind=PartType)


PART_TYPE = Kind(
    "part-type",
    "space.part_types",
    {
        f"{module.__name__}:{name}": value
        for module in (schema.parts, schema.robogen_parts)
        for name, value in vars(module).items()
        if isinstance(value, PartType)
    },
    is_one=lambda plugin: isinstance(plugin, PartType),
    sections=lambda experiment: experiment.space.part_types,
    load=_load_part_type,
    check=_check_part_type,
)


def _check_neuron_type(path: str) -> None:
    neuron_types((path,))


NEURON_TYPE = Kind(
    "neuron-type",
    "space.neuron_types",
    BUILT_IN_NEURONS,
    is_one=partial(has, ("name", "parameters", "states", "step")),
    sections=lambda experiment: experiment.space.neuron_types,
    load=lambda path: load_object(path, "space.neuron_types", BUILT_IN_NEURONS),
    check=_check_neuron_type,
)


def _load_sensor(path: str) -> Any:  # noqa: ANN401 - of any class
    return load_object(path, "sensor", {}, ("inputs", "read"))


SENSOR = Kind(
    "sensor",
    "sensor",
    {},
    is_one=lambda plugin: (
        not isinstance(plugin, type) and has(("inputs", "read"), plugin)
    ),
    # Sensors are checked with the part types that hold them.
    sections=lambda _: (),
    load=_load_sensor,
    check=lambda path: check_sensor(_load_sensor(path)),
)
KINDS = (PART_TYPE, NEURON_TYPE, SENSOR)
"""Kinds whose checks need no other room."""
