"""Recording of a robot's motion: what fitness functions and measures get."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from schema.errors import ExperimentError, nearest, shown
from schema.robot.robot import Robot

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

RECORDED = (
    "core_attitude",
    "joint_angle",
    "joint_velocity",
    "joint_torque",
    "energy",
    "contact",
    "readings",
    "neighbours",
    "outputs",
    "commands",
)
"""Channels with a value per sample, which exist only if a function declares them."""
COMPUTED = ("part_position", "part_poses")
"""Channels that are computed at the end, if a function declares them."""
DERIVED = {"part_poses": ("core_attitude", "joint_angle")}
"""Channels that a channel is computed from: who declares it declares these, too."""
CONSTANT = ("light", "robot", "mass", "gravity")
"""Channels with one value, which always exist; they may be declared, too."""
NEIGHBOUR_M = 0.5
"""Greatest distance between the cores of two robots that are neighbours [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Recording of one robot over its fitness window, in T samples.

    A function that reads a channel of ``RECORDED`` or ``COMPUTED`` declares it with the
    decorator ``needs``; a channel that no function of the experiment declares is not
    recorded.

    Attributes:
        interval_s: time between two samples [s].
        core_position: (T, 3) centre of the core, world frame, z up [m]; sample 0
            is the start of the window, T >= 2.
        channels: the other values by name; read them as attributes.
    """

    interval_s: float
    core_position: Floats
    channels: Mapping[str, Any] = field(default_factory=dict)

    @property
    def duration_s(self) -> float:
        """Time between the first sample and the last one [s]."""
        return (len(self.core_position) - 1) * self.interval_s

    @property
    def core_attitude(self) -> Floats:
        """(T, 4) unit quaternions w, x, y, z of the core, core to world frame."""
        return cast("Floats", self._channel("core_attitude"))

    @property
    def joint_angle(self) -> Floats:
        """(T, J) positions of all joints, driven or not, in part order [rad or m]."""
        return cast("Floats", self._channel("joint_angle"))

    @property
    def joint_velocity(self) -> Floats:
        """(T, J) velocities of the joints [rad/s or m/s]."""
        return cast("Floats", self._channel("joint_velocity"))

    @property
    def joint_torque(self) -> Floats:
        """(T, J) torques, or forces, of the motors in the last step [N m or N].

        It is 0 for joints without a motor.
        """
        return cast("Floats", self._channel("joint_torque"))

    @property
    def energy(self) -> Floats:
        """(T,) absolute mechanical work of the motors since sample 0 [J].

        The sum over physics steps and motors of abs(torque x displacement): a motor
        that brakes takes as much energy as one that drives.
        """
        return cast("Floats", self._channel("energy"))

    @property
    def contact(self) -> Mask:
        """(T, P) whether each part touched anything but its own robot.

        As of the last physics step before the sample; at the start, of the initial
        position.
        """
        return cast("Mask", self._channel("contact"))

    @property
    def readings(self) -> Floats:
        """(T, I) latest readings of all sensors, without noise, in the brain's order.

        Units: m/s2 and rad/s of an imu, 0 to 1 of touch and light.
        """
        return cast("Floats", self._channel("readings"))

    @property
    def neighbours(self) -> Counts:
        """(T,) number of robots whose core is within ``NEIGHBOUR_M``; 0 off-line."""
        return cast("Counts", self._channel("neighbours"))

    @property
    def outputs(self) -> Floats:
        """(T, O) outputs of the brain at its last tick, one per motor, in part order.

        Unclipped, without noise; 0 to 1 is a motor's range. Off-line there is no tick
        at the end: the last sample has the outputs of the tick before.
        """
        return cast("Floats", self._channel("outputs"))

    @property
    def commands(self) -> Floats:
        """(T, O) commanded velocities of the motors since the last tick [rad/s or m/s].

        After clipping, noise and faults; off-line at the end as ``outputs``.
        """
        return cast("Floats", self._channel("commands"))

    @property
    def part_poses(self) -> Floats:
        """(T, P, 7) origin x, y, z [m] and quaternion w, x, y, z of each part, world.

        The quaternion is part to world frame. Of a part with a joint it is the pose of
        the half that is fixed to the parent.
        """
        return cast("Floats", self._channel("part_poses"))

    @property
    def part_position(self) -> Floats:
        """(P, 3) origins of the parts with all joints at 0, core frame [m]."""
        return cast("Floats", self._channel("part_position"))

    @property
    def light(self) -> tuple[float, float, float] | None:
        """Position of the light, world frame [m]; None if there is none."""
        return cast("tuple[float, float, float] | None", self._channel("light"))

    @property
    def robot(self) -> Robot:
        """Body and brain."""
        return cast("Robot", self._channel("robot"))

    @property
    def mass(self) -> float:
        """Mass of the whole robot [kg]."""
        return cast("float", self._channel("mass"))

    @property
    def gravity(self) -> float:
        """Acceleration of free fall, ``simulation.gravity`` [m/s2]."""
        return cast("float", self._channel("gravity"))

    def _channel(self, name: str) -> object:
        if name in self.channels:
            return self.channels[name]
        how = f'declare it with @needs("{name}") above the function'
        raise ExperimentError(f"trace.{name} is not recorded: {how}")


def sum_in_order(numbers: Iterable[float]) -> float:
    """Return the sum of floats, rounded after each addition, in their order.

    ``sum`` of Python 3.12 and later compensates for rounding, that of 3.11 does not.
    Evaluations must not depend on the version that a worker runs.
    """
    return reduce(add, numbers, 0.0)


_Function = TypeVar("_Function", bound=Callable[..., float])
_ATTRIBUTE = "__revolve_needs__"


def needs(*channels: str) -> Callable[[_Function], _Function]:
    """Return a decorator that declares the channels of a trace that a function reads.

    Raises:
        ExperimentError: no such channel.
    """
    check_channels("needs", channels)

    def declare(function: _Function) -> _Function:
        setattr(function, _ATTRIBUTE, channels)
        return function

    return declare


def check_channels(where: str, names: Iterable[str]) -> None:
    """Raise ``ExperimentError``, with the nearest, unless all names are channels'."""
    known = (*RECORDED, *COMPUTED, *CONSTANT)
    for name in names:
        if name not in known:
            hint = f"{nearest(str(name), known)}; channels: {', '.join(known)}"
            raise ExperimentError(f"{where}: {shown(name)} is not a channel{hint}")


def channels_of(
    functions: Iterable[Callable[..., Any]], record: Iterable[str] = ()
) -> tuple[str, ...]:
    """Return the channels that exist only for some functions, in their fixed order.

    ``record`` names further ones.
    """
    wanted = {name for each in functions for name in getattr(each, _ATTRIBUTE, ())}
    wanted.update(record)
    for name in wanted & DERIVED.keys():
        wanted.update(DERIVED[name])
    return tuple(name for name in (*RECORDED, *COMPUTED) if name in wanted)
