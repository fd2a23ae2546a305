"""The whole state of an arena as bytes, and back.

MessagePack of fixed fields; arrays are little-endian float64. Nothing is executed
when it is read. What is not here is a function of what is, models, contacts, frames
of bodies, or spares work only: distances that were measured. Touch tallies and
samples of poses are handed over at the end of each advance, so between two of them
there are none.
"""

import hashlib

import msgspec
import numpy as np
from msgspec import Struct

from schema.errors import MalformedMessage
from schema.experiment.settings import ArenaSettings
from schema.robot.results import Floats

FORMAT = 2
"""Goes up when the meaning of a field changes."""


class RobotState(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """One robot: who and what, physics, readings and memory, mind, window."""

    birth: tuple[int, int]
    robot: bytes
    born: int
    thinks_since: int
    qpos: bytes
    qvel: bytes
    ctrl: bytes
    readings: bytes
    velocities: bytes
    states: bytes
    window: bytes
    place: tuple[float, float, float]


class CasualtyState(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A robot that fell before the next advance could say so."""

    birth: tuple[int, int]
    step: int
    reason: str
    place: tuple[float, float, float]


class ArenaState(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """An arena between two advances.

    Attributes:
        settings: SHA-256 of the settings it goes with.
        robots: by birth.
        clusters: who lives together, as indices into the robots.
        casualties: not yet told.
    """

    format: int
    settings: bytes
    step: int
    robots: list[RobotState]
    clusters: list[list[int]]
    casualties: list[CasualtyState]


def settings_digest(settings: ArenaSettings) -> bytes:
    """Return the SHA-256 of an arena's settings."""
    return hashlib.sha256(msgspec.json.encode(settings)).digest()


def encode_state(state: ArenaState) -> bytes:
    """Return the bytes of a state; equal states give equal bytes."""
    return msgspec.msgpack.encode(state)


def decode_state(data: bytes, settings: ArenaSettings) -> ArenaState:
    """Return the state of some bytes.

    Args:
        data: a snapshot.
        settings: of the arena that it is to be restored in.

    Raises:
        MalformedMessage: not a snapshot's bytes, another format, or one of an
            arena with other settings.
    """
    try:
        state = msgspec.msgpack.decode(data, type=ArenaState)
    except msgspec.MsgspecError as error:
        raise MalformedMessage(f"snapshot: {error}") from None
    if state.format != FORMAT:
        raise MalformedMessage(f"snapshot: format must be {FORMAT}, got {state.format}")
    if state.settings != settings_digest(settings):
        raise MalformedMessage("snapshot: of an arena with other settings")
    viewed = sorted(row for group in state.clusters for row in group)
    if viewed != list(range(len(state.robots))):
        raise MalformedMessage("snapshot: every robot must be in one cluster")
    return state


def pack_floats(numbers: Floats) -> bytes:
    """Return numbers as bytes, without their shape."""
    return np.ascontiguousarray(numbers, dtype="<f8").tobytes()


def unpack_floats(data: bytes, *shape: int) -> Floats:
    """Return the numbers of some bytes.

    Raises:
        MalformedMessage: not so many as the shape has.
    """
    try:
        return np.frombuffer(data, dtype="<f8").reshape(shape).copy()
    except ValueError as error:
        raise MalformedMessage(f"snapshot: {error}") from None
