"""Answers to calls of users' functions."""

from collections.abc import Iterator

import pytest

from schema.errors import MalformedMessage, RevolveError, UnknownPlugin
from schema.plugins import permission
from schema.wire.calls import (
    Failed,
    call_settings,
    encode_call_request,
    pack_value,
    read_call_answer,
)
from worker.arena.world import World
from worker.serve.calls import answer_call
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


def request(function: str, argument: object) -> bytes:
    return encode_call_request(
        run="run",
        epoch=3,
        number=17,
        settings=call_settings(function),
        argument=pack_value(argument),
        plugins="",
    )


def value(function: str, argument: object) -> object:
    return read_call_answer(answer_call(request(function, argument)), (3, 17))


def test_value_is_that_of_the_function() -> None:
    assert value("lab_of_calls:double", 21) == 42
    assert value("lab_of_calls:double", [1]) == [1, 1]
    answer = Jobs(Shards(World)).answer(request("lab_of_calls:double", 21))
    assert read_call_answer(answer, (3, 17)) == 42


def test_error_of_the_function_is_a_failure() -> None:
    failed = value("lab_of_calls:broken", 0)
    expected = "lab_of_calls:broken raised ZeroDivisionError: division by zero"
    assert failed == Failed(expected)
    for name, error in (("interrupted", "KeyboardInterrupt"), ("ended", "SystemExit")):
        failed = value(f"lab_of_calls:{name}", 0)
        assert isinstance(failed, Failed)
        assert failed.reason.startswith(f"lab_of_calls:{name} raised {error}")
    odd = value("lab_of_calls:odd", 0)
    assert isinstance(odd, Failed)
    assert "its value must be None, bool" in odd.reason


@pytest.mark.parametrize(
    "function", ["os:getcwd", "shutil:rmtree", "schema.agent.flags:share"]
)
def test_modules_that_are_not_allowed_are_not_called(function: str) -> None:
    with pytest.raises(UnknownPlugin, match="is not allowed"):
        answer_call(request(function, "x"))


def test_unfit_functions_and_requests_are_refused() -> None:
    with pytest.raises(UnknownPlugin, match="did you mean 'lab_of_calls:double'"):
        answer_call(request("lab_of_calls:duble", 1))
    with pytest.raises(RevolveError, match="must take 1 argument: "):
        answer_call(request("lab_of_calls:two", 1))
    with pytest.raises(MalformedMessage):
        answer_call(b"nothing")
