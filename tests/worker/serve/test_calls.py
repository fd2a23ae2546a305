"""Answers to calls of users' functions."""

from collections.abc import Iterator

import pytest

from schema.errors import MalformedMessage, RevolveError, UnknownPlugin
from schema.plugins import permission
from schema.wire.calls import call_settings, pack_value, unpack_value
from schema.wire.messages import Call, CallValue, Failure, Request
from worker.arena.world import World
from worker.serve.calls import call_function
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

LAB = """
def double(value):
    return 2 * value

def odd(value):
    return object()

def broken(value):
    return 1 / value

def interrupted(value):
    raise KeyboardInterrupt

def ended(value):
    exit(3)

def two(first, second):
    return first
"""


@pytest.fixture(autouse=True, scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Allow a module with functions."""
    file = tmp_path_factory.mktemp("lab") / "lab_of_calls.py"
    file.write_text(LAB)
    permission.allow([str(file)])
    yield
    del permission._allowed["lab_of_calls"]


def called(function: str, argument: object = 1) -> CallValue | Failure:
    return call_function(Call(pack_value(argument)), call_settings(function))


def value(function: str, argument: object) -> object:
    result = called(function, argument)
    assert isinstance(result, CallValue)
    return unpack_value(result.value)


def test_value_is_that_of_the_function() -> None:
    assert value("lab_of_calls:double", 21) == 42
    assert value("lab_of_calls:double", (1,)) == [1, 1]
    call = Call(pack_value("ab"))
    request = Request("run", 3, 17, call, call_settings("lab_of_calls:double"))
    assert Jobs(Shards(World)).answer(request) == CallValue(pack_value("abab"))


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("broken", "raised ZeroDivisionError: division by zero"),
        ("interrupted", "raised KeyboardInterrupt"),
        ("ended", "raised SystemExit"),
        ("odd", ": its value must be None, bool"),
    ],
)
def test_error_of_the_function_is_a_failure(name: str, reason: str) -> None:
    failed = called(f"lab_of_calls:{name}", 0)
    assert isinstance(failed, Failure)
    assert failed.reason.replace(" :", ":").startswith(f"lab_of_calls:{name}")
    assert reason in failed.reason


@pytest.mark.parametrize(
    "function", ["os:getcwd", "shutil:rmtree", "schema.agent.flags:share"]
)
def test_modules_that_are_not_allowed_are_not_called(function: str) -> None:
    with pytest.raises(UnknownPlugin, match="is not allowed"):
        called(function)


def test_unfit_functions_and_requests_are_refused() -> None:
    with pytest.raises(UnknownPlugin, match="did you mean 'lab_of_calls:double'"):
        called("lab_of_calls:duble")
    with pytest.raises(RevolveError, match="must take 1 argument: "):
        called("lab_of_calls:two")
    with pytest.raises(MalformedMessage):
        call_function(Call(pack_value(1)), b"nothing")
    with pytest.raises(MalformedMessage):
        call_function(Call(b"\xc1"), call_settings("lab_of_calls:double"))
