"""The rooms, their packages and imports, read from pyproject.toml and the sources."""

import tomllib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("coordinator", "worker", "analyzer", "analysis", "schema")
"""The last one is imported by all others."""

Arrow = tuple[str, str]
"""Importer and imported: packages or files of one room."""


@dataclass(frozen=True, slots=True)
class Room:
    """What is drawn of a room.

    Attributes:
        name: of the room.
        layers: names of packages and files, the top layer first.
        arrows: (importer, imported) within the room.
        files: number of files of each package; 0 for a file of the room itself.
        composes: packages of other rooms that its ``__main__`` imports.
    """

    name: str
    layers: tuple[tuple[str, ...], ...]
    arrows: frozenset[Arrow]
    files: Mapping[str, int]
    composes: tuple[str, ...]


def rooms() -> list[Room]:
    """Return all rooms as their files and pyproject.toml have them now."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    contracts = {
        contract["containers"][0]: contract["layers"]
        for contract in project["tool"]["importlinter"]["contracts"]
        if contract["type"] == "layers"
    }
    graph = grimp.build_graph(*ROOMS, cache_dir=None)
    found: dict[str, set[str]] = defaultdict(set)
    for module in graph.modules:
        found[_box(module)] |= {
            _box(other) for other in graph.find_modules_directly_imported_by(module)
        }
    return [_room(name, contracts.get(name), found, graph.modules) for name in ROOMS]


def _box(module: str) -> str:
    """Return the package or file of a room that a module is drawn as."""
    return ".".join(module.split(".")[:2])


def _room(
    name: str,
    contract: Sequence[str] | None,
    imports: Mapping[str, set[str]],
    modules: set[str],
) -> Room:
    inside = {
        box.partition(".")[2] for box in imports if box.startswith(f"{name}.")
    } - {"__main__"}
    arrows = frozenset(
        (box, other)
        for box in inside
        for other in inside - {box}
        if f"{name}.{other}" in imports[f"{name}.{box}"]
    )
    layers = (
        [tuple(sorted(part.strip() for part in row.split("|"))) for row in contract]
        if contract
        else _depths(inside, arrows)
    )
    files = {
        box: sum(module.startswith(f"{name}.{box}.") for module in modules)
        for box in inside
    }
    composes = sorted(
        other
        for other in imports.get(f"{name}.__main__", ())
        if other.partition(".")[0] not in (name, ROOMS[-1])
    )
    return Room(name, _untangled(layers, arrows), arrows, files, tuple(composes))


def _depths(boxes: set[str], arrows: frozenset[Arrow]) -> list[tuple[str, ...]]:
    """Return layers of a room without a contract: importers above what they import."""
    depth = dict.fromkeys(boxes, 0)
    for _ in boxes:
        for importer, imported in arrows:
            depth[imported] = max(depth[imported], depth[importer] + 1)
    rows = range(max(depth.values()) + 1)
    return [tuple(sorted(box for box in boxes if depth[box] == row)) for row in rows]


def _untangled(
    layers: Sequence[tuple[str, ...]], arrows: frozenset[Arrow]
) -> tuple[tuple[str, ...], ...]:
    """Return layers with their packages in the order that makes arrows shortest."""

    def cost(order: Sequence[tuple[str, ...]]) -> float:
        centre = {
            box: (place + 0.5) / len(row)
            for row in order
            for place, box in enumerate(row)
        }
        return sum(abs(centre[one] - centre[other]) for one, other in sorted(arrows))

    return min(product(*(tuple(permutations(row)) for row in layers)), key=cost)
