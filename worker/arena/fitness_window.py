"""How a living robot does, from its sliding window."""

from collections.abc import Iterable

from schema.errors import FitnessUndefined
from schema.experiment.settings import ArenaSettings
from schema.wire.arena import Casualty, Judgement
from worker.clusters.robot import ArenaRobot
from worker.fitness import path_velocity, straight_velocity
from worker.robot.evaluation import judge


def judge_all(
    everybody: Iterable[ArenaRobot], step: int, settings: ArenaSettings
) -> tuple[list[Judgement], list[Casualty]]:
    """Return how all do, and those of whom it cannot be told, in their order."""
    judgements, undefined = [], []
    for one in everybody:
        found = judgement(one, step, settings)
        if isinstance(found, Judgement):
            judgements.append(found)
        else:
            undefined.append(found)
    return judgements, undefined


def judgement(
    one: ArenaRobot, step: int, settings: ArenaSettings
) -> Judgement | Casualty:
    """Return how a robot does now; a casualty if its fitness cannot be told.

    Velocities and fitness are 0 until a quarter of the window has been lived.

    Args:
        one: the robot.
        step: the arena's.
        settings: the arena's.
    """
    age_s = (step - one.window.born) * settings.simulation.timestep_s
    x, y, z = one.view.qpos[:3].tolist()
    if not one.window.is_judged:
        return Judgement(
            one.birth,
            age_s,
            0.0,
            0.0,
            0.0,
            is_mature=False,
            place=(x, y, z),
        )
    track = one.window.track()
    try:
        fitness = judge(track, settings.fitness)
    except FitnessUndefined as error:
        return Casualty(one.birth, step, f"fitness undefined: {error}", (x, y, z))
    return Judgement(
        one.birth,
        age_s,
        path_velocity(track),
        straight_velocity(track),
        fitness,
        is_mature=one.window.is_mature,
        place=(x, y, z),
    )
