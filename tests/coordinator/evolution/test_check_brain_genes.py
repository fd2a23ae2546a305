"""The check of genes refuses each breach of the contract, with file and line."""

from collections.abc import Callable

import numpy as np
import pytest

from coordinator.evolution.check_encoding import check_brain_genes
from coordinator.evolution.kinds import brain_kind
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.errors import ExperimentError
from schema.experiment.document import BrainSection, Experiment, Space
from schema.experiment.kinds import Use
from schema.parts import BUILT_IN
from schema.robot.genome import walk
from schema.robot.ids import BirthId

MODULE = """\
import random; import numpy as np
from schema.robot.genome import ConnectionGene, NeuronGene
import my_brains

class Broken(my_brains.Wave):
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
    "Arrayed": (
        "vary(self, draws, branches, rules, pruned)",
        "branches[0].outputs = np.array(branches[0].outputs or (1,))",
        "genes must be a tuple, got a ndarray$",
    ),
    "Raising": (
        "vary(self, draws, branches, rules, pruned)",
        "branches[99].outputs",
        r"raised IndexError: .* \(\w+\.py:7\)$",
    ),
}


@pytest.fixture
def experiment_of(
    own_module: Callable[[str], str], _own_brains: None
) -> Callable[[str, str], Experiment]:
    """Return a function that makes an experiment of a changed brain type."""

    def write(method: str, body: str) -> Experiment:
        name = own_module(MODULE.format(method=method, body=body))
        return Experiment(name="x", brain=BrainSection(type=f"{name}:Broken"))

    return write


@pytest.mark.parametrize("name", list(CASES))
def test_broken_genes_are_refused(
    name: str, experiment_of: Callable[[str, str], Experiment]
) -> None:
    method, body, message = CASES[name]
    experiment = experiment_of(method, body)
    brain = brain_kind(check_brain_genes)
    with pytest.raises(ExperimentError, match=message) as caught:
        Use(brain, experiment).check()
    file = experiment.brain.type.replace(":Broken", ".py")
    assert str(caught.value).startswith(f"brain.type: {file}:5: ")


@pytest.mark.usefixtures("_own_brains")
@pytest.mark.parametrize("name", ["network", "cpg", "modular", "my_brains:Wave"])
def test_sound_brain_types_pass(name: str) -> None:
    brain, space = BrainSection(type=name), Space(max_hidden=60)
    check_brain_genes(Experiment(name="x", brain=brain, space=space))


def test_lists_of_genes_become_tuples(
    experiment_of: Callable[[str, str], Experiment],
) -> None:
    body = 'return [NeuronGene("Waver", (0.5, 0.5))] * part.outputs'
    experiment = experiment_of("outputs(self, draws, part)", body)
    check_brain_genes(experiment)
    rng = np.random.default_rng(1)
    genome = RevolveAngle(experiment, BUILT_IN, None).random(rng, BirthId(0, 0))
    assert all(isinstance(node.outputs, tuple) for node, _, _ in walk(genome))
