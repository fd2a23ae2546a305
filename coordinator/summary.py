"""What a finished run comes to: the best robot, what failed, and where all is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pyarrow.compute as pc

from coordinator.arena import Arena
from coordinator.island import Island
from coordinator.selection import fittest_first
from coordinator.wording import command
from schema.experiment import Experiment, body_space
from schema.genome import develop
from schema.robot_file import write_robot
from schema.run_tables import read_table

BEST = "best.yaml"


@dataclass(frozen=True, slots=True)
class Conclusion:
    """What a finished run comes to.

    Attributes:
        text: what there is to see.
        failures: a line on evaluations that failed; empty if none did.
        is_judged: not all of them did.
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
    failures, is_judged = _failures(folder)
    lines = [*_results(folder, experiment, islands), f"tables: {folder / 'tables'}"]
    if failures:
        lines.insert(1, failures)
    lines.append("try next:")
    if (folder / BEST).exists():
        lines.append(f"  {command('robot', 'render', folder / BEST, 'best.gif')}")
    lines += [f"  {command(what, folder)}" for what in ("view", "analyze")]
    return Conclusion("\n".join(lines), failures, is_judged)


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


def _failures(folder: Path) -> tuple[str, bool]:
    """Return a line on evaluations that failed, and whether any other is there."""
    evaluations = read_table(folder, "evaluations").select(["status", "reason"])
    failed = evaluations.filter(pc.equal(evaluations["status"], "failed"))
    if not failed.num_rows:
        return "", True
    reasons = failed.group_by("reason").aggregate([("reason", "count")])
    most = reasons.sort_by([("reason_count", "descending"), ("reason", "ascending")])
    reason, count = most["reason"][0].as_py(), most["reason_count"][0].as_py()
    share = "all" if count == failed.num_rows else f"{count} of them"
    line = f"{failed.num_rows} of {evaluations.num_rows} evaluations failed"
    return f"{line}, {share}: {reason}", failed.num_rows < evaluations.num_rows
