"""Calls of users' own functions."""

import time

from schema.errors import ExperimentError, error_text
from schema.plugins.load import load_function
from schema.wire.calls import (
    Failed,
    decode_call_request,
    encode_call_answer,
    pack_value,
)


def answer_call(request: bytes) -> bytes:
    """Return the encoded answer to an encoded call.

    An error of the function, or a value that is not plain, is a result: a failure.

    Raises:
        MalformedMessage: the bytes are no call.
        UnknownPlugin: no such function, or its module is not allowed here.
        ExperimentError: it is no function of one argument.
    """
    start = time.perf_counter()
    call = decode_call_request(request)
    function = load_function(call.function, "function", 1)
    value: bytes | Failed
    try:
        value = pack_value(function(call.argument))
    except ExperimentError as error:
        value = Failed(f"{call.function}: its value {error}")
    # Also KeyboardInterrupt or SystemExit: no signal raises one in a worker.
    except BaseException as error:  # noqa: BLE001 - a user's function may raise anything
        value = Failed(f"{call.function} raised {error_text(error)}")
    return encode_call_answer(call, time.perf_counter() - start, value)
