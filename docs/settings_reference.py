"""Text of docs/reference/settings.md: every key of an experiment, from its Structs."""

from collections.abc import Iterator
from inspect import getsourcefile
from itertools import chain
from pathlib import Path

import msgspec.inspect as kinds
from msgspec import Struct

from coordinator.evolution.kinds import KINDS as COORDINATOR_KINDS
from docs.struct_tables import introduction, linked, rows
from schema.experiment.document import Experiment, Islands
from schema.experiment.kinds import KINDS as SCHEMA_KINDS
from schema.experiment.kinds import Kind
from schema.experiment.robust import Calibration
from schema.experiment.section import Section
from schema.experiment.sweep import Range
from schema.parts import PartType
from schema.plugins.parameters import parameters_type
from schema.robot.cpg import CpgParameters
from worker.kinds import KINDS as WORKER_KINDS

_TOP = Path(__file__).parents[1]
_HEAD = """# Settings of experiments

Written from the code by `python -m docs.reference_pages`.
[Experiments](../experiments.md) is the introduction.

The TOML file of an experiment has the settings that may change a birth; this page lists
its keys. All other settings, such as the number of workers, are flags of the
[commands](commands.md). Seeds and points of a sweep are below 2^63.
The unit 1 stands for shares, factors and other numbers without a dimension. Besides the
limits of single keys, a run checks that the values of different keys fit together; the
error names a key that does not fit.

"""
_KEYS = {
    "part-type": "`space.part_types`",
    "neuron-type": "`space.neuron_types`",
    "fitness": "`fitness.function`",
    "measure": "`measures.names`",
    "encoding": "`encoding.type`",
    "parents": "`selection.parents`",
    "survivors": "`selection.survivors`",
    "learner": "`learning.learner`",
}


def page() -> str:
    """Return the page."""
    return _HEAD + "\n".join(chain(_sections(), _plugins())).rstrip() + "\n"


def sections() -> dict[type[Section], str]:
    """Return the sections of an experiment, with the name of their table in TOML."""
    found: dict[type[Section], str] = {Experiment: ""}
    waiting: list[type[Section]] = [Experiment]
    while waiting:
        outer = waiting.pop(0)
        for field in kinds.type_info(outer).fields:  # type: ignore[attr-defined]
            for inner in _structs(field.type):
                if inner not in found:
                    path = f"{found[outer]}.{field.encode_name}".lstrip(".")
                    found[inner] = path
                    waiting.append(inner)
    # An inner section comes after its outer one.
    order = [name.partition(".")[0] for name in found.values()]
    return dict(
        sorted(found.items(), key=lambda item: order.index(item[1].partition(".")[0]))
    )


def _structs(kind: kinds.Type) -> Iterator[type[Section]]:
    """Yield the sections that a type holds."""
    if isinstance(kind, kinds.StructType):
        yield kind.cls  # type: ignore[misc]
    inner = (getattr(kind, name, None) for name in ("item_type", "value_type"))
    for each in (*getattr(kind, "types", ()), *filter(None, inner)):
        yield from _structs(each)


def _title(section: type, names: dict[type[Section], str]) -> str:
    name = names[section]
    if section in (Islands, Calibration):
        return f"[[{name}]]"
    if section is Range:
        return f"[{name}.KEY]"
    return f"[{name}]" if name else "Keys before the first section"


def _sections() -> Iterator[str]:
    names = sections()

    def link(section: type) -> str:
        title = _title(section, names)
        return f"[`{title}`](#{title.strip('[]').replace('.', '')})"

    for section, name in names.items():
        title = _title(section, names)
        yield f"## `{title}`\n" if name else f"## {title}\n"
        yield f"{linked(introduction(section), '../')}\n"
        yield f"In the code: {_place(section)}.\n"
        yield from rows(section, link)


def _place(found: type) -> str:
    """Return a link to the file where a class is defined."""
    file = Path(getsourcefile(found) or "").relative_to(_TOP)
    return f"`{found.__name__}` in [{file}](../../{file})"


def _plugins() -> Iterator[str]:
    """Yield the built-in plug-ins and the tables of their parameters."""
    every = {
        kind.name: kind for kind in (*SCHEMA_KINDS, *WORKER_KINDS, *COORDINATOR_KINDS)
    }
    yield "## Names of built-in plug-ins\n"
    yield (
        'Each of these keys also takes a plug-in of your own, `"module:attribute"`. '
        "`revolve plugins` lists all that are installed.\n"
    )
    yield "| key | name | what it is |"
    yield "|---|---|---|"
    for kind, key in _KEYS.items():
        names: dict[int, str] = {}
        for name, plugin in every[kind].built_in.items():
            first = names.setdefault(id(plugin), name)
            about = _about(plugin) if first == name else f"another name of `{first}`"
            yield f"| {key} | `{name}` | {about} |"
    yield ""
    tables: list[tuple[str, str, type[Struct]]] = [
        *_with_parameters(every["fitness"], "fitness.parameters"),
        *_with_parameters(every["measure"], "measures.parameters.NAME"),
        *_with_parameters(every["survivors"], "selection.survivors_parameters"),
        *_with_parameters(every["encoding"], "encoding.parameters"),
        *_with_parameters(every["learner"], "learning.parameters"),
        ("brain.parameters", "cpg", CpgParameters),
    ]
    for table, name, parameters in tables:
        yield f"### `[{table}]` of `{name}`\n"
        yield from rows(parameters, lambda found: found.__name__)


def _about(plugin: object) -> str:
    """Return what a cell says about a built-in plug-in."""
    if isinstance(plugin, PartType):
        return (
            f"part; slots: {plugin.arity}, sensor inputs: {plugin.inputs}, motors: "
            f"{plugin.outputs}"
        )
    if not callable(plugin):
        names = [each.name for each in plugin.parameters]  # type: ignore[attr-defined]
        formula = "[formula](../brains.md#the-network-of-the-thesis)"
        return f"neuron with parameters {', '.join(names)}; {formula}"
    text = introduction(plugin).partition("\n\n")[0].replace("\n", " ")
    return text.replace("|", "\\|")


def _with_parameters(kind: Kind, table: str) -> Iterator[tuple[str, str, type[Struct]]]:
    """Yield the built-in plug-ins of a kind that have parameters of their own."""
    for name, plugin in kind.built_in.items():
        parameters = _parameters(kind, name, plugin)
        if parameters is not None:
            yield table, name, parameters


def _parameters(kind: Kind, name: str, plugin: object) -> type[Struct] | None:
    """Return the Struct of a built-in plug-in's own parameters; None if it has none."""
    found: type[Struct] | None = getattr(plugin, "Parameters", None)
    if kind.name in ("fitness", "measure"):
        assert callable(plugin)
        found = parameters_type(plugin, name)
    return None if found is None or issubclass(found, Section) else found
