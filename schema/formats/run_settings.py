"""Experiment whose settings apply to a robot file: named, or of the file's run."""

import sys
from collections.abc import Callable
from pathlib import Path

from schema.errors import ExperimentError
from schema.experiment.brains import types_of
from schema.experiment.changes import settings_at
from schema.experiment.document import Experiment, island_experiment, island_experiments
from schema.experiment.file import experiment_from_text, read_experiment
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.formats.files import BEST, MJCF_ENDING, check_file, read_robot, settings_of
from schema.formats.packed import packed_experiment
from schema.robot.archive import PACKED
from schema.robot.robot import Robot
from schema.tables.description import DETAILS, allow_plugins_of, read_description
from schema.tables.files import born_as, read_table
from schema.tables.last_populations import Row, best_of, last_populations
from schema.wire.born import birth_point
from schema.wire.updates import individual


def tell(line: str) -> None:
    """Write a line about the settings of a robot file to standard error."""
    sys.stderr.write(f"revolve: {line}\n")


def experiment_of(
    file: Path,
    named: str | Experiment | None,
    island: int | None = None,
    *,
    tells_default: bool = False,
    say: Callable[[str], object] = tell,
) -> Experiment | None:
    """Return the experiment of a robot file, with the settings of one island.

    None: the default settings apply. Arguments and errors are those of
    ``read_with_settings``.
    """
    if named:
        given = read_experiment(named) if isinstance(named, str) else named
        own = _of_island(given, island or 0)
        if island is None and _differs(given):
            say(f"with the settings of {named}, island 0; --island names another")
        return own
    folder = file.parent
    experiment = _experiment_of_run(folder)
    if experiment is None:
        if island is not None:
            name = "name an experiment with islands: --experiment FILE.toml"
            raise ExperimentError(
                f"--island: the robot file is in no run folder; {name}"
            )
        if tells_default:
            say("with the settings of scenario1; --experiment names others")
        return None
    where = f"with the settings of {folder} ({experiment.name})"
    number = island or 0
    best = best_of(last_populations(folder)) if file.name == BEST else None
    if _differs(experiment):
        if island is None and best is not None:
            number = best["island"]
        where += f", island {number}"
        if island is None:
            where += ", where it is the best of the last population" if best else ""
            where += "; --island names another"
    own = _of_island(experiment, number)
    point = _birth_of(folder, best) if own.changes else 0.0
    say(f"{where}; changing settings as at {point:g}" if own.changes else where)
    return settings_at(own, point)


def _birth_of(folder: Path, best: Row | None) -> float:
    """Return the point at which the best robot of a run was born; 0 of another one."""
    if best is None:
        return 0.0
    births = read_table(folder, "births", where=born_as(individual(best)))
    return birth_point(births.to_pylist()[0])


def read_with_settings(
    file: Path,
    named: str | Experiment | None,
    island: int | None = None,
    *,
    tells_default: bool = False,
    say: Callable[[str], object] = tell,
) -> tuple[Robot, EvaluationSettings, Experiment | None]:
    """Return a file's robot, its evaluation settings and their experiment.

    A run folder stands for its file ``best.yaml``, if it has one. An MJCF file and a
    packed robot hold their settings: they apply unless the user named an experiment,
    also in the folder of a run. There, other files have the experiment of the run, and
    its plug-ins may be imported as when the run is viewed. An island that is not named
    is, of ``best.yaml`` of a run, that on which it has its fitness, and of other files
    island 0. Of an MJCF file's own settings and of the default ones, the experiment is
    None. ``say`` gets a line about the settings; if ``tells_default``, also of the
    default ones.

    Raises:
        RevolveError: no well-formed robot in the file; an invalid experiment, island or
            plug-in; a damaged description or table of the run.
    """
    if (file / BEST).is_file():
        file /= BEST
    # First: nothing is said about the settings of a file that is not there.
    ending = check_file(file)
    if ending == MJCF_ENDING and named is None and island is None:
        # MuJoCo is imported only if needed: it is slow to load.
        from schema.formats.mjcf import read_mjcf  # noqa: PLC0415

        of_run = _experiment_of_run(file.parent)
        robot, settings = read_mjcf(file)
        if of_run or tells_default:
            say(f"with the settings in {file}; --experiment names others")
        return robot, settings, None
    if ending == PACKED and not named:
        found: Experiment | None = _of_island(packed_experiment(file), island or 0)
        say(f"with the settings in {file}; --experiment names others")
    else:
        found = experiment_of(file, named, island, tells_default=tells_default, say=say)
    robot = read_robot(file, *(types_of(found) if found else ()))
    return robot, settings_of(found), found


def _experiment_of_run(folder: Path) -> Experiment | None:
    """Return the experiment of a run, whose plug-ins are allowed; None: no run."""
    if not (folder / DETAILS).is_file():
        return None
    allow_plugins_of(folder)
    return experiment_from_text(read_description(folder).document, is_own=True)


def _differs(experiment: Experiment) -> bool:
    """Return whether robots are evaluated in different ways on two islands."""
    each = island_experiments(experiment)
    first = (evaluation_settings_of(each[0]), each[0].arena)
    return any((evaluation_settings_of(one), one.arena) != first for one in each[1:])


def _of_island(experiment: Experiment, number: int) -> Experiment:
    try:
        return island_experiment(experiment, number)
    except ValueError as error:
        raise ExperimentError(f"--{error}") from None
