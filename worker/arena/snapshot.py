"""Snapshots: the whole state of an arena as bytes, and back.

MessagePack of fixed fields; arrays are little-endian float64. Decoding executes no
code. Data that is not stored is a function of the fields (models, contacts, frames of
bodies) or a cache (measured distances). Each advance returns its contact durations and
pose samples, so there are none between two advances.
"""

import hashlib
from collections.abc import Sequence
from functools import lru_cache

import msgspec
import numpy as np
from msgspec import Struct
from msgspec.structs import astuple

from schema.errors import InvalidRobot, MalformedMessage
from schema.experiment.document import body_space
from schema.experiment.settings import ArenaSettings
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_types
from schema.robot.trace import Floats
from schema.wire.arena import Casualty
from schema.wire.protobuf import decode_robot
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot, FitnessWindow
from worker.measures.functions import functions_of

FORMAT = 2
"""Increases when the meaning of a field changes."""


class _RobotState(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """State of one robot: phenotype, physics, sensors, network, window."""

    birth: BirthId
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


class _Recording(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """Recorded channels of one robot: rows of its window, numbers of its probe."""

    rows: bytes
    probe: bytes


class _ArenaState(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """State of an arena between two advances.

    Attributes:
        settings: SHA-256 of the arena's settings.
        robots: by birth.
        clusters: members of each, as indices into the robots.
        casualties: birth, step, reason and place of robots that diverged and are not
            yet reported by an advance.
        recordings: of the robots, by birth; only of an arena whose fitness or measures
            need recorded channels.
    """

    format: int
    settings: bytes
    step: int
    robots: list[_RobotState]
    clusters: list[list[int]]
    casualties: list[tuple[BirthId, int, str, Vector]]
    recordings: list[_Recording] = []


def write_snapshot(
    settings: ArenaSettings,
    step: int,
    population: ArenaPopulation,
    casualties: Sequence[Casualty],
) -> bytes:
    """Return an arena's whole state; equal states give equal bytes.

    Args:
        settings: of the arena.
        step: of the arena.
        population: the living robots.
        casualties: not yet reported.
    """
    rows = population.robot_rows.rows
    state = _ArenaState(
        format=FORMAT,
        settings=_digest(settings),
        step=step,
        robots=[_robot_state(robot) for robot in population.robots],
        clusters=[[rows[b] for b in c.members] for c in population.clusters],
        casualties=[(c.birth, c.step, c.reason, c.place) for c in casualties],
        recordings=[_recording(robot) for robot in population.robots],
    )
    fields = astuple(state)
    return msgspec.msgpack.encode(fields if _is_recorded(settings) else fields[:-1])


def read_snapshot(
    settings: ArenaSettings, data: bytes, population: ArenaPopulation
) -> tuple[int, list[Casualty]]:
    """Fill an empty population from a snapshot.

    Args:
        settings: of the arena.
        data: the snapshot.
        population: without robots.

    Returns:
        The arena's step, and the casualties not yet reported.

    Raises:
        MalformedMessage: not a snapshot's bytes, another format, of an arena with
            other settings, or a robot that breaks their rules.
    """
    try:
        state = msgspec.msgpack.decode(data, type=_ArenaState)
    except (ValueError, RecursionError) as error:  # of msgspec, or not UTF-8
        raise MalformedMessage(f"snapshot: {error}") from None
    if state.format != FORMAT:
        raise MalformedMessage(f"snapshot: format must be {FORMAT}, got {state.format}")
    if state.settings != _digest(settings):
        raise MalformedMessage("snapshot: of an arena with other settings")
    members = sorted(row for group in state.clusters for row in group)
    if members != list(range(len(state.robots))):
        raise MalformedMessage("snapshot: every robot must be in one cluster")
    robots = [_restored(robot, population) for robot in state.robots]
    if len(state.recordings) != len(robots) * _is_recorded(settings):
        raise MalformedMessage("snapshot: every robot must have a recording")
    for robot, recording in zip(robots, state.recordings, strict=False):
        _restore_recording(robot, recording)
    population.add(robots)
    births = [robot.birth for robot in population.robots]
    population.regroup([tuple(births[row] for row in g) for g in state.clusters])
    population.merges = population.splits = 0
    return state.step, [Casualty(*fields) for fields in state.casualties]


def _is_recorded(settings: ArenaSettings) -> bool:
    return bool(functions_of(settings).channels)


@lru_cache(maxsize=8)
def _digest(settings: ArenaSettings) -> bytes:
    """Return the SHA-256 of an arena's settings."""
    return hashlib.sha256(msgspec.json.encode(settings)).digest()


def _robot_state(robot: ArenaRobot) -> _RobotState:
    view, sensors = robot.view, robot.view.sensors
    return _RobotState(
        birth=robot.birth,
        robot=robot.encoded,
        born=robot.window.born,
        brain_start=robot.brain_start,
        qpos=_pack(view.qpos),
        qvel=_pack(view.qvel),
        ctrl=_pack(view.ctrl),
        readings=_pack(sensors.readings),
        velocities=_pack(np.array(sensors.velocities)),
        states=_pack(robot.states),
        window=_pack(np.array(robot.window.positions)),
        place=robot.place,
    )


def _restored(state: _RobotState, population: ArenaPopulation) -> ArenaRobot:
    cache = population.model_cache
    body = cache.body(state.birth, _robot(state.robot, cache.settings))
    window = FitnessWindow(cache.settings.simulation, state.born)
    for x, y, z in _unpack(state.window, -1, 3).tolist():
        window.positions.append((x, y, z))
    try:
        robot = ArenaRobot(state.birth, body, cache.controls, window, state.place)
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
    robot.states = _unpack(state.states, *robot.states.shape)
    robot.brain_start = state.brain_start
    return robot


def _recording(robot: ArenaRobot) -> _Recording:
    probe = robot.view.probe
    return _Recording(
        rows=_pack(np.array(robot.window.rows)),
        probe=b"" if probe is None else _pack(probe.numbers),
    )


def _restore_recording(robot: ArenaRobot, recording: _Recording) -> None:
    width, probe = robot.body.channels.width, robot.view.probe
    if width:
        shape = len(robot.window.positions), width
        robot.window.rows.extend(_unpack(recording.rows, *shape))
    if probe is not None:
        probe.numbers[:] = _unpack(recording.probe, *probe.numbers.shape)


def _robot(data: bytes, settings: ArenaSettings) -> Robot:
    """Return the robot of some bytes, from which its model can be built.

    Raises:
        MalformedMessage: no robot, or one that breaks the rules of the settings.
    """
    robot = decode_robot(data)
    try:
        check_types(robot, body_space(settings.space))
    except InvalidRobot as error:
        raise MalformedMessage(f"snapshot: {error}") from None
    return robot


def _pack(numbers: Floats) -> bytes:
    """Return numbers as bytes, without their shape."""
    return np.ascontiguousarray(numbers, dtype="<f8").tobytes()


def _unpack(data: bytes, *shape: int) -> Floats:
    """Return the numbers of some bytes.

    Raises:
        MalformedMessage: a number of bytes that does not fit the shape.
    """
    try:
        return np.frombuffer(data, dtype="<f8").reshape(shape).copy()
    except ValueError as error:
        raise MalformedMessage(f"snapshot: {error}") from None
