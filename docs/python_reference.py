"""Write the reference of the Python API, docs/reference.md, from its docstrings.

python -m docs.python_reference
"""

import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from types import FunctionType, ModuleType

import revolve
from docs.struct_tables import linked

PAGE = Path(__file__).parent / "reference.md"
_HEAD = """# Reference of the Python interface

Written from the docstrings by `python -m docs.python_reference`. [Python](python.md)
is the introduction.

"""
_GROUPS = {
    "Runs and what they made": "run resume read Run Runs analyze Analysis",
    "Robots": "Robot Part Brain Neuron Connection Widths RobotOrigin vet body_distance",
    "Evaluation and simulation": (
        "evaluate simulate Fleet Result Report Trace Simulation Simulations gym"
    ),
    "Experiments and permission": "Experiment allow needs",
    "Genomes": "Genome NeuronGene ConnectionGene",
    "Arenas that run": "Arena ArenaListing ListedRobot",
    "Fitness, measures and selection of your own": (
        "FitnessFunction MeasureFunction ParentSelection SurvivorSelection "
        "StatefulSelection Selectable"
    ),
    "Parts and sensors of your own": (
        "PartType Parameter Shape Box cylinder constant_shape Slot Joint Motor Sensor "
        "SensorType SensorView"
    ),
    "Brains, encodings and learners of your own": (
        "BrainType BrainGenes BrainRules BrainControl Bank NeuronType Tick Encoding "
        "Draws Branch Learner"
    ),
    "Rules of arenas of your own": (
        "ArenaRules ArenaView Resident Meeting Conception Death Patch Decisions"
    ),
    "Errors": (
        "RevolveError ExperimentError UnknownPlugin InvalidRobot RunFolderError "
        "NetworkError FitnessUndefined SensorFailed SimulationDiverged JobRefused"
    ),
}
"""Public names by what one does with them."""
_LISTS = ("Args", "Attributes", "Raises")
_TEXTS = ("Returns", "Yields")
"""Parts of a docstring: lists of names with a text each, and mere texts."""
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


def reference() -> str:
    """Return the page."""
    grouped = " ".join(_GROUPS.values()).split()
    assert sorted(grouped) == dir(revolve), "each public name has one group"
    contents = [
        f"- [{title}](#{_anchor(title)}): {_links(names)}"
        for title, names in _GROUPS.items()
    ]
    lines = [*contents, ""]
    for title, names in _GROUPS.items():
        lines += [f"## {title}", ""]
        lines += (line for name in names.split() for line in _entry(name, revolve))
    return _HEAD + linked("\n".join(lines))


def _links(names: str) -> str:
    """Return names as links to their entries."""
    return ", ".join(f"[`{name}`](#{_anchor(name)})" for name in names.split())


def _anchor(title: str) -> str:
    """Return the anchor of a heading; a class comes after the function of its name."""
    anchor = title.lower().replace(",", "").replace(" ", "-")
    return f"{anchor}-1" if title != anchor and anchor in dir(revolve) else anchor


def _entry(name: str, module: ModuleType) -> Iterator[str]:
    """Yield the lines about a public name of a module."""
    found = getattr(module, name.rpartition(".")[2])
    yield f"### `{name}`"
    if inspect.ismodule(found):
        yield from ("", inspect.getdoc(found) or "", "")
        for inner in found.__all__:
            if callable(getattr(found, inner)):
                yield from _entry(f"{name}.{inner}", found)
        return
    yield from _text(found, f"{name}{_signature(found)}")
    if not inspect.isclass(found) or issubclass(found, Exception):
        return
    for key, member in sorted(vars(found).items()):
        # That of a protocol says what a function of the user gets and returns.
        is_private = key.startswith("_") and key != "__call__"
        if is_private or not inspect.getdoc(member):
            continue
        own = getattr(found, key)
        if isinstance(member, property | cached_property):
            yield from (f"#### `{name}.{key}`", inspect.getdoc(member) or "", "")
        elif isinstance(member, FunctionType | classmethod):
            yield f"#### `{name}.{key}`"
            yield from _text(own, f"{name}.{key}{_signature(own)}")


def _text(found: object, call: str) -> Iterator[str]:
    """Yield call and docstring of a name as Markdown."""
    yield from ("```", call, "```", "")
    for block in (inspect.getdoc(found) or "").replace("``", "`").split("\n\n"):
        title, _, rest = block.partition("\n")
        if title.rstrip(":") in _LISTS and title.endswith(":"):
            yield from (f"**{title.rstrip(':')}**", "")
            yield from map(_item, re.split(r"\n(?= {4}\S)", rest))
        elif title.rstrip(":") in _TEXTS and title.endswith(":"):
            yield f"**{title.rstrip(':')}**: {' '.join(rest.split())}"
        else:
            yield block
        yield ""


def _item(entry: str) -> str:
    """Return an entry of a list of a docstring as an item of Markdown."""
    names, _, text = " ".join(entry.split()).partition(": ")
    shown = ", ".join(f"`{name}`" for name in names.split(", "))
    return f"- {shown}: {text}"


def _signature(found: object) -> str:
    """Return the signature of a function or class; empty for an error or a protocol."""
    if inspect.isclass(found) and (
        issubclass(found, Exception) or getattr(found, "_is_protocol", False)
    ):
        return ""
    assert callable(found)
    signature = inspect.signature(found)
    plain = [
        each.replace(annotation=inspect.Parameter.empty)
        for each in signature.parameters.values()
        if each.name != "self"
    ]
    without = signature.replace(
        parameters=plain, return_annotation=inspect.Signature.empty
    )
    return _ADDRESS.sub("", str(without))


if __name__ == "__main__":
    PAGE.write_text(reference(), "utf-8")
