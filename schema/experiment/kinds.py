"""Kinds of plug-ins: how one is recognised, what an experiment uses, how it is checked.

Each room lists its kinds; the commands put the lists together.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any

import schema.parts
import schema.robogen_parts
from schema.errors import ExperimentError, RevolveError, error_text, one_line
from schema.experiment.brains import NEURON_MEMBERS, neuron_types
from schema.experiment.document import Experiment, Space, body_space
from schema.parts import PartType
from schema.plugins.load import load_instance, load_object
from schema.plugins.origin import where_defined, where_raised
from schema.plugins.part_checks import advise_shape
from schema.plugins.sensor_checks import check_sensor
from schema.robot.neurons import BUILT_IN_NEURONS


@dataclass(frozen=True, slots=True)
class Use:
    """A plug-in that a key of an experiment names, and its check.

    Attributes:
        key: of the experiment, or the command line, for messages.
        path: short name or ``module:attribute``.
        load: returns the plug-in; raises ``ExperimentError`` if it cannot be had.
        check: takes the plug-in; raises any error if it breaks its contract.
        advise: takes a plug-in that is in order; returns a warning, or nothing.
        check_new: as ``check``, of what versions before did not check: only for a run
            that begins now.
        check_rest: raises ``ExperimentError`` if the rest of a new experiment is wrong,
            for plug-ins that are checked with it; called before ``load``.
    """

    key: str
    path: str
    load: Callable[[], object]
    check: Callable[[Any], None]
    advise: Callable[[Any], str] = lambda _: ""
    check_new: Callable[[Any], None] = lambda _: None
    check_rest: Callable[[], None] = lambda: None


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of plug-in.

    Attributes:
        name: of the kind, such as ``fitness``.
        built_in: objects that ship, by the name that an experiment gives them.
        is_one: whether an object is of this kind.
        by_hand: returns the use of a path, with default parameters.
        used: yields the uses of an experiment, those of its islands included.
    """

    name: str
    built_in: Mapping[str, object]
    is_one: Callable[[object], bool]
    by_hand: Callable[[str], Use]
    used: Callable[[Experiment], Iterable[Use]]


def check_use(
    use: Use, begin: Callable[[str], None] = lambda _: None, *, is_new: bool = False
) -> str:
    """Check a plug-in; return where it is defined.

    Args:
        use: to check.
        begin: called with file and line before the check.
        is_new: also check what only new runs must keep.

    Raises:
        ExperimentError: one line with key, file and line, and what was expected.
    """
    plugin = use.load()
    where = where_defined(plugin)
    begin(where)
    file, _, _ = where.partition(":")
    try:
        use.check(plugin)
        if is_new:
            use.check_new(plugin)
    # A plug-in may call exit().
    except (Exception, SystemExit) as error:
        story = one_line(error)
        if not isinstance(error, RevolveError):
            line = where_raised(error, file) or where
            story = f"{line}: raised {error_text(error)}"
        story = story.removeprefix(f"{use.key}: ")
        section, _, _ = use.key.partition(".")
        if isinstance(error, ExperimentError) and story.startswith(f"{section}."):
            # Of another key, such as the plug-in's parameters: not in its file.
            raise ExperimentError(story) from error
        if f"{file}:" not in story:
            story = f"{where}: {story}"
        raise ExperimentError(f"{use.key}: {story}") from error
    return where


def offered(module: ModuleType, kinds: Iterable[Kind]) -> list[tuple[Kind, str]]:
    """Return the plug-ins that a module offers: kind and attribute, in its order.

    Functions and classes that it imports from other modules are left out.
    """
    found: list[tuple[Kind, str]] = []
    for name, value in vars(module).items():
        home = getattr(value, "__module__", module.__name__)
        is_own = home == module.__name__ or not callable(value)
        kind = kind_of(value, kinds) if is_own and not name.startswith("_") else None
        if kind is not None:
            found.append((kind, name))
    return found


def kind_of(plugin: object, kinds: Iterable[Kind]) -> Kind | None:
    """Return the first kind that an object is of; None if it is of none."""
    return next((kind for kind in kinds if kind.is_one(plugin)), None)


def _part_type(path: str) -> Use:
    key = "space.part_types"

    def check(kind: PartType) -> None:
        # A space needs a core.
        core = () if kind.is_root else ("schema.parts:CORE",)
        body_space(Space(part_types=(*core, path)))

    load = partial(load_instance, path, key, PartType)
    return Use(key, path, load, check, advise_shape)


def _part_types(experiment: Experiment) -> Iterator[Use]:
    for path in experiment.space.part_types:
        yield _part_type(path)


PART_TYPE = Kind(
    "part-type",
    {
        f"{module.__name__}:{name}": value
        for module in (schema.parts, schema.robogen_parts)
        for name, value in vars(module).items()
        if isinstance(value, PartType)
    },
    lambda plugin: isinstance(plugin, PartType),
    _part_type,
    _part_types,
)


def _neuron_type(path: str) -> Use:
    key = "space.neuron_types"

    def check(_: object) -> None:
        neuron_types((path,))

    return Use(key, path, lambda: load_object(path, key, BUILT_IN_NEURONS), check)


def _neuron_types(experiment: Experiment) -> Iterator[Use]:
    for path in experiment.space.neuron_types:
        yield _neuron_type(path)


def _is_neuron_type(plugin: object) -> bool:
    return all(hasattr(plugin, name) for name in NEURON_MEMBERS)


NEURON_TYPE = Kind(
    "neuron-type",
    BUILT_IN_NEURONS,
    _is_neuron_type,
    _neuron_type,
    _neuron_types,
)


def _sensor(path: str) -> Use:
    key = "sensor"

    def load() -> object:
        return load_object(path, key, {}, ("inputs", "read"))

    return Use(key, path, load, lambda sensor: check_sensor(sensor, key))


SENSOR = Kind(
    "sensor",
    {},
    lambda plugin: (
        not isinstance(plugin, type)
        and all(hasattr(plugin, name) for name in ("inputs", "read"))
    ),
    _sensor,
    # Sensors are checked with the part types that hold them.
    lambda _: (),
)
KINDS = (PART_TYPE, NEURON_TYPE, SENSOR)
"""Kinds whose checks need no other room."""
