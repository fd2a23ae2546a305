"""Calls of a user's own functions by workers, as bytes.

Arguments and values are plain: None, truth values, numbers, texts, bytes, lists and
dicts of such. They travel as MessagePack; no object of another kind does, and no code.
"""

from dataclasses import dataclass
from typing import Any

import msgspec

from schema.errors import NO_MESSAGE, ExperimentError, MalformedMessage, one_line
from schema.experiment.section import Section
from schema.limits import (
    LONGEST_REASON,
    MOST_SHOWN,
    REQUEST_BYTES,
    VALUE_BYTES,
    printable,
)
from schema.wire import revolve_pb2 as pb
from schema.wire.decoding import parsed

_PLAIN = "None, bool, int, float, str, bytes (of robots: Genome.to_bytes), list or dict"
_LEAVES = (type(None), bool, int, float, str, bytes)


class CallSettings(Section, frozen=True):
    """Settings of a call: the function as ``module:attribute``."""

    function: str


@dataclass(frozen=True, slots=True)
class Call:
    """A call: epoch and number of its job, function, and its argument."""

    epoch: int
    number: int
    function: str
    argument: Any


@dataclass(frozen=True, slots=True)
class Failed:
    """Reason why a call has no value."""

    reason: str


def call_settings(function: str) -> bytes:
    """Return the settings of the calls of a function."""
    return msgspec.json.encode(CallSettings(function=function))


def pack_value(value: object) -> bytes:
    """Return the bytes of a plain value; tuples become lists.

    Raises:
        ExperimentError: a value of another kind, or one that is too large.
    """
    try:
        data = msgspec.msgpack.encode(value)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        why = printable(one_line(error), 2 * MOST_SHOWN)
        raise ExperimentError(
            f"must be {_PLAIN}, got {type(value).__name__}: {why}"
        ) from None
    if strange := _strange_kinds(value):
        raise ExperimentError(f"must be {_PLAIN}, got {', '.join(strange)}")
    if len(data) > VALUE_BYTES:
        raise ExperimentError(f"must have <= {VALUE_BYTES} bytes, got {len(data)}")
    return data


def _strange_kinds(value: object) -> list[str]:
    """Return the names of the kinds of a value, or in it, that are not plain.

    MessagePack writes some of them as others: a set as a list in no defined order.
    """
    found: set[str] = set()
    waiting = [value]
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            waiting += [*each, *each.values()]
        elif not isinstance(each, list | tuple):
            if not isinstance(each, _LEAVES):
                found.add(type(each).__name__)
        # Of a long list of numbers, fast.
        elif not set(_LEAVES).issuperset(map(type, each)):
            waiting += each
    return sorted(found)


def unpack_value(data: bytes) -> Any:  # noqa: ANN401 - any plain value
    """Return the plain value of some bytes.

    Raises:
        MalformedMessage: not MessagePack, or too many bytes.
    """
    if len(data) > VALUE_BYTES:
        raise MalformedMessage(
            f"value: must have <= {VALUE_BYTES} bytes, got {len(data)}", "too large"
        )
    try:
        return msgspec.msgpack.decode(data)
    except (ValueError, TypeError, RecursionError) as error:
        raise MalformedMessage(f"value: {error}") from None


def encode_call_request(
    *, run: str, epoch: int, number: int, settings: bytes, argument: bytes, plugins: str
) -> bytes:
    """Return the bytes of a call.

    Args:
        run: name of the client.
        epoch: of the client.
        number: of the job.
        settings: from ``call_settings``.
        argument: from ``pack_value``.
        plugins: result of ``source.plugins_of`` for the settings.
    """
    message = pb.Request(
        run=run, epoch=epoch, number=number, settings=settings, plugins=plugins
    )
    message.call.argument = argument
    return message.SerializeToString(deterministic=True)


def decode_call_request(data: bytes) -> Call:
    """Return the call of some bytes.

    Raises:
        MalformedMessage: not the bytes of a call.
    """
    message = parsed(data, pb.Request(), REQUEST_BYTES)
    if not message.HasField("call"):
        raise MalformedMessage("Request: is no call")
    try:
        settings = msgspec.json.decode(message.settings, type=CallSettings)
    except (ValueError, RecursionError) as error:
        raise MalformedMessage(f"settings of a call: {error}") from None
    argument = unpack_value(message.call.argument)
    return Call(message.epoch, message.number, settings.function, argument)


def encode_call_answer(call: Call, wall_s: float, value: bytes | Failed) -> bytes:
    """Return the bytes of the answer to a call.

    Args:
        call: that is answered.
        wall_s: duration by the clock [s].
        value: from ``pack_value``, or why there is none.
    """
    message = pb.Answer(epoch=call.epoch, number=call.number, wall_s=wall_s)
    if isinstance(value, Failed):
        message.failure = printable(value.reason, LONGEST_REASON)
    else:
        message.value = value
    return message.SerializeToString(deterministic=True)


def read_call_answer(data: bytes, expected: tuple[int, int]) -> Any:  # noqa: ANN401 - any plain value
    """Return the value of a call, or ``Failed``.

    Args:
        data: bytes of the answer.
        expected: epoch and number of the job.

    Raises:
        MalformedMessage: not the answer to this call.
    """
    message = parsed(data, pb.Answer(), VALUE_BYTES + LONGEST_REASON)
    if (message.epoch, message.number) != expected:
        raise MalformedMessage(
            f"answer must be to (epoch, job) {expected}, got "
            f"{(message.epoch, message.number)}",
            "stale",
        )
    match message.WhichOneof("result"):
        case "value":
            return unpack_value(message.value)
        case "failure":
            return Failed(printable(message.failure, LONGEST_REASON) or NO_MESSAGE)
        case _:
            raise MalformedMessage("answer: must be a value or a failure")
