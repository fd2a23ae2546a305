"""Tests of moving pictures of limited size."""

import io

import numpy as np
import pytest
from PIL import Image, ImageSequence

from analysis.figures import figure_writer
from analysis.figures.figure_writer import film
from analysis.render.stage import Picture


def read(stored: bytes) -> list[tuple[Picture, float]]:
    """Return the pictures of a film, and for how long each is shown [ms]."""
    with Image.open(io.BytesIO(stored)) as shown:
        assert shown.info["loop"] == 0
        return [
            (np.asarray(frame.convert("RGB")), frame.info["duration"])
            for frame in ImageSequence.Iterator(shown)
        ]


def test_a_film_has_all_pictures_and_repeats() -> None:
    pictures = [np.full((20, 30, 3), shade, np.uint8) for shade in (0, 100, 200)]
    found = read(film(pictures, 0.1))
    assert [time_ms for _, time_ms in found] == [100, 100, 100]
    for (shown, _), given in zip(found, pictures, strict=True):
        assert shown.shape == (20, 30, 3)
        assert shown[10, 15] == pytest.approx(given[10, 15], abs=8)


def test_a_film_above_the_limit_loses_colours_then_pictures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(1)
    pictures = [rng.integers(0, 255, (40, 40, 3), np.uint8) for _ in range(8)]
    monkeypatch.setattr(figure_writer, "MOST_BYTES", 5000)
    stored = film(pictures, 0.1)
    assert len(stored) <= 5000
    found = read(stored)
    assert 1 < len(found) < 8
    # The film lasts as long as before.
    assert sum(time_ms for _, time_ms in found) == pytest.approx(800)
