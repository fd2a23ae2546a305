"""Summary of a finished run: best robot, failures, where the results are."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from coordinator.arena.arena import Arena
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.selection import fittest_first
from coordinator.run.session import RunSession
from coordinator.storage.hints import command
from schema.errors import counted
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import body_space
from schema.formats.files import write_robot
from schema.tables.files import read_table

BEST = "best.yaml"


@dataclass(frozen=True, slots=True)
class Conclusion:
    """Summary of a finished run.

    Attributes:
        text: lines for the user.
        failures: line about failed evaluations; empty if there are none.
        has_evaluated: at least one evaluation succeeded.
    """

    text: str
    failures: str
    has_evaluated: bool


def conclude(run: RunSession) -> Conclusion:
    """Write the best robot of all islands to a file; return the summary of a run.

    Args:
        run: a finished run with its tables.

    Raises:
        RunFolderError: a table cannot be read, or the robot cannot be written.
    """
    folder = run.held.path
    failures = _failures(folder)
    lines = _results(run)
    if failures:
        lines.insert(1, failures)
    lines += [f"tables: {folder / 'tables'}", "try next:"]
    if (folder / BEST).exists():
        lines.append(f"  {command('robot', 'render', folder / BEST, 'best.gif')}")
    lines += [f"  {command(what, folder)}" for what in ("view", "analyze")]
    return Conclusion("\n".join(lines), failures, has_evaluated(folder))


def _results(run: RunSession) -> list[str]:
    """Describe the last population; write its best robot to a file."""
    file, islands = run.held.path / BEST, run.loop.islands.values()
    births = sum(island.births for island in islands)
    alive = [
        each for each in islands if not (isinstance(each, Arena) and each.is_extinct)
    ]
    if not alive:
        return [
            f"extinct after {counted(births, 'birth')}: too few robots are left to mate"
        ]
    judged = [one for island in alive for one in island.judged]
    if not judged:
        return [
            f"{counted(births, 'birth')}; no robot of the last population has a fitness"
        ]
    best = fittest_first(judged)[0]
    mean = sum(one.fitness for one in judged) / len(judged)
    space = body_space(run.experiment.space)
    kinds = neuron_kinds(run.experiment.brain, run.experiment.space)
    robot = encoding_of(run.experiment).develop(best.genome)
    write_robot(robot, file, space, kinds=kinds)
    motors = sum(space[part.kind].outputs for part in robot.parts)
    where = f" of island {best.birth.island}" if len(islands) > 1 else ""
    return [
        f"{counted(births, 'birth')}; mean fitness of the last population {mean:.4f}",
        (
            f"best robot: birth {best.birth.number}{where}, fitness "
            f"{best.fitness:.4f}, rank {best.rank}, "
            f"{counted(len(robot.parts), 'part')}, {counted(motors, 'motor')}"
        ),
        f"its file: {file}",
    ]


def has_evaluated(folder: Path) -> bool:
    """Return whether at least one evaluation of a finished run succeeded.

    Raises:
        RunFolderError: a table cannot be read.
    """
    evaluations = read_table(folder, "evaluations")
    is_success = pc.not_equal(evaluations["status"], "failed")
    return bool(pc.any(is_success).as_py() or read_table(folder, "fitness").num_rows)


def _failures(folder: Path) -> str:
    """Return a line about failed evaluations and deaths; empty if there are none."""
    evaluations = read_table(folder, "evaluations")
    failed = evaluations.filter(pc.field("status") == "failed")
    deaths = read_table(folder, "deaths")
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
    """Return the most frequent of some reasons and its count."""
    ((reason, count),) = Counter(reasons.to_pylist()).most_common(1)
    share = "all" if count == len(reasons) else f"{count} of them"
    return f"{share}: {reason}"
