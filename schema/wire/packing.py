"""MessagePack of Structs: messages between processes of one version.

Coordinators, operators and viewers exchange them; nothing stores them. Decoding is
typed: unknown or missing fields, numbers out of range and numbers that are not
finite are refused.
"""

import sys
from hashlib import blake2b
from typing import Annotated, TypeVar

from msgspec import Meta, Struct
from msgspec.msgpack import Decoder

from schema.errors import MalformedMessage

T = TypeVar("T")

_GREATEST = sys.float_info.max
Finite = Annotated[float, Meta(ge=-_GREATEST, le=_GREATEST)]
"""Float that is neither infinite nor NaN: NaN satisfies no bound."""


class Message(Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the messages: immutable, without unknown fields."""


def fingerprint(data: bytes) -> bytes:
    """Return 8 bytes that identify a request: no other content has them by chance."""
    return blake2b(data, digest_size=8).digest()


def unpack(decoder: Decoder[T], data: bytes, most: int) -> T:
    """Return the message of some bytes.

    Args:
        decoder: of the type of message.
        data: the bytes.
        most: number of bytes that such a message may have.

    Raises:
        MalformedMessage: not the bytes of such a message, or too many.
    """
    if len(data) > most:
        raise MalformedMessage(
            f"message: must be <= {most} bytes, got {len(data)}", "too large"
        )
    try:
        return decoder.decode(data)
    except (ValueError, RecursionError) as error:  # of msgspec, or not UTF-8
        raise MalformedMessage(
            f"damaged, or of another version of Revolve Islands: {error}"
        ) from None
