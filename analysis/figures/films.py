"""Moving pictures of limited size (GIF)."""

from collections.abc import Sequence

from analysis.render.picture import gif
from analysis.render.stage import Picture

MOST_BYTES = 700_000
"""Size of a film up to which it keeps all colours and pictures."""
_COLOURS = (128, 64, 32)


def film(pictures: Sequence[Picture], interval_s: float) -> bytes:
    """Return pictures as a GIF that repeats.

    A film above ``MOST_BYTES`` gets fewer colours, then every other picture is left
    out.
    """
    shown = list(pictures)
    while True:
        for colours in _COLOURS:
            stored = gif(shown, interval_s, colours)
            if len(stored) <= MOST_BYTES:
                return stored
        if len(shown) == 1:
            return stored
        shown, interval_s = shown[::2], 2 * interval_s
