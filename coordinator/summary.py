"""What a finished run comes to: the best robot, and where all is."""

from collections.abc import Mapping
from pathlib import Path

from coordinator.arena import Arena
from coordinator.island import Island
from schema.experiment import Experiment, body_space
from schema.genome import develop
from schema.robot_file import write_robot

BEST = "best.yaml"


def conclude(
    folder: Path, experiment: Experiment, islands: Mapping[int, Island | Arena]
) -> str:
    """Write the best robot of all islands to a file; return what there is to see.

    Args:
        folder: of the run.
        experiment: what was run.
        islands: finished, by their numbers.
    """
    births = sum(island.births for island in islands.values())
    extinct = [
        number
        for number, island in sorted(islands.items())
        if isinstance(island, Arena) and island.is_extinct
    ]
    tables = f"tables:     {folder / 'tables'}"
    if len(extinct) == len(islands):
        return f"after {births} births too few are left to mate\n{tables}"
    living = [
        one
        for number, island in sorted(islands.items())
        if number not in extinct
        for one in island.population
    ]
    # The eldest of the best, of the first island among equals.
    best = min(living, key=lambda one: (-one.fitness, one.birth.number))
    mean = sum(one.fitness for one in living) / len(living)
    space = body_space(experiment.space)
    robot = develop(best.genome, space)
    write_robot(robot, folder / BEST, space)
    motors = sum(space[part.kind].outputs for part in robot.parts)
    where = f" of island {best.birth.island}" if len(islands) > 1 else ""
    lines = [
        f"{births} births; mean fitness of the last population {mean:.4f}",
        (
            f"best robot: birth {best.birth.number}{where}, fitness "
            f"{best.fitness:.4f}, rank {best.rank}, {len(robot.parts)} parts, "
            f"{motors} motors"
        ),
        f"its file:   {folder / BEST}",
        tables,
        "try next:",
        f"  revolve robot render {folder / BEST} best.gif",
        f"  revolve view {folder}",
        f"  revolve analyze {folder}",
    ]
    return "\n".join(lines)
