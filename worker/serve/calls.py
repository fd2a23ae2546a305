"""Calls of users' own functions."""

import msgspec

from schema.errors import ExperimentError, MalformedMessage, error_text
from schema.plugins.load import load_function
from schema.wire.calls import CallSettings, pack_value, unpack_value
from schema.wire.messages import Call, CallValue, Failure


def call_function(call: Call, settings: bytes) -> CallValue | Failure:
    """Return the value of a function.

    An error of the function, or a value that is not plain, is a result: a failure.

    ``settings``: JSON of ``CallSettings``.

    Raises:
        MalformedMessage: no such settings or argument.
        UnknownPlugin: no such function, or its module is not allowed here.
        ExperimentError: it is no function of one argument.
    """
    try:
        name = msgspec.json.decode(settings, type=CallSettings).function
    except (ValueError, RecursionError) as error:
        raise MalformedMessage(f"settings of a call: {error}") from None
    function = load_function(name, "function", 1)
    argument = unpack_value(call.argument)
    try:
        return CallValue(pack_value(function(argument)))
    except ExperimentError as error:
        return Failure(f"{name}: its value {error}")
    # Also KeyboardInterrupt or SystemExit: no signal raises one in a worker.
    except BaseException as error:  # noqa: BLE001 - a user's function may raise anything
        return Failure(f"{name} raised {error_text(error)}")
