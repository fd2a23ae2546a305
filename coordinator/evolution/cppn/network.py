"""Compositional pattern producing networks: genes, evaluation, bytes.

A network maps two points to numbers. Its functions use only exactly rounded arithmetic
and no library function, so that every machine gets the same numbers.
Source: Stanley, 2007, Compositional pattern producing networks; the functions are own
approximations of his sine, Gaussian and sigmoid.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Literal

import msgspec
import numpy as np
from msgspec import Struct

from schema.robot.trace import Floats

INPUTS = ("bias", "x1", "y1", "z1", "n1", "x2", "y2", "z2", "n2", "distance")
"""Inputs: 1; two points with a number each; distance of the second from the origin."""
GREATEST_WEIGHT = 3.0
_GREATEST_SUM = 100.0
_FORM = "cppn-1"


def _wave(a: Floats) -> Floats:
    """Return a wave of period 2, parabolas in place of sin(pi a)."""
    w = a - 2.0 * np.floor(0.5 * (a + 1.0))
    waved: Floats = 4.0 * w * (1.0 - np.abs(w))
    return waved


def _bell(a: Floats) -> Floats:
    """Return 1 at 0, falling to 0 on both sides."""
    return 1.0 / (1.0 + a * a)


def _saturating(a: Floats) -> Floats:
    """Return a number in (-1, 1), 0 at 0."""
    return a / (1.0 + np.abs(a))


FUNCTIONS: dict[str, Callable[[Floats], Floats]] = {
    "line": lambda a: a,
    "wave": _wave,
    "bell": _bell,
    "saturating": _saturating,
    "absolute": np.abs,
}
"""Functions of hidden nodes, of the weighted sum of their inputs."""


class HiddenNode(Struct, frozen=True, array_like=True):
    """Hidden node; ``id`` is its historical marking."""

    id: str
    function: str


class Link(Struct, frozen=True, array_like=True):
    """Connection of two nodes; both together are its historical marking."""

    source: str
    target: str
    weight: float
    is_enabled: bool = True

    @property
    def marking(self) -> tuple[str, str]:
        """Source and target."""
        return self.source, self.target


class CppnGenome(Struct, frozen=True, array_like=True):
    """Genome: a network without cycles, of nodes by id, and of links by their ends."""

    nodes: tuple[HiddenNode, ...]
    links: tuple[Link, ...]


_DECODER = msgspec.msgpack.Decoder(tuple[Literal["cppn-1"], CppnGenome])


def evaluate(
    network: CppnGenome, inputs: Mapping[str, Floats], outputs: Sequence[str]
) -> dict[str, Floats]:
    """Return named outputs of a network for N queries: (N,) of each of ``INPUTS``.

    They are (N,), in (-1, 1); 0 without enabled connections.
    """
    functions = {node.id: FUNCTIONS[node.function] for node in network.nodes}
    sources: dict[str, list[Link]] = {}
    for link in network.links:
        if link.is_enabled:
            sources.setdefault(link.target, []).append(link)
    values = dict(inputs)
    none = np.zeros_like(inputs["bias"])

    def value(name: str) -> Floats:
        if name not in values:
            total = none
            for link in sources.get(name, ()):
                total = total + link.weight * value(link.source)
            # Limited, so that chains of nodes cannot overflow.
            total = np.minimum(np.maximum(total, -_GREATEST_SUM), _GREATEST_SUM)
            values[name] = functions.get(name, _saturating)(total)
        return values[name]

    return {name: value(name) for name in outputs}


def queries(first: Floats, second: Floats) -> dict[str, Floats]:
    """Return the inputs for N pairs of points, (N, 4) each.

    A point has x, y and z in units of 0.1 m, core frame, and the number of a neuron.
    """
    x, y, z, _ = second.T
    columns = (np.ones(len(first)), *first.T, *second.T, np.sqrt(x * x + y * y + z * z))
    return dict(zip(INPUTS, columns, strict=True))


def reaches(links: Sequence[Link], start: str, goal: str) -> bool:
    """Return whether links, enabled or not, lead from one node to another."""
    targets: dict[str, list[str]] = {}
    for link in links:
        targets.setdefault(link.source, []).append(link.target)
    seen, stack = {start}, [start]
    while stack:
        here = stack.pop()
        if here == goal:
            return True
        new = [each for each in targets.get(here, ()) if each not in seen]
        seen.update(new)
        stack += new
    return False


def to_bytes(network: CppnGenome) -> bytes:
    """Return a network as bytes (MessagePack)."""
    return msgspec.msgpack.encode((_FORM, network))


def from_bytes(data: bytes, outputs: Sequence[str]) -> CppnGenome:
    """Return the network that `to_bytes` wrote; it may have all named outputs.

    Raises:
        ValueError: other bytes, or a network that breaks a rule of its type.
    """
    _, network = _DECODER.decode(data)
    for problem in _problems(network, outputs):
        raise ValueError(problem)
    return network


def _problems(network: CppnGenome, outputs: Sequence[str]) -> Iterator[str]:
    ids = [node.id for node in network.nodes]
    if ids != sorted(set(ids)) or {*ids} & {*INPUTS, *outputs}:
        yield "hidden nodes: must be sorted by id, each once, apart from all others"
    for node in network.nodes:
        if node.function not in FUNCTIONS:
            allowed = ", ".join(FUNCTIONS)
            yield f"node {node.id}: must be one of {allowed}, got {node.function!r}"
    markings = [link.marking for link in network.links]
    if markings != sorted(set(markings)):
        yield "connections: must be sorted by source and target, each once"
    sources, targets = {*INPUTS, *ids}, {*ids, *outputs}
    for link in network.links:
        if link.source not in sources or link.target not in targets:
            yield f"connection {link.marking}: leads from or to no node of its own"
        if not abs(link.weight) <= GREATEST_WEIGHT:
            yield (
                f"connection {link.marking}: weight must be in [-{GREATEST_WEIGHT}, "
                f"{GREATEST_WEIGHT}], got {link.weight}"
            )
        if reaches(network.links, link.target, link.source):
            yield f"connection {link.marking}: is part of a cycle"
