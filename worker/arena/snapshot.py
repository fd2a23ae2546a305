"""Snapshots: the whole state of an arena as bytes, and back.

MessagePack of fixed fields; arrays are little-endian float64. Decoding executes no
code. Data that is not stored is a function of the fields (models, contacts, frames of
bodies) or a cache (measured distances). Each advance returns its contact durations and
pose samples, so there are none between two advances.
"""

import hashlib
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain
from typing import Any

import msgspec
import numpy as np
from msgspec import Struct

from schema.errors import InvalidRobot, MalformedMessage
from schema.experiment.document import body_space
from schema.experiment.settings import ArenaSettings
from schema.limits import ADVANCE_BYTES
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_types
from schema.robot.trace import Floats
from schema.wire.arena import Casualty
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode, encode
from schema.wire.protobuf import decode_robot
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot, FitnessWindow


class _RobotState(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """State of one robot: phenotype, physics, sensors, network, window.

    Attributes:
        states: of its brain, then its outputs at the last tick if they are recorded.
        rows: recorded channels of its window; empty if none is needed.
        probe: numbers of its probe; empty without one.
    """

    robot: bytes
    born: int
    brain_start: int
    qpos: bytes
    qvel: bytes
    ctrl: bytes
    readings: bytes
    velocities: bytes
    states: bytes
    window: bytes
    place: Vector
    rows: bytes
    probe: bytes


def state_of(
    settings: ArenaSettings,
    step: int,
    population: ArenaPopulation,
    casualties: Sequence[Casualty],
) -> ArenaState:
    """Return an arena's whole state; equal states give equal bytes."""
    return ArenaState(
        settings=_digest(settings),
        step=step,
        robots=tuple(
            (robot.birth, encode(_robot_state(robot))) for robot in population.robots
        ),
        clusters=tuple(cluster.members for cluster in population.clusters),
        casualties=tuple(casualties),
    )


def take_in(
    settings: ArenaSettings, state: ArenaState, population: ArenaPopulation
) -> None:
    """Add the robots of a state to a population, in their clusters.

    Raises:
        MalformedMessage: of an arena with other settings, or a robot that breaks their
            rules.
    """
    if state.settings != _digest(settings):
        raise MalformedMessage("snapshot: of an arena with other settings")
    births = [birth for birth, _ in state.robots]
    if sorted(chain.from_iterable(state.clusters)) != births:
        raise MalformedMessage("snapshot: every robot must be in one cluster")
    clusters = [each.members for each in population.clusters]
    population.add(
        [
            _restored(birth, decode(_RobotState, robot, ADVANCE_BYTES), population)
            for birth, robot in state.robots
        ]
    )
    population.regroup([*clusters, *state.clusters])


@lru_cache(maxsize=8)
def _digest(settings: ArenaSettings) -> bytes:
    """Return the SHA-256 of an arena's settings, which new keys do not change."""
    return hashlib.sha256(msgspec.json.encode(_without_defaults(settings))).digest()


def _without_defaults(value: Any) -> Any:  # noqa: ANN401 - any value of a section
    """Return a section as a table without keys at their defaults and empty tables."""
    if isinstance(value, tuple):
        return tuple(map(_without_defaults, value))
    if not isinstance(value, Struct):
        return value
    keys = [(key, getattr(value, key.name)) for key in msgspec.structs.fields(value)]
    others = [(key, given) for key, given in keys if given not in (key.default, {})]
    return {key.name: _without_defaults(given) for key, given in others}


def _robot_state(robot: ArenaRobot) -> _RobotState:
    view, sensors, probe = robot.view, robot.view.sensors, robot.view.probe
    return _RobotState(
        robot=robot.encoded,
        born=robot.window.born,
        brain_start=robot.brain_start,
        qpos=_pack(view.qpos),
        qvel=_pack(view.qvel),
        ctrl=_pack(view.ctrl),
        readings=_pack(sensors.readings),
        velocities=_pack(np.array(sensors.velocities)),
        states=_pack(np.concatenate((robot.states, robot.outputs))),
        window=_pack(np.array(robot.window.positions)),
        place=robot.place,
        rows=_pack(np.array(robot.window.rows)),
        probe=b"" if probe is None else _pack(probe.numbers),
    )


def _restored(
    birth: BirthId, state: _RobotState, population: ArenaPopulation
) -> ArenaRobot:
    cache = population.model_cache
    body = cache.body(birth, _robot(state.robot, cache.settings))
    window = FitnessWindow(cache.settings.simulation, state.born)
    for x, y, z in _unpack(state.window, -1, 3).tolist():
        window.positions.append((x, y, z))
    try:
        robot = ArenaRobot(birth, body, cache.controls, window, state.place)
    except InvalidRobot as error:
        raise MalformedMessage(f"snapshot: {error}") from None
    view, sensors = robot.view, robot.view.sensors
    view.qpos[:] = _unpack(state.qpos, *view.qpos.shape)
    view.qvel[:] = _unpack(state.qvel, *view.qvel.shape)
    view.ctrl[:] = _unpack(state.ctrl, *view.ctrl.shape)
    sensors.readings[:] = _unpack(state.readings, *sensors.readings.shape)
    sensors.velocities = [
        (x, y, z) for x, y, z in _unpack(state.velocities, -1, 3).tolist()
    ]
    numbers = _unpack(state.states, robot.states.size + robot.outputs.size)
    robot.states, robot.outputs = np.split(numbers, [robot.states.size])
    robot.brain_start = state.brain_start
    if width := robot.body.channels.width:
        shape = len(robot.window.positions), width
        robot.window.rows.extend(_unpack(state.rows, *shape))
    if view.probe is not None:
        view.probe.numbers[:] = _unpack(state.probe, *view.probe.numbers.shape)
    return robot


def _robot(data: bytes, settings: ArenaSettings) -> Robot:
    """Return the robot of some bytes, from which its model can be built."""
    robot = decode_robot(data)
    try:
        check_types(robot, body_space(settings.space))
    except InvalidRobot as error:
        raise MalformedMessage(f"snapshot: {error}") from None
    return robot


def _pack(numbers: Floats) -> bytes:
    return np.ascontiguousarray(numbers, dtype="<f8").tobytes()


def _unpack(data: bytes, *shape: int) -> Floats:
    """Return the numbers of some bytes; raise if they do not fit the shape."""
    try:
        return np.frombuffer(data, dtype="<f8").reshape(shape).copy()
    except ValueError as error:
        raise MalformedMessage(f"snapshot: {error}") from None
