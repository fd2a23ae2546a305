"""Protocols of plug-ins: what each kind gets and returns."""

from collections.abc import Sequence
from typing import Protocol

from schema.parts import Vector
from schema.robot.results import Floats


class SensorView(Protocol):
    """What a sensor of a plug-in sees at a tick: its part, and what is around it.

    The view is valid during ``read`` only. Names of boxes are those of the part's
    shape; cylinders count as boxes. An unknown name raises ``KeyError``.
    """

    @property
    def age_s(self) -> float:
        """Simulated time since the robot's birth [s]."""

    @property
    def joint_angle(self) -> float:
        """Angle [rad] or displacement [m] of the part's joint; 0 without a joint."""

    @property
    def joint_speed(self) -> float:
        """Velocity of the part's joint [rad/s] or [m/s]; 0 without a joint."""

    @property
    def light(self) -> Vector | None:
        """Position of the light, world frame [m]; None in a world without light."""

    @property
    def others(self) -> Floats:
        """Centres of the cores of all other robots, (N, 3), world frame [m].

        By birth; N = 0 off-line.
        """

    def position(self, box: str) -> Floats:
        """Return the centre of a box, (3,), world frame [m]."""

    def rotation(self, box: str) -> Floats:
        """Return the rotation from a box's frame to the world frame, (3, 3)."""

    def touches(self, box: str) -> bool:
        """Return whether a box was in contact in the last step.

        Contacts with its own rigid segment, or one that a joint connects to it, do
        not exist.
        """

    def distance(
        self,
        box: str,
        direction: Vector,
        reach: float,
        start: Vector = (0.0, 0.0, 0.0),
    ) -> float:
        """Return how far a ray gets [m].

        The ray passes through the rigid segment of the box and meets everything else:
        the ground, scenery, other robots, and other segments of its own robot.

        Args:
            box: that sends the ray.
            direction: of the ray, of length 1, in the frame of the box.
            reach: length of the ray [m].
            start: of the ray, in the frame of the box [m].

        Returns:
            Distance from ``start`` to what the ray meets first, or ``reach``.
        """


class SensorType(Protocol):
    """Sensor of a plug-in: an object in ``PartType.sensors``.

    It has no state: ``read`` is a pure function of the view. One object serves all
    parts of its type, of all robots, off-line and in arenas, and an arena that moves
    to another machine continues with equal readings. What ``read`` raises, a wrong
    number of values, or one that is not finite, ends the evaluation of the robot as
    failed, or its life in an arena; the reason names the sensor.
    """

    @property
    def inputs(self) -> int:
        """Number of network inputs, at least 1; always the same."""

    def read(self, view: SensorView, /) -> Sequence[float]:
        """Return the values of the inputs, finite, at every tick of the brain.

        Noise of the experiment is added afterwards.
        """
