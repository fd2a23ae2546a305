"""Random bytes, and valid messages that are changed at random, from a seed."""

from collections.abc import Sequence
from random import Random
from struct import pack

_LONGEST = 4096
"""Most random bytes of a message."""
_RARE = 2000
"""One message in this many is large."""
_HUGE = (
    b"\xff" * 9 + b"\x01",  # 2^64 - 1 as a varint
    b"\xff\xff\xff\xff\x0f",  # 2^32 - 1
    b"\xff\xff\xff\xff\x07",  # 2^31 - 1
    b"\xdd\xff\xff\xff\xff",  # MessagePack: a list, a map, bytes, text of 2^32 - 1
    b"\xdf\xff\xff\xff\xff",
    b"\xc6\xff\xff\xff\xff",
    b"\xdb\xff\xff\xff\xff",
)
_NUMBERS = (
    *(pack("<d", each) for each in (float("nan"), float("inf"), -1.0, 1e308, -0.0)),
    pack("<q", -1),
    pack("<q", 2**63 - 1),
    pack(">q", -(2**63)),
)
_LISTS = (b"\x91", b"\x81\xa1a", b"\x0a\x02", b"[", b'{"a":', b"\x12\x7f")


class Mutator:
    """Changes messages at random; equal seeds make equal messages."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)  # noqa: S311 - repeatable on purpose
        self._changes = (
            self._flip,
            self._flip,
            self._cut,
            self._insert,
            self._delete,
            self._repeat,
            self._lengthen,
            self._nest,
            self._number,
        )

    def message(self, samples: Sequence[bytes]) -> bytes:
        """Return random bytes, or a changed sample."""
        draw = self.random
        if draw.random() < 0.05:
            return draw.randbytes(draw.randrange(_LONGEST))
        data = bytearray(draw.choice(samples))
        for _ in range(draw.choice((1, 1, 1, 2, 3, 8))):
            draw.choice(self._changes)(data)
        if draw.random() < 0.05:
            other = draw.choice(samples)
            data += other[: draw.randrange(len(other) + 1)]
        if draw.randrange(_RARE) == 0:
            data *= max(1, 2_000_000 // (len(data) + 1))
        return bytes(data)

    def _place(self, data: bytearray) -> int:
        return self.random.randrange(len(data) + 1)

    def _slice(self, data: bytearray) -> slice:
        start = self._place(data)
        return slice(start, start + self.random.choice((1, 2, 8, 32, 256)))

    def _flip(self, data: bytearray) -> None:
        if data:
            data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)

    def _cut(self, data: bytearray) -> None:
        del data[self._place(data) :]

    def _insert(self, data: bytearray) -> None:
        place = self._place(data)
        data[place:place] = self.random.randbytes(self.random.choice((1, 2, 8, 64)))

    def _delete(self, data: bytearray) -> None:
        del data[self._slice(data)]

    def _repeat(self, data: bytearray) -> None:
        """Repeat a part, such as a field."""
        part = self._slice(data)
        times = self.random.choice((1, 2, 10, 100))
        data[part.start : part.start] = bytes(data[part]) * times

    def _lengthen(self, data: bytearray) -> None:
        """Write a length that no message has."""
        place = self._place(data)
        data[place : place + 1] = self.random.choice(_HUGE)

    def _nest(self, data: bytearray) -> None:
        """Insert lists or messages in each other."""
        place = self._place(data)
        depth = self.random.choice((3, 50, 500, 5000))
        data[place:place] = self.random.choice(_LISTS) * depth

    def _number(self, data: bytearray) -> None:
        """Write a number that is not finite, or extreme."""
        place = self._place(data)
        data[place : place + 8] = self.random.choice(_NUMBERS)
