"""Evolve the bodies and brains of robots: the Python interface.

    import revolve as rv

    robot = rv.Robot.random("scenario1", seed=1)
    result = rv.evaluate(robot, "scenario1")
    run = rv.run("scenario1", seed=1, births=600)

This module is the only one that other code imports. Importing it loads nothing else and
changes no setting of the process; each name is loaded when it is first used.
Simulations, pictures, fleets, runs and analyses have processes of their own, with the
settings of the command ``revolve``, and give the same results to the last bit.
docs/python.md is the tutorial.
"""

from difflib import get_close_matches
from importlib import import_module
from typing import Any

from revolve.strangers import stranger

_NAMES = {
    "revolve.robot": "Robot",
    "schema.robot.archive": "RobotOrigin",
    "schema.robot.robot": "Part",
    "schema.robot.brain": "Brain Neuron Connection Widths",
    "schema.robot.genome": "NeuronGene ConnectionGene",
    "revolve.genome": "Genome",
    "revolve.experiment": "Experiment",
    "revolve.evaluation": "Result evaluate simulate",
    "revolve.simulation": "Simulation Simulations",
    "revolve.gym": "gym",
    "schema.robot.trace": "Trace needs",
    "revolve.bodies": "vet body_distance",
    "schema.robot.results": "Report",
    "schema.plugins.permission": "allow",
    "revolve.runs": "Run run resume",
    "revolve.campaign": "Runs read",
    "revolve.reports": "Analysis analyze",
    "revolve.arena": "Arena",
    "schema.wire.operator": "ArenaListing ListedRobot",
    "revolve.fleet": "Fleet",
    "schema.parts": (
        "Parameter PartType Shape Box cylinder constant_shape Slot Joint Motor Sensor"
    ),
    "schema.robot.neurons": "Tick",
    "schema.plugins.protocols": (
        "Draws Branch BrainRules SensorView Selectable SensorType NeuronType "
        "BrainType BrainGenes BrainControl Bank Encoding Learner ParentSelection "
        "SurvivorSelection StatefulSelection FitnessFunction MeasureFunction"
    ),
    "schema.plugins.arena_rules": (
        "ArenaRules ArenaView Resident Meeting Conception Death Patch Decisions"
    ),
    "schema.errors": (
        "RevolveError ExperimentError UnknownPlugin InvalidRobot RunFolderError "
        "NetworkError FitnessUndefined SensorFailed SimulationDiverged JobRefused"
    ),
}
"""Public names of each module."""
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}
"""Module of each public name."""

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:  # noqa: ANN401 - any public object
    """Load a public name.

    Raises:
        AttributeError: there is no such name; the nearest is named.
        ImportError: a module of another package is in the place of ours.
    """
    # Not public: console scripts of earlier installations call it.
    home = "revolve.command" if name == "main" else _HOMES.get(name)
    if home is None:
        near = get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module 'revolve' has no attribute {name!r}{hint}")
    if line := stranger():
        raise ImportError(line)
    import_module("schema.agent.import_path").check_graphics()
    module = import_module(home)
    value = globals()[name] = module if name == "gym" else getattr(module, name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
