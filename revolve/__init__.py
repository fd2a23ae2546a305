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

_HOMES = {
    "Robot": "revolve.robot",
    "RobotOrigin": "schema.robot.archive",
    "Part": "schema.robot.robot",
    "Brain": "schema.robot.brain",
    "Neuron": "schema.robot.brain",
    "Connection": "schema.robot.brain",
    "NeuronGene": "schema.robot.genome",
    "ConnectionGene": "schema.robot.genome",
    "Genome": "revolve.genome",
    "Experiment": "revolve.experiment",
    "Result": "revolve.evaluation",
    "Trace": "schema.robot.trace",
    "evaluate": "revolve.evaluation",
    "simulate": "revolve.evaluation",
    "vet": "revolve.bodies",
    "Report": "schema.robot.results",
    "body_distance": "revolve.bodies",
    "allow": "schema.plugins.permission",
    "needs": "schema.plugins.needs",
    "Run": "revolve.runs",
    "run": "revolve.runs",
    "resume": "revolve.runs",
    "Runs": "revolve.campaign",
    "read": "revolve.campaign",
    "Analysis": "revolve.reports",
    "analyze": "revolve.reports",
    "Arena": "revolve.arena",
    "ArenaListing": "schema.wire.operator",
    "ListedRobot": "schema.wire.operator",
    "Fleet": "revolve.fleet",
    "Parameter": "schema.parts",
    "PartType": "schema.parts",
    "Shape": "schema.parts",
    "Box": "schema.parts",
    "cylinder": "schema.parts",
    "constant_shape": "schema.parts",
    "Slot": "schema.parts",
    "Joint": "schema.parts",
    "Motor": "schema.parts",
    "Sensor": "schema.parts",
    "Tick": "schema.robot.neurons",
    "Widths": "schema.robot.brain",
    "Draws": "schema.plugins.protocols",
    "Branch": "schema.plugins.protocols",
    "BrainRules": "schema.plugins.protocols",
    "SensorView": "schema.plugins.protocols",
    "Selectable": "schema.plugins.protocols",
    "SensorType": "schema.plugins.protocols",
    "NeuronType": "schema.plugins.protocols",
    "BrainType": "schema.plugins.protocols",
    "BrainGenes": "schema.plugins.protocols",
    "BrainControl": "schema.plugins.protocols",
    "Bank": "schema.plugins.protocols",
    "Encoding": "schema.plugins.protocols",
    "Learner": "schema.plugins.protocols",
    "ParentSelection": "schema.plugins.protocols",
    "SurvivorSelection": "schema.plugins.protocols",
    "StatefulSelection": "schema.plugins.protocols",
    "FitnessFunction": "schema.plugins.protocols",
    "MeasureFunction": "schema.plugins.protocols",
    "RevolveError": "schema.errors",
    "ExperimentError": "schema.errors",
    "UnknownPlugin": "schema.errors",
    "InvalidRobot": "schema.errors",
    "RunFolderError": "schema.errors",
    "NetworkError": "schema.errors",
    "FitnessUndefined": "schema.errors",
    "SensorFailed": "schema.errors",
    "SimulationDiverged": "schema.errors",
    "JobRefused": "schema.errors",
}
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
    value = globals()[name] = getattr(import_module(home), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
