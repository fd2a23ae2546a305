"""The work of requests of all kinds, and calls of users' own functions."""

import msgspec

from schema.errors import FAILURES, ExperimentError, MalformedMessage, error_text
from schema.experiment.changes import settings_at
from schema.experiment.document import body_space
from schema.experiment.identity import Identity
from schema.experiment.settings import lasting, read_evaluation_settings
from schema.plugins.load import load_function
from schema.robot.brain import check_brain
from schema.robot.results import Evaluation
from schema.robot.robot import check_tree, check_types
from schema.wire.arena import AdvanceShard
from schema.wire.calls import CallSettings, pack_value, unpack_value
from schema.wire.messages import (
    Call,
    CallValue,
    Evaluate,
    Failure,
    Request,
    Result,
    Traced,
)
from worker.kinds import checked
from worker.robot.evaluation import evaluate, evaluate_traced
from worker.serve.shards import Shards


class Jobs(msgspec.Struct, frozen=True):
    """Evaluations and arena shards of one worker process."""

    shards: Shards

    def answer(self, request: Request) -> Result:
        """Return the result of a request of any kind.

        Raises:
            RevolveError: see ``answer_evaluation``, ``call_function`` and
                ``Shards.answer``.
        """
        match request.work:
            case AdvanceShard():
                return self.shards.answer(request, request.work)
            case Call():
                return call_function(request.work, request.settings)
            case Evaluate():
                return answer_evaluation(request, request.work)
        raise MalformedMessage("a worker breeds no robots")


def answer_evaluation(
    request: Request, work: Evaluate
) -> Evaluation | Traced | Failure:
    """Return the outcome of an evaluation.

    Diverged physics, a failed sensor and an undefined fitness are results: failures.

    ``request``: ``EvaluationSettings``, and the origin of the noise.

    Raises:
        ExperimentError: invalid settings, a plug-in that is unknown or breaks its
            contract, or a sensor that has no stimulus in the environment.
        InvalidRobot: a robot that breaks the rules of its body space.
    """
    whole = checked(read_evaluation_settings(request.settings))
    settings = settings_at(whole, work.point or 0)
    robot = work.robot
    check_tree(robot.parts)
    check_brain(robot.brain, len(robot.parts))
    check_types(robot, body_space(settings.space))
    if work.steps:
        settings = lasting(settings, work.steps)
    identity = Identity(request.origin, work.birth, work.trial)
    if work.is_traced:
        return evaluate_traced(robot, settings, identity)
    try:
        return evaluate(robot, settings, identity)
    except FAILURES as error:
        return Failure(str(error))


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
