"""What a finished run comes to: the best robot, what failed, and where all is."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from coordinator.arena.arena import Arena
from coordinator.evolution.selection import fittest_first
from coordinator.islands.island import Island
from coordinator.storage.hints import command
from schema.experiment.document import Experiment, body_space
from schema.formats.files import write_robot
from schema.robot.genome import develop
from schema.tables.files import read_table

BEST = "best.yaml"


@dataclass(frozen=True, slots=True)
class Conclusion:
    """What a finished run comes to.

    Attributes:
        text: what there is to see.
        failures: a line on who could not be judged; empty if all could.
        is_judged: somebody could.
    """

    text: str
    failures: str
    is_judged: bool


def conclude(
    folder: Path, experiment: Experiment, islands: Mapping[int, Island | Arena]
) -> Conclusion:
    """Write the best robot of all islands to a file; return what there is to see.

    Args:
        folder: of the run; its tables are there.
        experiment: what was run.
        islands: finished, by their numbers.

    Raises:
        RunFolderError: a table cannot be read, or the robot not be written.
    """
    told, is_judged = failures(folder)
    lines = [*_results(folder, experiment, islands), f"tables: {folder / 'tables'}"]
    if told:
        lines.insert(1, told)
    lines.append("try next:")
    if (folder / BEST).exists():
        lines.append(f"  {command('robot', 'render', folder / BEST, 'best.gif')}")
    lines += [f"  {command(what, folder)}" for what in ("view", "analyze")]
    return Conclusion("\n".join(lines), told, is_judged)


def _results(
    folder: Path, experiment: Experiment, islands: Mapping[int, Island | Arena]
) -> list[str]:
    """Return lines on the last population; its best robot goes to a file."""
    births = sum(island.births for island in islands.values())
    extinct = [
        number
        for number, island in sorted(islands.items())
        if isinstance(island, Arena) and island.is_extinct
    ]
    if len(extinct) == len(islands):
        return [f"after {births} births too few are left to mate"]
    judged = [
        one
        for number, island in sorted(islands.items())
        if number not in extinct
        for one in island.judged
    ]
    if not judged:
        return [f"{births} births; nobody of the last population has been judged"]
    best = fittest_first(judged)[0]
    mean = sum(one.fitness for one in judged) / len(judged)
    space = body_space(experiment.space)
    robot = develop(best.genome, space)
    write_robot(robot, folder / BEST, space)
    motors = sum(space[part.kind].outputs for part in robot.parts)
    where = f" of island {best.birth.island}" if len(islands) > 1 else ""
    return [
        f"{births} births; mean fitness of the last population {mean:.4f}",
        (
            f"its best robot: birth {best.birth.number}{where}, fitness "
            f"{best.fitness:.4f}, rank {best.rank}, {len(robot.parts)} parts, "
            f"{motors} motors"
        ),
        f"its file: {folder / BEST}",
    ]


def failures(folder: Path) -> tuple[str, bool]:
    """Return a line on who could not be judged, and whether anybody could.

    Args:
        folder: of a finished run.

    Raises:
        RunFolderError: a table cannot be read.
    """
    evaluations = read_table(folder, "evaluations")
    failed = evaluations.filter(pc.field("status") == "failed")
    deaths = read_table(folder, "deaths")
    lost = deaths.filter(pc.field("reason") == "diverged")
    told = []
    if failed.num_rows:
        what = f"{failed.num_rows} of {evaluations.num_rows} evaluations failed"
        told.append(f"{what}, {_most_often(failed['reason'])}")
    if lost.num_rows:
        what = f"{lost.num_rows} of {deaths.num_rows} deaths were failures"
        told.append(f"{what}, {_most_often(lost['detail'])}")
    is_judged = (
        failed.num_rows < evaluations.num_rows
        or read_table(folder, "fitness").num_rows > 0
    )
    return "; ".join(told), is_judged


def _most_often(reasons: pa.ChunkedArray) -> str:
    """Return the most frequent of some reasons, and how many it is of."""
    ((reason, count),) = Counter(reasons.to_pylist()).most_common(1)
    share = "all" if count == len(reasons) else f"{count} of them"
    return f"{share}: {reason}"
