"""From a living arena to its snapshot and back."""

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.wire.arena import Casualty
from schema.wire.codec import decode_robot
from worker.arena.births import arena_robot
from worker.arena.snapshot import (
    FORMAT,
    ArenaState,
    CasualtyState,
    RobotState,
    decode_state,
    encode_state,
    pack_floats,
    settings_digest,
    unpack_floats,
)
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.clusters.window import Window


def write(
    settings: ArenaSettings,
    step: int,
    population: ArenaPopulation,
    casualties: tuple[Casualty, ...],
) -> bytes:
    """Return an arena's whole state.

    Args:
        settings: it goes with.
        step: the arena's.
        population: the living.
        casualties: not yet told.
    """
    rows = {one.birth: row for row, one in enumerate(population.everybody)}
    return encode_state(
        ArenaState(
            format=FORMAT,
            settings=settings_digest(settings),
            step=step,
            robots=[_robot_state(one) for one in population.everybody],
            clusters=[[rows[b] for b in c.members] for c in population.clusters],
            casualties=[
                CasualtyState(_name(c.birth), c.step, c.reason, c.place)
                for c in casualties
            ],
        )
    )


def read(
    settings: ArenaSettings, data: bytes, population: ArenaPopulation
) -> tuple[int, tuple[Casualty, ...]]:
    """Fill an empty company from a snapshot.

    Args:
        settings: of the arena.
        data: the snapshot.
        population: nobody yet.

    Returns:
        The arena's step, and the casualties not yet told.

    Raises:
        MalformedMessage: not a snapshot, or of other settings.
    """
    state = decode_state(data, settings)
    population.add([_arena_robot(robot, population) for robot in state.robots])
    births = [one.birth for one in population.everybody]
    population.regroup([tuple(births[row] for row in g) for g in state.clusters])
    population.merges = population.splits = 0
    return state.step, tuple(
        Casualty(BirthId(*c.birth), c.step, c.reason, c.place) for c in state.casualties
    )


def _name(birth: BirthId) -> tuple[int, int]:
    return birth.island, birth.number


def _robot_state(one: ArenaRobot) -> RobotState:
    view = one.view
    return RobotState(
        birth=_name(one.birth),
        robot=one.encoded,
        born=one.window.born,
        thinks_since=one.thinks_since,
        qpos=pack_floats(view.qpos),
        qvel=pack_floats(view.qvel),
        ctrl=pack_floats(view.ctrl),
        readings=pack_floats(view.senses.readings),
        velocities=pack_floats(np.array(view.senses.velocities)),
        states=pack_floats(one.states),
        window=pack_floats(np.array(one.window.positions)),
        place=one.place,
    )


def _arena_robot(state: RobotState, population: ArenaPopulation) -> ArenaRobot:
    birth, robot = BirthId(*state.birth), decode_robot(state.robot)
    body = population.model_cache.body(birth, robot)
    window = Window(population.model_cache.settings.simulation, state.born)
    for x, y, z in unpack_floats(state.window, -1, 3).tolist():
        window.positions.append((x, y, z))
    one = arena_robot(birth, robot, body, window, population)
    view = one.view
    view.qpos[:] = unpack_floats(state.qpos, *view.qpos.shape)
    view.qvel[:] = unpack_floats(state.qvel, *view.qvel.shape)
    view.ctrl[:] = unpack_floats(state.ctrl, *view.ctrl.shape)
    readings = view.senses.readings
    readings[:] = unpack_floats(state.readings, *readings.shape)
    view.senses.velocities = [
        (x, y, z) for x, y, z in unpack_floats(state.velocities, -1, 3).tolist()
    ]
    one.states = unpack_floats(state.states, *one.states.shape)
    one.thinks_since, one.place = state.thinks_since, state.place
    return one
