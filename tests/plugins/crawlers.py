"""A user's plug-in file: a part with slider, cylinder and own sensor, a blind core."""

from dataclasses import dataclass, replace
from typing import Any

from revolve import Box, Joint, Motor, PartType, Shape, Slot, cylinder
from schema.parts import CORE

ALONG_X = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
_PISTON = Shape(
    boxes=(
        Box("barrel", (0.03, 0.03, 0.03), (0.015, 0.0, 0.0), 0.015),
        cylinder(
            "rod", 0.006, 0.04, (0.05, 0.0, 0.0), 0.008, segment=1, rotation=ALONG_X
        ),
    ),
    slots=(
        Slot((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        Slot((0.07, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1),
    ),
    joint=Joint((0.03, 0.0, 0.0), (1.0, 0.0, 0.0), 0.015, "prismatic"),
)


@dataclass(frozen=True)
class Feeler:
    """Sensor: what is ahead of the rod, how far it is out, and who is near."""

    inputs: int = 3

    def read(self, view: Any) -> list[float]:
        """Return nearness of an obstacle, position of the rod, number of robots."""
        ahead = view.distance("rod", (0.0, 0.0, 1.0), 0.3, (0.0, 0.0, 0.0201))
        near = abs(view.others - view.position("rod")).max(axis=1) < 1.0
        touch = 1.0 if view.touches("rod") else 0.0
        return [1.0 - ahead / 0.3 + touch, view.joint_angle / 0.015, float(near.sum())]


class Fragile(Feeler):
    """Sensor that fails while its robot is 2 s to 10 s old."""

    def read(self, view: Any) -> list[float]:
        """Return the same, or what is no number."""
        found = super().read(view)
        is_old = 2.0 < view.age_s < 10.0
        return [float("nan"), *found[1:]] if is_old else found


_MOTOR = Motor(gain=2.0, max_torque=3.0, max_velocity=0.1)
PISTON = PartType(
    "Piston", 2, lambda _values: _PISTON, sensors=(Feeler(),), motor=_MOTOR
)
FRAGILE = PartType(
    "Piston", 2, lambda _values: _PISTON, sensors=(Fragile(),), motor=_MOTOR
)
BLIND_CORE = replace(CORE, sensors=())
