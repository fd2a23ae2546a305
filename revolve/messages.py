"""Messages between the Python API and the processes that it starts."""

import msgspec

import schema.errors
from schema.errors import RevolveError, error_text
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.robot.robot import Robot
from schema.wire.messages import Traced


class Problem(msgspec.Struct, frozen=True):
    """Error: name of its class in ``schema.errors``, and its one line."""

    kind: str
    line: str


class Task(msgspec.Struct, frozen=True):
    """Task of the process that simulates single robots.

    Attributes:
        settings: JSON of ``EvaluationSettings``.
        is_judged: compute the fitness, too.
        size: width and height of a picture [pixels], instead of a simulation.
        identity: of the evaluation, which noise depends on.
    """

    settings: bytes
    robot: Robot
    plugins: tuple[str, ...]
    is_judged: bool = False
    size: tuple[int, int] | None = None
    identity: Identity = NO_IDENTITY


class Outcome(msgspec.Struct, frozen=True):
    """Outcome of a task.

    Attributes:
        traced: of a simulation.
        failure: how the process ended, if it did.
        picture: PNG.
        problem: why nothing could be done.
    """

    traced: Traced | None = None
    failure: str = ""
    picture: bytes = b""
    problem: Problem | None = None


def problem_of(error: Exception) -> Problem:
    """Return an error as a message; one that is not ours with the name of its class."""
    kind = type(error)
    if kind.__module__ == "schema.errors":
        return Problem(kind.__name__, str(error))
    own = isinstance(error, RevolveError)
    return Problem("RevolveError", str(error) if own else error_text(error))


def error_of(problem: Problem) -> RevolveError:
    """Return the error of a message."""
    kind = getattr(schema.errors, problem.kind, RevolveError)
    error = kind(problem.line)
    assert isinstance(error, RevolveError)
    return error
