"""Protocol of the suite: what it fixes, and experiments that obey it."""

import tomllib
from hashlib import sha256
from importlib import resources
from typing import Any

import msgspec

from revolve.experiment import Experiment
from schema.errors import ExperimentError, shown
from schema.experiment.file import read_experiment

_REFUSED = ("arena", "islands", "sweep", "founders", "changes", "robust", "calibration")
"""Sections that no experiment of the suite has."""


class Protocol(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Protocol of one version of the suite.

    Attributes:
        version: number of the version.
        seed: random seed of all runs.
        repeats: number of runs of each task.
        births: number of births of each run, founders included.
        later_windows: number of fitness windows after the first one.
        tasks: sections of each task, which replace those of the experiment.
        fixed: sections that the experiment must have like this.
    """

    version: int
    seed: int
    repeats: int
    births: int
    later_windows: int
    tasks: dict[str, dict[str, dict[str, Any]]]
    fixed: dict[str, dict[str, Any]]

    @property
    def digest(self) -> str:
        """SHA-256 of all values; comments of the file do not count."""
        return sha256(msgspec.json.encode(self, order="sorted")).hexdigest()


def read_protocol() -> Protocol:
    """Return the protocol of the newest version, as shipped."""
    file = resources.files("revolve.suite") / "version1.toml"
    return msgspec.convert(tomllib.loads(file.read_text("utf-8")), Protocol)


def obeying(
    protocol: Protocol, experiment: Experiment, where: str
) -> dict[str, Experiment]:
    """Return an experiment, named ``where``, on each task, by the task's name.

    Raises:
        ExperimentError: a section or a value that the suite does not allow, or values
            that contradict those of a task.
    """
    settings, suite = experiment.settings, f"version {protocol.version} of the suite"
    for section in filter(settings.get, _REFUSED):
        raise ExperimentError(f"{where}: {section}: must be absent in {suite}")
    for section, fixed in protocol.fixed.items():
        for key, value in (fixed | settings[section]).items():
            # Of the space only neuron types belong to the experiment.
            if value != (allowed := fixed.get(key)) and key != "neuron_types":
                rule = f"must be {shown(allowed)} in {suite}, got {shown(value)}"
                raise ExperimentError(f"{where}: {section}.{key}: {rule}")
    own = settings | {"births": protocol.births}
    return {
        task: Experiment(
            read_experiment(own | sections | {"name": task}, f"{where} on {task}")
        )
        for task, sections in protocol.tasks.items()
    }
