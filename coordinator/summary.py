"""What a finished run tells on the terminal: the best robot, and where all is."""

import sys
from pathlib import Path

from coordinator.arena import Arena
from coordinator.island import Island
from schema.experiment import Experiment, body_space
from schema.genome import develop
from schema.robot_file import write_robot

BEST = "best.yaml"


def tell_result(folder: Path, experiment: Experiment, island: Island | Arena) -> None:
    """Write the best robot of an island to a file; say what there is to see.

    Args:
        folder: of the run.
        experiment: what was run.
        island: finished.
    """
    if isinstance(island, Arena) and island.is_extinct:
        sys.stdout.write(
            f"after {island.births} of {experiment.births} births too few are left "
            f"to mate\ntables:     {folder / 'tables'}\n"
        )
        return
    best = max(island.population, key=lambda one: (one.fitness, -one.birth.number))
    mean = sum(one.fitness for one in island.population) / len(island.population)
    space = body_space(experiment.space)
    robot = develop(best.genome, space)
    write_robot(robot, folder / BEST, space)
    motors = sum(space[part.kind].outputs for part in robot.parts)
    lines = [
        f"{island.births} births; mean fitness of the last population {mean:.4f}",
        (
            f"best robot: birth {best.birth.number}, fitness {best.fitness:.4f}, "
            f"rank {best.rank}, {len(robot.parts)} parts, {motors} motors"
        ),
        f"its file:   {folder / BEST}",
        f"tables:     {folder / 'tables'}",
        "try next:",
        f"  revolve robot show {folder / BEST}",
        f"  revolve analyze {folder}"
        if isinstance(island, Arena)
        else "  revolve run no-selection --seed 1 --births 600",
    ]
    sys.stdout.write("\n".join(lines) + "\n")
