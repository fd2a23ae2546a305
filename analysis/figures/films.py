"""Moving pictures of limited size (GIF)."""

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image

from analysis.render.picture import Picture

MOST_BYTES = 700_000
"""Size of a film up to which it keeps all colours and pictures."""
_COLOURS = (128, 64, 32)
_SAMPLES = 6
"""Pictures from which the colours are chosen."""


def film(pictures: Sequence[Picture], interval_s: float) -> bytes:
    """Return pictures as a GIF that repeats.

    All pictures share one palette without dithering, so that what does not move is
    stored once. A film above ``MOST_BYTES`` gets fewer colours, then every other
    picture is left out.

    Args:
        pictures: pictures of one size; at least one.
        interval_s: time between two pictures [s]; a GIF stores hundredths.
    """
    shown = list(pictures)
    while True:
        for colours in _COLOURS:
            stored = _gif(shown, interval_s, colours)
            if len(stored) <= MOST_BYTES:
                return stored
        if len(shown) == 1:
            return stored
        shown, interval_s = shown[::2], 2 * interval_s


def _gif(pictures: Sequence[Picture], interval_s: float, colours: int) -> bytes:
    every = -(-len(pictures) // _SAMPLES)
    samples = Image.fromarray(np.concatenate(pictures[::every]))
    palette = samples.quantize(colours, Image.Quantize.MEDIANCUT)
    first, *others = (
        Image.fromarray(one).quantize(palette=palette, dither=Image.Dither.NONE)
        for one in pictures
    )
    file = io.BytesIO()
    first.save(
        file,
        "GIF",
        save_all=True,
        append_images=others,
        duration=round(1000 * interval_s),
        loop=0,
    )
    return file.getvalue()
