"""The check of genes refuses each breach of the contract, with file and line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from coordinator.evolution.check_brain_genes import check_brain_genes
from coordinator.evolution.kinds import brain_kind
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.errors import ExperimentError
from schema.experiment.document import BrainSection, Experiment
from schema.experiment.kinds import Use
from schema.parts import BUILT_IN
from schema.plugins import permission
from schema.robot.genome import walk
from schema.robot.ids import BirthId

MODULE = """\
import random; import numpy as np
from schema.robot.genome import ConnectionGene, NeuronGene
import my_brains

class {name}(my_brains.Wave):
    def {method}:
        {body}
"""
CASES = {
    "Unfair": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (random.random(), 0.5)),) * part.outputs',
        "random: must return the same twice",
    ),
    "Mute": ("outputs(self, draws, part)", "return ()", "no motor"),
    "Doubled": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5, 0.5)),) * 2',
        "got brain: output neurons must belong to parts",
    ),
    "Short": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5,)),) * part.outputs',
        "must be one of Waver with all of its parameters",
    ),
    "Strange": (
        "grow(self, draws, new, branches, rules)",
        'new[0].hidden = (NeuronGene("Sigmoid", (0.0, 1.0)),)',
        "must be one of Waver with all .* got .*'Sigmoid'",
    ),
    "Crowded": (
        "grow(self, draws, new, branches, rules)",
        'new[0].hidden = (NeuronGene("Waver", (0.0, 1.0)),) * 11',
        "has 11 hidden, outside space.max_hidden = 10",
    ),
    "Paired": (
        "grow(self, draws, new, branches, rules)",
        'new[0].hidden = (("Waver", (0.5, 0.5)),)',
        "hidden: must be a tuple of NeuronGene, got \\('Waver'",
    ),
    "Inside": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", [0.5, 0.5]),) * part.outputs',
        "outputs: must have parameters that are a tuple",
    ),
    "Twice": (
        "grow(self, draws, new, branches, rules)",
        (
            "new[0].connections = "
            '(ConnectionGene(("output", 0), (), ("output", 0), 0.5),) * 2'
        ),
        "connections: must differ in source, path or target, got",
    ),
    "Beyond": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5, 9.0)),) * part.outputs',
        "delay of Waver: must be from 0.0 to 1.0, got 9.0$",
    ),
    "Unknown": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5, float("nan"))),) * part.outputs',
        "delay of Waver: must be from 0.0 to 1.0, got nan",
    ),
    "Arrayed": (
        "vary(self, draws, branches, rules, pruned)",
        "branches[0].outputs = np.array(branches[0].outputs or (1,))",
        "genes must be a tuple, got a ndarray$",
    ),
    "Unconnected": (
        "prune(self, draws, branches, rules)",
        "branches[0].connections = None",
        "genes must be a tuple, got a NoneType$",
    ),
    "Raising": (
        "vary(self, draws, branches, rules, pruned)",
        "branches[99].outputs",
        r"raised IndexError: .* \(broken_raising\.py:7\)$",
    ),
}


@pytest.fixture
def experiment_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, _own_brains: None
) -> Callable[[str, str, str], Experiment]:
    """Return a function that makes an experiment of a changed brain type."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(name: str, method: str, body: str) -> Experiment:
        file = tmp_path / f"broken_{name.lower()}.py"
        file.write_text(MODULE.format(name=name, method=method, body=body))
        permission.allow([str(file)])
        return Experiment(name="x", brain=BrainSection(type=f"{file.stem}:{name}"))

    return write


@pytest.mark.parametrize("name", list(CASES))
def test_broken_genes_are_refused(
    name: str, experiment_of: Callable[[str, str, str], Experiment]
) -> None:
    method, body, message = CASES[name]
    experiment = experiment_of(name, method, body)
    brain = brain_kind(check_brain_genes)
    with pytest.raises(ExperimentError, match=message) as caught:
        Use(brain, experiment).check()
    assert str(caught.value).startswith(f"brain.type: broken_{name.lower()}.py:5: ")


@pytest.mark.parametrize("name", ["network", "cpg"])
def test_built_in_brain_types_pass(name: str) -> None:
    check_brain_genes(Experiment(name="x", brain=BrainSection(type=name)))


def test_lists_of_genes_become_tuples(
    experiment_of: Callable[[str, str, str], Experiment],
) -> None:
    body = 'return [NeuronGene("Waver", (0.5, 0.5))] * part.outputs'
    experiment = experiment_of("Listing", "outputs(self, draws, part)", body)
    check_brain_genes(experiment)
    rng = np.random.default_rng(1)
    genome = RevolveAngle(experiment, BUILT_IN, None).random(rng, BirthId(0, 0))
    assert all(isinstance(node.outputs, tuple) for node, _, _ in walk(genome))


@pytest.mark.usefixtures("_own_brains")
def test_sound_genes_pass() -> None:
    own = Experiment(name="x", brain=BrainSection(type="my_brains:Wave"))
    check_brain_genes(own)
