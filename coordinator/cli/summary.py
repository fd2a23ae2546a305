"""Summary of a finished run: best robots, failures, where the results are."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from statistics import fmean

import pyarrow as pa
import pyarrow.compute as pc

from coordinator.storage.disk import replace_text, storage_errors
from coordinator.storage.folder import read_details
from coordinator.storage.folder_status import births_of
from coordinator.storage.hints import command
from schema.agent.import_path import missing_screen
from schema.agent.log import tell_user, warn_user
from schema.errors import ExperimentError, InvalidRobot, counted, rounded
from schema.experiment.brains import types_of
from schema.experiment.document import (
    Experiment,
    body_space,
    island_count,
    island_experiments,
)
from schema.experiment.file import experiment_from_text
from schema.experiment.fitness_keys import fitness_text
from schema.formats.files import BEST
from schema.formats.yaml import robot_to_yaml
from schema.robot.robot import Robot, motor_count
from schema.tables.description import allow_plugins_of
from schema.tables.files import born_as, read_table
from schema.tables.last_populations import Row, best_ever, best_of, last_populations
from schema.tables.learnt import with_learnt
from schema.wire.born import robot_of_birth
from schema.wire.updates import individual, read_levels

_BEST = "best robot of the last population"


@dataclass(frozen=True, slots=True)
class Conclusion:
    """Summary of a finished run; ``failures``, a line, is empty if none failed."""

    text: str
    failures: str
    has_evaluated: bool


def conclude(folder: Path, experiment: Experiment) -> Conclusion:
    """Write the best robot of the last population; return the summary of a run.

    Raises:
        RunFolderError: a table cannot be read, or the robot cannot be written.
    """
    failures = _failures(folder)
    first, *others = _results(folder, experiment)
    lines = [first, *filter(None, [failures]), *others]
    lines += [f"tables: {folder / 'tables'}", "try next:", *next_steps(folder)]
    return Conclusion("\n".join(lines), failures, has_evaluated(folder))


def restore_best(folder: Path) -> None:
    """Write the best robot of a last population to a file if the file is missing.

    A process that ends after its run, but before the summary, leaves no file. Errors
    are those of ``conclude``.
    """
    if (folder / BEST).exists():
        return
    births = births_of(folder)
    best = _best_here(last_populations(folder), births)
    if best is None:
        return
    try:
        allow_plugins_of(folder, is_resumed=False)
        experiment = experiment_from_text(read_details(folder).document, is_own=True)
        if _is_extinct(folder, experiment, births):
            return
        _, robot = _read_best(folder, best, experiment)
        done = _write_best(robot, folder, experiment)
    except (ExperimentError, InvalidRobot) as error:
        # A finished run needs none of its plug-ins for anything else.
        warn_user(f"{folder}: the file {BEST} is missing and not written: {error}")
        return
    tell_user(f"{folder}: {BEST} was missing; {_BEST}: {done}")


def _is_extinct(
    folder: Path, experiment: Experiment, births: Mapping[int, int]
) -> bool:
    """Return whether all islands of a finished run are extinct arenas.

    ``births``: as of ``births_of``; a group of islands has none of the others. An
    arena with all births of the experiment is not extinct, even if its last robots
    are too few to mate, and neither is one with robots at its ``end_s``.
    """
    owns, names = island_experiments(experiment), ["island", "sim_time_s"]
    islands = {number: owns[number] for number in births}
    if not all(own.arena for own in islands.values()):
        return False
    rows = [read_table(folder, table, names) for table in ("births", "fitness")]
    lived = pa.concat_tables(rows, promote_options="default").group_by("island")
    latest = lived.aggregate([("sim_time_s", "max")]).to_pylist()
    last_s = {row["island"]: row["sim_time_s_max"] for row in latest}
    return all(
        (arena := own.arena) is not None
        and births[number] < own.births
        and not 0.0 < arena.end_s < last_s.get(number, 0.0) + arena.sample_interval_s
        for number, own in islands.items()
    )


def next_steps(folder: Path) -> list[str]:
    """Return commands that show the results; those of the viewer if it is installed."""
    best, steps = folder / BEST, [command("analyze", folder)]
    if find_spec("rerun") is not None:
        saved = ("--save", "run.rrd") if missing_screen() else ()
        steps.insert(0, command("view", folder, *saved))
    elif best.exists():
        steps.insert(0, command("robot", "show", best))
    if best.exists():
        steps.insert(0, command("robot", "render", best, "best.gif"))
    return [f"  {step}" for step in steps]


def _results(folder: Path, experiment: Experiment) -> list[str]:
    """Describe the last recorded population; write its best robot to a file.

    The tables, not the living: robots of an arena have newer windows at the end of a
    run than the last population has, which status and report show.
    """
    here = births_of(folder)
    births = counted(here.total(), "birth")
    if _is_extinct(folder, experiment, here):
        return [f"extinct after {births}: no robot is left that can have a child"]
    islands = island_experiments(experiment)
    last = last_populations(folder)
    best = _best_here(last, here)
    if best is None:
        return [f"{births}; no robot of the last population has a fitness"]
    # As analyses compute it: robots of arenas without a fitness do not count.
    arenas = {number for number, own in enumerate(islands) if own.arena is not None}
    means = [level.mean for level in read_levels(last, arenas) if level.judged]
    mean = f"mean fitness of the last population {rounded(fmean(means))}"
    if len(means) > 1:
        mean += f", the mean over {len(means)} islands"
    return [
        f"{births}; {mean}",
        *judged_apart(islands),
        *_windows(islands),
        *_best_robot(folder, best, experiment),
        *_better_ever(folder, best),
    ]


def judged_apart(islands: Iterable[Experiment]) -> list[str]:
    """Return a line if the fitness of different islands cannot be compared."""
    each: dict[str, list[str]] = {}
    for number, own in enumerate(islands):
        text = fitness_text(own)
        text += " in an arena" * (own.arena is not None)
        each.setdefault(text, []).append(str(number))
    if len(each) == 1:
        return []
    lists = "; ".join(
        f"{text} on {'island' if len(numbers) == 1 else 'islands'} {', '.join(numbers)}"
        for text, numbers in each.items()
    )
    return [f"fitness of different islands is not comparable: {lists}"]


def _best_robot(folder: Path, best: Row, experiment: Experiment) -> list[str]:
    """Describe the robot of a population row; write it to a file."""
    birth, space = individual(best), body_space(experiment.space)
    rank, robot = _read_best(folder, best, experiment)
    is_alone = island_count(experiment) == 1
    where = "" if is_alone else f" of island {birth.island}"
    lives = f" on island {best['island']}" if best["island"] != birth.island else ""
    parts = counted(len(robot.parts), "part")
    motors = counted(motor_count(robot, space), "motor")
    line = f"{_BEST}: birth {birth.number}{where}, fitness {rounded(best['fitness'])}"
    return [
        f"{line}{lives}, rank in ancestry {rank} (founders: 1), {parts}, {motors}",
        _write_best(robot, folder, experiment),
    ]


def _best_here(last: Iterable[Row], births: Mapping[int, int]) -> Row | None:
    """Return the best row of a robot whose birth the tables have.

    They lack those of migrants from another group of islands.
    """
    return best_of(row for row in last if individual(row).island in births)


def _better_ever(folder: Path, best: Row) -> list[str]:
    """Return a line about the best robot ever if it had more fitness than this one."""
    ever = next(best_ever(folder))
    if ever["fitness"] <= best["fitness"]:
        return []
    shown = command("view", folder, "--robot", "best-ever")
    name, fitness = individual(ever).name, rounded(ever["fitness"])
    return [f"best ever: robot {name}, fitness {fitness}: {shown}"]


def _read_best(folder: Path, best: Row, experiment: Experiment) -> tuple[int, Robot]:
    """Return the rank in ancestry and the robot of a population row."""
    where, names = born_as(individual(best)), ["island", "birth", "robot"]
    births = read_table(folder, "births", [*names, "genome", "rank"], where)
    learning = read_table(folder, "learning", names, where)
    (row,) = with_learnt(births, learning).to_pylist()
    return row["rank"], robot_of_birth(row["genome"], row["robot"], experiment)


def _write_best(robot: Robot, folder: Path, experiment: Experiment) -> str:
    """Write the best robot of a run to a file; return a line about the file."""
    file = folder / BEST
    with storage_errors(file):
        try:
            text = robot_to_yaml(robot, *types_of(experiment))
        except InvalidRobot as error:
            # It may be another robot, of an earlier end of the run.
            file.unlink(missing_ok=True)
            return f"it has no file {file}: {error}"
    replace_text(file, text)
    return f"its file: {file}"


def _windows(islands: Iterable[Experiment]) -> list[str]:
    """Return a line about the windows in which robots of arenas were judged, if any."""
    clocks = [own.simulation for own in islands if own.arena is not None]
    seconds = sorted({clock.window_steps * clock.timestep_s for clock in clocks})
    lasts = " or ".join(f"{window_s:g}" for window_s in seconds)
    what = f"a robot's last {lasts} s before the last birth"
    return [f"in arenas fitness is that of {what}"] if seconds else []


def has_evaluated(folder: Path) -> bool:
    """Return whether at least one evaluation of a finished run succeeded."""
    evaluations = read_table(folder, "evaluations", ["status"])
    is_success = pc.not_equal(evaluations["status"], "failed")
    samples = read_table(folder, "fitness", ["record"]).num_rows
    return bool(pc.any(is_success).as_py() or samples)


def _failures(folder: Path) -> str:
    """Return a line about failed evaluations and deaths; empty if there are none."""
    evaluations = read_table(folder, "evaluations", ["status", "reason"])
    failed = evaluations.filter(pc.field("status") == "failed")
    deaths = read_table(folder, "deaths", ["reason", "detail"])
    diverged = deaths.filter(pc.field("reason") == "diverged")
    lines = []
    if failed.num_rows:
        total = counted(evaluations.num_rows, "evaluation")
        counts = f"{failed.num_rows} of {total} failed"
        lines.append(f"{counts}, {_most_frequent(failed['reason'])}")
    if diverged.num_rows:
        counts = f"{diverged.num_rows} of {deaths.num_rows} deaths were failures"
        lines.append(f"{counts}, {_most_frequent(diverged['detail'])}")
    return "; ".join(lines)


def _most_frequent(reasons: pa.ChunkedArray) -> str:
    ((reason, count),) = Counter(reasons.to_pylist()).most_common(1)
    share = "all" if count == len(reasons) else f"{count} of them"
    return f"{share}: {reason}"
