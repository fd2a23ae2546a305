"""A part type that slides, and the sensor at its end."""

import revolve as rv

REACH_M = 0.3
X, MINUS_X, Z = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
PLATE = (0.0015, 0.034, 0.034)
ALONG_X = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))


class Whisker:
    """Sensor: how near the first obstacle ahead is, from 0 to 1."""

    inputs = 1

    def read(self, view: rv.SensorView) -> list[float]:
        """Return 1 - distance / reach."""
        distance = view.distance("tail", X, REACH_M)
        return [1.0 - distance / REACH_M]


def _piston_shape(values: tuple[float, ...]) -> rv.Shape:
    """Return a barrel of some length [mm], out of which a rod slides."""
    length = values[0] / 1000.0
    barrel, rod = 0.00075 + length / 2, 0.00075 + 1.5 * length
    tail = 0.0015 + 2.0 * length
    return rv.Shape(
        boxes=(
            rv.Box("root", PLATE, (0.0, 0.0, 0.0), 0.005),
            rv.cylinder(
                "barrel", 0.012, length, (barrel, 0.0, 0.0), 0.008, rotation=ALONG_X
            ),
            rv.cylinder(
                "rod", 0.006, length, (rod, 0.0, 0.0), 0.004, segment=1,
                rotation=ALONG_X,
            ),
            rv.Box("tail", PLATE, (tail, 0.0, 0.0), 0.003, 1),
        ),
        slots=(
            rv.Slot((-0.00075, 0.0, 0.0), MINUS_X, Z),
            rv.Slot((tail + 0.00075, 0.0, 0.0), X, Z, 1),
        ),
        joint=rv.Joint((rod, 0.0, 0.0), X, 0.4 * length, "prismatic"),
    )  # fmt: skip


PISTON = rv.PartType(
    "Piston",
    2,
    _piston_shape,
    own_parameters=(rv.Parameter("length", 15.0, 30.0, 20.0),),
    sensors=(Whisker(),),
    motor=rv.Motor(gain=4.0, max_torque=5.0, max_velocity=0.1),
)
