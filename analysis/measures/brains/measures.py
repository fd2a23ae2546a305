"""Measures of brains: change from parent to child, recurrence, use of sensors."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from analysis.measures.brains.controllers import Controller, controllers
from analysis.measures.diversity.distances import distances_of
from analysis.measures.population_table import Numbers
from schema.robot.brain import NEURON_TYPES
from schema.robot.cpg import BUILT_IN_KINDS
from schema.robot.origins import Name
from schema.robot.trees import Trees

_DEAF = "Oscillator"
"""Type of neurons that ignore their inputs."""
_SPANS = {
    kind: tuple(each.high - each.low for each in parameters)
    for kind, parameters in {**BUILT_IN_KINDS, **NEURON_TYPES}.items()
}
"""Widths of the ranges of the parameters of built-in neurons."""


class Change(NamedTuple):
    """Change of a brain, in elements: neurons and connections.

    Attributes:
        varied: sum over the elements of both brains of their change, 0 to 1 each.
        new: number of elements that only the child has.
        lost: number of elements that only the parent has.
    """

    varied: float
    new: int
    lost: int


def change(child: Controller, parent: Controller) -> Change | None:
    """Return how a brain differs from that of a parent; None without common origin.

    Output neurons, hidden neurons and connections are elements; equal names make them
    one element of both brains. A neuron changes by the mean over its parameters of
    abs(difference) / width of the range, a connection by abs(difference of weight),
    each at most 1. The sum of all three attributes is a metric on brains of one origin.

    Source: own definition, after the compatibility distance of NEAT (Stanley and
    Miikkulainen 2002), whose genes are also matched by origin.
    """
    if not (child.has_origin and parent.has_origin):
        return None
    varied = math.fsum(
        _moved(name[3], values, parent.neurons[name])
        for name, values in child.neurons.items()
        if name in parent.neurons
    )
    varied += math.fsum(
        min(abs(weight - parent.edges[ends]), 1.0)
        for ends, weight in child.edges.items()
        if ends in parent.edges
    )
    new = len(child.neurons.keys() - parent.neurons.keys())
    new += len(child.edges.keys() - parent.edges.keys())
    lost = len(parent.neurons.keys() - child.neurons.keys())
    lost += len(parent.edges.keys() - child.edges.keys())
    return Change(varied, new, lost)


def _moved(kind: str, first: Sequence[float], second: Sequence[float]) -> float:
    """Return the change of a neuron, 0 to 1.

    Parameters of a plug-in's neuron count in their own units.
    """
    if first == second:
        return 0.0
    spans = _SPANS.get(kind) or (1.0,) * len(first)
    moved = [
        abs(one - other) / span if span else 0.0
        for one, other, span in zip(first, second, spans, strict=True)
    ]
    return min(math.fsum(moved) / len(moved), 1.0)


def recurrent(brain: Controller) -> float:
    """Return the share of weight that lies on cycles, 0 to 1; 0 without connections.

    Weights count by their size. Connections to neurons that ignore their inputs, the
    oscillators of the thesis, are left out. A connection of a neuron to itself is a
    cycle.

    Source: own definition.
    """
    edges = _effective(brain)
    after = _reached(edges)
    total = math.fsum(map(abs, edges.values()))
    on_cycles = math.fsum(
        abs(weight)
        for (source, target), weight in edges.items()
        if source in after[target]
    )
    return on_cycles / total if total else 0.0


def sensed(brain: Controller) -> float:
    """Return the share of motors that some sensor can influence; NaN without motors.

    A sensor influences a motor if connections lead from one to the other, and not
    through a neuron that ignores its inputs. Weights of 0 lead nowhere.

    Source: own definition.
    """
    edges = _effective(brain)
    after = _reached(edges)
    motors = {name for name in brain.neurons if name[2] == "output"}
    heard = set[Name]().union(*(after[name] for name in after if name[2] == "input"))
    return len(motors & heard) / len(motors) if motors else math.nan


def _effective(brain: Controller) -> dict[tuple[Name, Name], float]:
    return {
        ends: weight
        for ends, weight in brain.edges.items()
        if weight and ends[1][3] != _DEAF
    }


def _reached(edges: Mapping[tuple[Name, Name], float]) -> dict[Name, set[Name]]:
    """Return the neurons that each neuron leads to, over one edge or more."""
    after: dict[Name, set[Name]] = {}
    for source, target in edges:
        after.setdefault(source, set()).add(target)
        after.setdefault(target, set())
    # Warshall's closure: paths through one neuron after another.
    for middle, beyond in after.items():
        for found in after.values():
            if middle in found:
                found.update(beyond)
    return after


def brain_measures(
    births: pa.Table, parents: Sequence[Sequence[int]], trees: Trees
) -> dict[str, Numbers]:
    """Return the measures of all brains of a run, and distances to first parents.

    Arrays are (B,): changes are NaN without parents or common origin, the others if the
    brain is not known. The first parent is the one whose copy was changed.

    Raises:
        MalformedMessage: the brains cannot be read.
    """
    brains = list(controllers(births))
    names = ("body_change", "brain_varied", "brain_new", "brain_lost", "recurrent",
             "sensed")  # fmt: skip
    columns = np.full((len(names), len(brains)), np.nan)
    children = [row for row, couple in enumerate(parents) if couple]
    firsts = [parents[row][0] for row in children]
    pairs = (trees.tree_of[np.array(rows, np.int64)] for rows in (children, firsts))
    columns[0, children] = distances_of(trees, *pairs)
    for row, first in zip(children, firsts, strict=True):
        child, parent = brains[row], brains[first]
        if child is not None and parent is not None:
            columns[1:4, row] = change(child, parent) or np.nan
    for row, brain in enumerate(brains):
        if brain is not None:
            columns[4:, row] = recurrent(brain), sensed(brain)
    made = dict(zip(names, columns, strict=True))
    return made | {"brain_change": columns[1:4].sum(axis=0)}
