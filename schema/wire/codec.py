"""Messages as bytes: MessagePack of Structs, whose types hold the rules of shape.

Messages travel between processes of one version, and the journal of a run holds some.
Unknown or missing fields, numbers out of range or not finite, and lists that are too
long are refused. A decoded message takes at most some fifty times its bytes.
"""

from functools import cache
from hashlib import blake2b
from types import MappingProxyType, UnionType
from typing import Any, TypeVar, cast, overload

from msgspec import Struct, inspect, msgpack
from msgspec.msgpack import Decoder

from schema.errors import MalformedMessage

T = TypeVar("T")


def _plain(value: object) -> dict[Any, Any]:
    """Return what is encoded in place of an object that MessagePack does not know."""
    if isinstance(value, MappingProxyType):
        return dict(value)
    raise TypeError(f"cannot encode {type(value).__name__}")


encode = msgpack.Encoder(enc_hook=_plain).encode
"""Return the bytes of a message."""


class Message(Struct, frozen=True, forbid_unknown_fields=True):
    """Base of the messages: immutable, without unknown fields."""


@overload
def decode(kind: type[T], data: bytes, most: int) -> T: ...


@overload
def decode(kind: UnionType, data: bytes, most: int) -> Any: ...  # noqa: ANN401


def decode(kind: type[T] | UnionType, data: bytes, most: int) -> T | Any:
    """Return the message of some bytes.

    Raises:
        MalformedMessage: not the bytes of such a message, or too many.
    """
    if len(data) > most:
        raise MalformedMessage(
            f"message: must be <= {most} bytes, got {len(data)}", "too large"
        )
    decoder = _decoder(cast("Any", kind))
    try:
        message: T = decoder.decode(data)
    # Also of bytes that are not UTF-8, and of a dict that is a key of a plain value.
    except (ValueError, TypeError, RecursionError) as error:
        raise MalformedMessage(
            f"damaged, or of another version of Revolve Islands: {error}"
        ) from None
    return message


def fingerprint(data: bytes) -> bytes:
    """Return 8 bytes that identify a request: no other content has them by chance."""
    return blake2b(data, digest_size=8).digest()


def format_digest(*kinds: Any) -> str:  # noqa: ANN401 - types and unions
    """Return 8 hex digits that change with the fields of messages or their ranges."""
    found = repr(inspect.multi_type_info(kinds))
    return blake2b(found.encode(), digest_size=4).hexdigest()


@cache
def _decoder(kind: Any) -> Decoder[Any]:  # noqa: ANN401
    return Decoder(kind)
