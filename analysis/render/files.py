"""Files of pictures and films."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from analysis.render.stage import Picture
from schema.agent.extras import extra
from schema.errors import RevolveError

_CODECS = {
    ".mp4": ("libx264", {"crf": "20", "movflags": "+faststart"}),
    ".webm": ("libvpx-vp9", {"crf": "32", "b": "0", "cpu-used": "5", "row-mt": "1"}),
}
"""Codec of a film by ending, and its settings: about as sharp as a GIF."""
_COLOURS = 256
_SAMPLES = 6
"""Pictures from which the colours of a film are chosen."""


class NoPictures(RevolveError):  # noqa: N818 - names what is missing
    """A picture cannot be rendered or written."""


def gait_strip(
    pictures: Sequence[Picture], texts: Sequence[str] = (), *, columns: int = 5
) -> Picture:
    """Return pictures of one size in rows; the rest of the last row is white.

    The text of each, such as its simulated time, is written below it, if given.
    """
    if texts:
        marked = zip(pictures, texts, strict=True)
        pictures = [_with_text(picture, text) for picture, text in marked]
    height, width, _ = pictures[0].shape
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    cells = np.full((rows * columns, height, width, 3), 255, np.uint8)
    cells[: len(pictures)] = pictures
    strip = cells.reshape(rows, columns, height, width, 3).swapaxes(1, 2)
    return strip.reshape(rows * height, columns * width, 3)


def _with_text(picture: Picture, text: str) -> Picture:
    height, width, _ = picture.shape
    size = min(max(10, width // 16), 24)
    image = Image.new("RGB", (width, height + 3 * size // 2), "white")
    image.paste(Image.fromarray(picture))
    font = ImageFont.load_default(min(size, 5 * width // (3 * len(text))))
    middle = (width / 2, height + 3 * size / 4)
    ImageDraw.Draw(image).text(middle, text, "black", font, anchor="mm")
    return np.asarray(image)


def save_picture(picture: Picture, path: Path) -> None:
    """Write a picture in the format of the file's ending.

    Raises:
        NoPictures: the ending is unknown, or the file cannot be written.
    """
    with writing(path):
        Image.fromarray(picture).save(path)


def save_film(pictures: Sequence[Picture], path: Path, interval_s: float) -> None:
    """Write pictures of one size as a film, in the format of the file's ending.

    Raises:
        NoPictures: the file cannot be written.
        RevolveError: the encoder of MP4 and WebM is not installed.
    """
    ending = path.suffix.lower()
    with writing(path):
        if ending in _CODECS:
            _encode(pictures, path, interval_s, ending)
        else:
            path.write_bytes(gif(pictures, interval_s, _COLOURS))


def _encode(
    pictures: Sequence[Picture], path: Path, interval_s: float, ending: str
) -> None:
    with extra("films in MP4 and WebM need", "films"):
        import av  # noqa: PLC0415 - large, and not for GIF
        from av.video.stream import VideoStream  # noqa: PLC0415 - the same
    codec, settings = _CODECS[ending]
    with av.open(str(path), "w") as file:
        rate = Fraction(1.0 / interval_s).limit_denominator(1000)
        stream = file.add_stream(codec, rate, settings)
        assert isinstance(stream, VideoStream)
        # Their colours are stored for squares of four pixels.
        high, wide = (2 * (length // 2) for length in pictures[0].shape[:2])
        stream.height, stream.width = high, wide
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            even = np.ascontiguousarray(picture[:high, :wide])
            file.mux(stream.encode(av.VideoFrame.from_ndarray(even, "rgb24")))
        file.mux(stream.encode())


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Report a file that cannot be written.

    Raises:
        NoPictures: it cannot be written, or its format does not exist.
    """
    try:
        yield
    except OSError as error:
        why = f"cannot be written: {error.strerror or error}"
        raise NoPictures(f"{path}: {why}") from None
    except ValueError as error:
        raise NoPictures(f"{path}: {error}") from None


def gif(pictures: Sequence[Picture], interval_s: float, colours: int) -> bytes:
    """Return pictures as a GIF that repeats.

    All pictures share one palette without dithering, so that what does not move is
    stored once.

    Args:
        pictures: pictures of one size; at least one.
        interval_s: time between two pictures [s]; a GIF stores hundredths.
        colours: size of the palette, at most 256.
    """
    every = -(-len(pictures) // _SAMPLES)
    chosen = [pictures[at] for at in range(0, len(pictures), every)]
    samples = Image.fromarray(np.concatenate(chosen))
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
