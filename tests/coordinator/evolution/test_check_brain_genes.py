"""The check of genes refuses each breach of the contract, with file and line."""

from pathlib import Path

import numpy as np
import pytest

from coordinator.evolution.check_brain_genes import check_brain_genes
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.errors import ExperimentError
from schema.experiment.document import BrainSection, Experiment
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
        "equal robots from equal random numbers",
    ),
    "Mute": ("outputs(self, draws, part)", "return ()", "no motor"),
    "Doubled": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5, 0.5)),) * 2',
        "valid robots, got brain: output neurons must belong to parts",
    ),
    "Short": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5,)),) * part.outputs',
        "valid robots, got .*Waver takes 2, got 1",
    ),
    "Strange": (
        "grow(self, draws, new, branches, rules)",
        'new[0].hidden = (NeuronGene("Sigmoid", (0.0, 1.0)),)',
        "valid robots, got .*must be one of Waver, got 'Sigmoid'",
    ),
    "Crowded": (
        "grow(self, draws, new, branches, rules)",
        'new[0].hidden = (NeuronGene("Waver", (0.0, 1.0)),) * 11',
        "got brain: hidden neurons must be <= space.max_hidden = 10, got ",
    ),
    "Arrayed": (
        "vary(self, draws, branches, rules, pruned)",
        "branches[0].outputs = np.array(branches[0].outputs)",
        "expected outputs as a tuple of NeuronGene, got a ndarray$",
    ),
    "Paired": (
        "grow(self, draws, new, branches, rules)",
        'new[0].hidden = (("Waver", (0.5, 0.5)),)',
        "expected hidden as a tuple of NeuronGene, got one with a tuple$",
    ),
    "Inside": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", [0.5, 0.5]),) * part.outputs',
        "of NeuronGene, got one with parameters as a list, not a tuple$",
    ),
    "Unconnected": (
        "prune(self, draws, branches, rules)",
        "branches[0].connections = None",
        "expected connections as a tuple of ConnectionGene, got a NoneType$",
    ),
    "Raising": (
        "vary(self, draws, branches, rules, pruned)",
        "branches[99].outputs",
        r"prune and vary to make genes, got IndexError: .* \(broken_raising\.py:7\)$",
    ),
}


@pytest.mark.usefixtures("_own_brains")
@pytest.mark.parametrize("name", list(CASES))
def test_broken_genes_are_refused_in_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    method, body, message = CASES[name]
    module = f"broken_{name.lower()}"
    file = tmp_path / f"{module}.py"
    file.write_text(MODULE.format(name=name, method=method, body=body))
    monkeypatch.setattr(permission, "_allowed", {**permission._allowed, module: file})
    experiment = Experiment(name="x", brain=BrainSection(type=f"{module}:{name}"))
    with pytest.raises(ExperimentError, match=message) as caught:
        check_brain_genes(experiment)
    assert "\n" not in str(caught.value)
    if name != "Mute":
        assert str(caught.value).startswith(f"brain.type: {module}.py:5: expected ")


NEW_CASES = {
    "Twice": (
        "grow(self, draws, new, branches, rules)",
        (
            "new[0].connections = "
            '(ConnectionGene(("output", 0), (), ("output", 0), 0.5),) * 2'
        ),
        "valid robots, got one with a second connection among .*'output', 0",
    ),
    "Beyond": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5, 9.0)),) * part.outputs',
        "valid robots, got Waver must have delay from 0.0 to 1.0, got 9.0$",
    ),
    "Unknown": (
        "outputs(self, draws, part)",
        'return (NeuronGene("Waver", (0.5, float("nan"))),) * part.outputs',
        "valid robots, got ",
    ),
}


@pytest.mark.usefixtures("_own_brains")
@pytest.mark.parametrize("name", list(NEW_CASES))
def test_new_runs_refuse_doubled_connections_and_parameters_beyond_their_range(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that has begun goes on with them."""
    monkeypatch.syspath_prepend(tmp_path)
    method, body, message = NEW_CASES[name]
    file = tmp_path / f"broken_{name.lower()}.py"
    file.write_text(MODULE.format(name=name, method=method, body=body))
    allowed = {**permission._allowed, file.stem: file}
    monkeypatch.setattr(permission, "_allowed", allowed)
    experiment = Experiment(name="x", brain=BrainSection(type=f"{file.stem}:{name}"))
    if name != "Unknown":
        check_brain_genes(experiment)
    with pytest.raises(ExperimentError, match=message):
        check_brain_genes(experiment, is_new=True)


@pytest.mark.parametrize("name", ["network", "cpg"])
def test_built_in_brain_types_pass_as_new(name: str) -> None:
    check_brain_genes(Experiment(name="x", brain=BrainSection(type=name)), is_new=True)


@pytest.mark.usefixtures("_own_brains")
def test_lists_of_genes_become_tuples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs of earlier versions may have such brain types."""
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "broken_listing.py"
    body = 'return [NeuronGene("Waver", (0.5, 0.5))] * part.outputs'
    method = "outputs(self, draws, part)"
    file.write_text(MODULE.format(name="Listing", method=method, body=body))
    allowed = {**permission._allowed, file.stem: file}
    monkeypatch.setattr(permission, "_allowed", allowed)
    brain = BrainSection(type="broken_listing:Listing")
    experiment = Experiment(name="x", brain=brain)
    check_brain_genes(experiment)
    rng = np.random.default_rng(1)
    genome = RevolveAngle(experiment, BUILT_IN, None).random(rng, BirthId(0, 0))
    assert all(isinstance(node.outputs, tuple) for node, _, _ in walk(genome))


@pytest.mark.usefixtures("_own_brains")
def test_sound_genes_pass() -> None:
    own = Experiment(name="x", brain=BrainSection(type="my_brains:Wave"))
    check_brain_genes(own, is_new=True)
