"""How robots come into an arena, and which changes are none."""

from collections.abc import Collection

import mujoco
import numpy as np

from schema.errors import UnexpectedEvent, one_line
from schema.experiment.document import body_space
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot
from schema.wire.arena import Casualty, Changes, Insertion
from schema.wire.codec import encode_robot
from worker.clusters.models import Body
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot, put
from worker.clusters.window import Window
from worker.robot.controller import Widths, pack


def check_changes(changes: Changes, population: ArenaPopulation, step: int) -> None:
    """Raise unless changes can be made to a company.

    Args:
        changes: removals first, then insertions, then brains.
        population: who lives there.
        step: the arena's.

    Raises:
        UnexpectedEvent: somebody is not there, or there already, named twice, or
            born between two ticks of the brains.
        InvalidRobot: a robot that breaks the rules, a brain that does not fit.
    """
    gone = _once(changes.removals)
    new = _once(tuple(insertion.birth for insertion in changes.insertions))
    _once(tuple(change.birth for change in changes.brains))
    for birth in gone:
        if birth not in population:
            raise UnexpectedEvent(f"apply: {birth} does not live here")
    for birth in new:
        if birth in population and birth not in gone:
            raise UnexpectedEvent(f"apply: {birth} lives here already")
    tick = population.model_cache.settings.simulation.brain_steps
    if new and step % tick:
        raise UnexpectedEvent(
            "apply: births must fall on multiples of simulation.brain_steps = "
            f"{tick}, got step {step}"
        )
    robots = {insertion.birth: insertion.robot for insertion in changes.insertions}
    for change in changes.brains:
        birth = change.birth
        if birth not in new and (birth in gone or birth not in population):
            raise UnexpectedEvent(f"apply: {birth} does not live here")
        body = robots[birth] if birth in new else population.find(birth).robot
        robots[birth] = Robot(body.parts, change.brain)
    for robot in robots.values():
        check_robot(robot, body_space(population.model_cache.settings.space))
        pack(robot.brain, population.model_cache.width)


def _once(births: tuple[BirthId, ...]) -> tuple[BirthId, ...]:
    if len(set(births)) < len(births):
        raise UnexpectedEvent(f"apply: somebody is named twice in {births}")
    return births


def possible(changes: Changes, living: Collection[BirthId]) -> Changes:
    """Return what of changes made on another platform can be made here.

    Who fell here only is let alone; who fell there only, and comes back as a migrant,
    makes room for itself. Where the same live as there, these are the same changes.
    """
    coming = [each.birth for each in changes.insertions]
    going = dict.fromkeys((*changes.removals, *coming))
    return Changes(
        tuple(birth for birth in going if birth in living),
        changes.insertions,
        tuple(
            change
            for change in changes.brains
            if change.birth in living or change.birth in coming
        ),
    )


def newborn(
    insertion: Insertion, population: ArenaPopulation, step: int
) -> ArenaRobot | Casualty:
    """Return a robot that feels for the first time, or why it never will.

    Args:
        insertion: who, what, where.
        population: that it is to join.
        step: the arena's.

    Raises:
        ExperimentError: a sensor that the arena has nothing for.
    """
    try:
        body = population.model_cache.body(insertion.birth, insertion.robot)
    except ValueError as error:
        place = (*insertion.place, 0.0)
        reason = f"cannot be built: {one_line(error)}"
        return Casualty(insertion.birth, step, reason, place)
    view = body.home.views[0]
    x, y = insertion.place
    z = population.model_cache.height(body, insertion.place, insertion.heading)
    put(view, (x, y, z), insertion.heading)
    try:
        view.start()
    except mujoco.FatalError as error:
        reason = f"physics diverged: {one_line(error)}"
        return Casualty(insertion.birth, step, reason, (x, y, z))
    window = Window(population.model_cache.settings.simulation, step)
    one = arena_robot(insertion.birth, insertion.robot, body, window, population)
    one.thinks_since, one.place = step, (x, y, z)
    window.add(step, one.place)
    return one


def arena_robot(
    birth: BirthId,
    robot: Robot,
    body: Body,
    window: Window,
    population: ArenaPopulation,
) -> ArenaRobot:
    """Return a robot at home, its mind at rest, before anything is known of it."""
    network = pack(robot.brain, population.model_cache.width)
    return ArenaRobot(
        birth=birth,
        robot=robot,
        encoded=encode_robot(robot),
        body=body,
        view=body.home.views[0],
        network=network,
        states=np.zeros(population.model_cache.width.states),
        thinks_since=0,
        window=window,
        place=(0.0, 0.0, 0.0),
    )


def equip(one: ArenaRobot, brain: Brain, width: Widths, since: int) -> None:
    """Give a robot another brain, at rest.

    Args:
        one: the robot; its held commands stay until its next tick.
        brain: that fits its body.
        width: of every network.
        since: step of that tick, from which the brain's clock counts.
    """
    one.robot = Robot(one.robot.parts, brain)
    one.encoded = encode_robot(one.robot)
    one.network = pack(brain, width)
    one.states = np.zeros_like(one.states)
    one.thinks_since = since
