"""Overlay of arenas with own rules: colours of robots, discs, lines, over time."""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from schema.wire.updates import ArenaSample

Colour = tuple[int, ...]
Rod = tuple[Floats, float, Floats, float, Colour]
"""Cylinder: centre, half length [m], quaternion w, x, y, z, radius [m] and colour."""
_PLASMA = (13, 8, 135), (126, 3, 168), (204, 71, 120), (248, 149, 64), (240, 249, 33)
"""Colours of stores from 0 to the most. Source: the map plasma of matplotlib, even in
lightness, also for those who cannot tell red from green."""
_MEADOW = (243, 233, 210), (127, 176, 105)
"""Colours of patches from empty to the fullest, as in the figure of the ground."""
_LINES = (0.008, (90, 90, 90)), (0.025, (86, 180, 233))
"""Radius [m] and colour of a line between robots that met, and that had a child."""
_THICK, _ABOVE = np.array([0.0, 0.0, 0.002]), np.array([0.0, 0.0, 0.06])
"""Height of the lowest disc, and of a line over the robots' cores [m]."""


class Overlay:
    """What pictures of an arena with own rules show; each sample until the next one.

    Attributes:
        samples: those to come, by time.
        colours: of robots, as of their newest sample.
        text: meaning of the colours; empty without stores.
    """

    def __init__(self, samples: Iterable[ArenaSample] = ()) -> None:
        self.samples, self.text = deque(samples), ""
        self.colours: dict[BirthId, Colour] = {}
        self._fed = self._met = ArenaSample(0, 0.0)
        self._most = self._fullest = 1e-9

    @property
    def most_rods(self) -> int:
        """Greatest number of rods at any later time."""
        counts = [(len(one.patches), len(one.pairs)) for one in self.samples]
        return sum(map(max, zip(*counts, strict=True)))

    def advance(self, time_s: float) -> bool:
        """Go on to a time [s]; return whether there is a new sample."""
        before = len(self.samples)
        while self.samples and self.samples[0].sim_time_s <= time_s:
            sample = self.samples.popleft()
            self._fed = sample if sample.patches else self._fed
            self._met = sample if sample.pairs else self._met
            self._fullest = max([self._fullest, *(p[3] for p in self._fed.patches)])
            if sample.stores:
                self._most = max([self._most, *(value for _, value in sample.stores)])
                self.text = f"{sample.store}: blue 0, yellow {self._most:.3g}"
            for birth, value in sample.stores:
                self.colours[birth] = _mixed(_PLASMA, value / self._most)
        return len(self.samples) < before

    def rods(self, time_s: float, poses: Mapping[BirthId, Floats]) -> list[Rod]:
        """Return discs of patches, then lines between robots.

        Poses begin with x, y, z of the core [m].
        """
        rods = []
        for number, (x, y, radius_m, content) in enumerate(self._fed.patches):
            colour = _mixed(_MEADOW, content / self._fullest)
            # Discs may overlap.
            axis = (number + 1) * _THICK
            rods.append(rod(np.array([x, y, 0.0]), axis, radius_m, colour))
        is_over = time_s >= self._met.sim_time_s + self._met.over_s
        for first, second, are_parents in () if is_over else self._met.pairs:
            if first in poses and second in poses:
                start, end = poses[first][:3] + _ABOVE, poses[second][:3] + _ABOVE
                rods.append(rod(start, end - start, *_LINES[are_parents]))
        return rods


def rod(start: Floats, axis: Floats, radius_m: float, colour: Colour) -> Rod:
    """Return a cylinder from a point along an axis, (3,) [m]."""
    length_m = max(float(np.linalg.norm(axis)), 1e-9)
    x, y, z = axis / length_m
    turn = np.array([1.0 + z, -y, x, 1e-9])
    middle, turn = start + 0.5 * axis, turn / np.linalg.norm(turn)
    return middle, 0.5 * length_m, turn, radius_m, colour


def _mixed(colours: Sequence[Colour], share: float) -> Colour:
    along = np.linspace(0.0, 1.0, len(colours))
    channels = zip(*colours, strict=True)
    return tuple(int(np.interp(share, along, channel)) for channel in channels)
