"""Experiment whose settings apply to a robot file: named, or of the file's run."""

import sys
from pathlib import Path

from schema.experiment.brains import neuron_kinds
from schema.experiment.document import (
    Experiment,
    body_space,
    island_count,
    island_experiment,
)
from schema.experiment.file import own_experiment, read_experiment
from schema.experiment.settings import evaluation_settings_of
from schema.parts import BUILT_IN, BodySpace
from schema.robot.brain import NeuronKinds
from schema.robot.cpg import BUILT_IN_KINDS
from schema.tables.description import DETAILS, allow_plugins_of, read_description


def experiment_of(
    file: Path, named: str | None, *, tells_default: bool = False
) -> Experiment | None:
    """Return the experiment of a robot file; say on standard error if none was named.

    Args:
        file: robot file that the user named on the command line. In a run folder, the
            experiment is that of the run, and its plug-ins may be imported as when the
            run is viewed.
        named: experiment that the user named; it comes first.
        tells_default: also say which settings apply if the file is in no run folder.

    Returns:
        The experiment; None: the default settings apply.

    Raises:
        ExperimentError: an invalid experiment; a plug-in of the run that is missing or
            not the user's own.
        RunFolderError: the description of the run is damaged.
    """
    if named:
        return read_experiment(named)
    folder = file.parent
    if not (folder / DETAILS).is_file():
        if tells_default:
            tell("with the settings of scenario1; --experiment names others")
        return None
    allow_plugins_of(folder)
    experiment = own_experiment(read_description(folder).document)
    first = island_experiment(experiment, 0)
    where = f"with the settings of {folder} ({experiment.name})"
    if any(
        evaluation_settings_of(island_experiment(experiment, number))
        != evaluation_settings_of(first)
        for number in range(1, island_count(experiment))
    ):
        where += ", island 0; other islands differ: --experiment names others"
    tell(where)
    return first


def types_of(experiment: Experiment | None) -> tuple[BodySpace, NeuronKinds]:
    """Return the part types and neuron types of an experiment; built-in ones of None.

    Raises:
        ExperimentError: a type that cannot be loaded.
    """
    if experiment is None:
        return BUILT_IN, BUILT_IN_KINDS
    kinds = neuron_kinds(experiment.brain, experiment.space)
    return body_space(experiment.space), kinds


def tell(line: str) -> None:
    """Write a line about the settings of a robot file to standard error."""
    sys.stderr.write(f"revolve: {line}\n")
