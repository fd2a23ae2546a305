"""Decoding of bytes within limits: Protobuf, and MessagePack of Structs.

Structs travel between processes of one version: coordinators, operators and viewers
exchange them; nothing stores them. Their decoding is typed: unknown or missing fields,
numbers out of range and numbers that are not finite are refused. Protobuf messages are
bounded by their length and number of submessages.
"""

import sys
from hashlib import blake2b
from typing import Annotated, Any, TypeVar

from google.protobuf.message import DecodeError
from google.protobuf.message import Message as ProtobufMessage
from msgspec import Meta, Struct
from msgspec.msgpack import Decoder

from schema.errors import MalformedMessage
from schema.limits import MOST_FIELDS, MOST_SUBMESSAGES, UNCOUNTED_BYTES

T = TypeVar("T")
M = TypeVar("M", bound=ProtobufMessage)
Descriptor = Any
"""Type of a Protobuf message; its libraries have several classes for it."""

_GREATEST = sys.float_info.max
Finite = Annotated[float, Meta(ge=-_GREATEST, le=_GREATEST)]
"""Float that is neither infinite nor NaN: NaN satisfies no bound."""

_VARINT, _BYTES = 0, 2
_SIZES = {1: 8, 5: 4}
"""Bytes of the other wire types."""
_WIRE_TYPES = 7
_MOST_VARINT = 10


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


def parsed(data: bytes, message: M, most: int) -> M:
    """Return a message with the content of some bytes.

    Args:
        data: the bytes.
        message: an empty message.
        most: number of bytes that such a message may have.

    Raises:
        MalformedMessage: not the bytes of such a message; too many bytes or
            submessages.
    """
    if len(data) > most:
        raise MalformedMessage(
            f"{message.DESCRIPTOR.name}: must be <= {most} bytes, got {len(data)}",
            "too large",
        )
    if len(data) > UNCOUNTED_BYTES:
        _check_counts(data, message.DESCRIPTOR)
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        name = message.DESCRIPTOR.name
        raise MalformedMessage(f"not the bytes of a {name}: {error}") from None
    return message


def require_most(count: int, most: int, what: str) -> None:
    """Raise if there are too many of something.

    Raises:
        MalformedMessage: more than ``most``.
    """
    if count > most:
        raise MalformedMessage(f"{what}: must be <= {most}, got {count}", "too large")


def _check_counts(data: bytes, descriptor: Descriptor) -> None:
    """Raise if a message has too many submessages or fields.

    An empty submessage takes two bytes encoded and about a hundred once parsed.

    Raises:
        MalformedMessage: too many; a length or a field that cannot be.
    """
    fields = submessages = place = 0
    end = len(data)
    # Ends and types of the messages around a submessage.
    around: list[tuple[int, Descriptor]] = []
    while place < end or around:
        if place >= end:
            end, descriptor = around.pop()
            continue
        fields += 1
        if fields > MOST_FIELDS or submessages > MOST_SUBMESSAGES:
            raise MalformedMessage(
                f"{descriptor.name}: must have <= {MOST_SUBMESSAGES} submessages and "
                f"<= {MOST_FIELDS} fields",
                "too large",
            )
        tag, place = _varint(data, place)
        start, place = _value(data, place, tag & _WIRE_TYPES)
        if place > end:
            raise MalformedMessage(f"{descriptor.name}: a field is cut off")
        field = descriptor.fields_by_number.get(tag >> 3)
        if tag & _WIRE_TYPES == _BYTES and field and field.message_type:
            submessages += 1
            around.append((end, descriptor))
            place, end, descriptor = start, place, field.message_type


def _value(data: bytes, place: int, wire_type: int) -> tuple[int, int]:
    """Return the start and the end of the value at a place.

    Raises:
        MalformedMessage: there is none of this type.
    """
    if wire_type == _VARINT:
        return place, _varint(data, place)[1]
    if wire_type == _BYTES:
        length, place = _varint(data, place)
        return place, place + length
    if wire_type not in _SIZES:
        raise MalformedMessage(f"a field is of the unknown type {wire_type}")
    return place, place + _SIZES[wire_type]


def _varint(data: bytes, place: int) -> tuple[int, int]:
    """Return the number at a place and the place after it.

    Raises:
        MalformedMessage: there is none.
    """
    value = shift = 0
    for byte in data[place : place + _MOST_VARINT]:
        place += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:  # noqa: PLR2004 - the bit that says that more follows
            return value, place
        shift += 7
    raise MalformedMessage("a number is cut off")
