"""Robot of the thesis's second benchmark: a spider with eight oscillators.

Source: Hupkes 2016, section 7.1, and its published code. Phases are in periods, modulo
a period.
"""

from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.robot import Part, Robot

_GREY = (0.5, 0.5, 0.5)
_HIPS = (
    (1.0000, -0.2227, 0.9996),
    (1.0000, 0.3513, 0.9973),
    (1.0003, -0.1550, 0.9996),
    (1.0000, 0.2868, 0.9991),
)
_KNEES = (
    (1.0000, -0.8803, 1.0000),
    (1.0001, 0.9083, 0.8837),
    (1.0134, -0.3330, 0.9986),
    (1.0000, 0.4518, 0.9993),
)
"""Period [s], phase [periods] and amplitude of each leg's servos."""
_WITH_TOUCH = (0, 2)
SPACING_M = 0.4
CLEARANCE_M = 0.002
_COLUMNS = 5


def spider() -> Robot:
    """Return the spider: legs of hip, brick, knee, brick; two with touch sensors."""
    parts = [Part("Core", -1, -1, -1, 0, _GREY)]
    inputs = [Neuron("input", INPUT, 0) for _ in range(6)]
    outputs: list[Neuron] = []
    for leg, (hip, knee) in enumerate(zip(_HIPS, _KNEES, strict=True)):
        first = len(parts)
        parts += [
            Part("ActiveHinge", 0, leg, 0, 90, _GREY),
            Part("FixedBrick", first, 1, 0, 90, _GREY),
            Part("ActiveHinge", first + 1, 1, 0, 0, _GREY),
            Part("FixedBrick", first + 2, 1, 0, 0, _GREY),
        ]
        if leg in _WITH_TOUCH:
            parts.append(Part("TouchSensor", first + 3, 1, 0, 0, _GREY))
            inputs += [Neuron("input", INPUT, first + 4) for _ in range(2)]
        for part, (period, phase, amplitude) in ((first, hip), (first + 2, knee)):
            numbers = (period, phase % 1.0, amplitude)
            outputs.append(Neuron("output", "Oscillator", part, numbers))
    return Robot(tuple(parts), Brain((*inputs, *outputs)))


def grid(count: int) -> list[tuple[float, float]]:
    """Return places in rows of five, the first row included."""
    return [
        (SPACING_M * (number % _COLUMNS), SPACING_M * (number // _COLUMNS))
        for number in range(count)
    ]
