"""Experiment whose settings apply to a robot file: named, or of the file's run."""

import sys
from pathlib import Path

from schema.errors import ExperimentError
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import (
    Experiment,
    body_space,
    island_count,
    island_experiment,
)
from schema.experiment.file import own_experiment, read_experiment
from schema.experiment.settings import evaluation_settings_of
from schema.formats.files import BEST
from schema.parts import BUILT_IN, BodySpace
from schema.robot.brain import NeuronKinds
from schema.robot.cpg import BUILT_IN_KINDS
from schema.tables.description import DETAILS, allow_plugins_of, read_description
from schema.tables.last_populations import best_of, last_populations


def experiment_of(
    file: Path,
    named: str | None,
    island: int | None = None,
    *,
    tells_default: bool = False,
) -> Experiment | None:
    """Return the settings of a robot file; say on standard error which ones they are.

    Args:
        file: robot file that the user named on the command line. In a run folder, the
            experiment is that of the run, and its plug-ins may be imported as when the
            run is viewed.
        named: experiment that the user named; it comes first.
        island: island that the user named; None is, of the file of a run's best robot,
            the island on which it has its fitness, and of other files island 0.
        tells_default: also say which settings apply if the file is in no run folder.

    Returns:
        The experiment, with the settings of one island; None: the default settings
        apply.

    Raises:
        ExperimentError: an invalid experiment, or no island of that number; a plug-in
            of the run that is missing or not the user's own.
        RunFolderError: the description of the run, or the table of the populations that
            names the best robot's island, is damaged.
    """
    if named:
        experiment = read_experiment(named)
        own = _of_island(experiment, island or 0)
        if island is None and _differs(experiment):
            tell(f"with the settings of {named}, island 0; --island names another")
        return own
    folder = file.parent
    if not (folder / DETAILS).is_file():
        if island is not None:
            raise ExperimentError(
                "--island: the robot file is in no run folder; name an experiment with "
                "islands: --experiment FILE.toml"
            )
        if tells_default:
            tell("with the settings of scenario1; --experiment names others")
        return None
    allow_plugins_of(folder)
    experiment = own_experiment(read_description(folder).document)
    where = f"with the settings of {folder} ({experiment.name})"
    number = island or 0
    if _differs(experiment):
        best = best_of(last_populations(folder)) if file.name == BEST else None
        if island is None and best is not None:
            number = best["island"]
        where += f", island {number}"
        if island is None:
            where += ", where it is the best robot" if best else ""
            where += "; --island names another"
    own = _of_island(experiment, number)
    tell(where)
    return own


def allow_run_of(file: Path) -> None:
    """Allow the plug-ins of the run whose folder holds a robot file, if one does.

    Raises:
        ExperimentError: a plug-in of the run that is missing or not the user's own.
        RunFolderError: the description of the run is damaged.
    """
    if (file.parent / DETAILS).is_file():
        allow_plugins_of(file.parent)
        own_experiment(read_description(file.parent).document)


def _differs(experiment: Experiment) -> bool:
    """Return whether robots are evaluated in different ways on two islands."""
    each = [
        island_experiment(experiment, number)
        for number in range(island_count(experiment))
    ]
    first = (evaluation_settings_of(each[0]), each[0].arena)
    return any((evaluation_settings_of(one), one.arena) != first for one in each[1:])


def _of_island(experiment: Experiment, number: int) -> Experiment:
    try:
        return island_experiment(experiment, number)
    except ValueError as error:
        raise ExperimentError(f"--{error}") from None


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
