"""A user's plug-in package: part types, and an object that is not a part type."""

from revolve import Box, PartType, Sensor, Shape, Slot

_PADDLE = Shape(
    boxes=(Box("paddle", (0.06, 0.03, 0.002), (0.0, 0.0, 0.0), 0.004),),
    slots=(Slot((-0.03, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),),
)


def _shape(_values: tuple[float, ...]) -> Shape:
    return _PADDLE


FLIPPER = PartType("Flipper", 1, _shape, sensors=(Sensor("touch", "paddle"),))
SECOND_FLIPPER = PartType("Flipper", 1, _shape)
