"""Requests of all kinds and their answers, as bytes."""

import time
from dataclasses import dataclass

from schema.errors import FitnessUndefined, SensorFailed, SimulationDiverged
from schema.experiment.document import body_space
from schema.experiment.settings import lasting
from schema.robot.results import Evaluation
from schema.robot.robot import check_types
from schema.wire.codec import (
    Answer,
    decode_request,
    encode_answer,
    request_kind,
)
from worker.robot.evaluation import evaluate
from worker.serve.calls import answer_call
from worker.serve.checks import checked_evaluation
from worker.serve.shards import Shards


@dataclass(frozen=True, slots=True)
class Jobs:
    """Evaluations and arena shards of one worker process."""

    shards: Shards

    def answer(self, request: bytes) -> bytes:
        """Return the encoded answer to an encoded request of any kind.

        Raises:
            RevolveError: see ``answer``, ``answer_call`` and ``Shards.answer``.
        """
        match request_kind(request):
            case "advance":
                return self.shards.answer(request)
            case "call":
                return answer_call(request)
            case "evaluation":
                return answer(request)


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded evaluation request.

    A function of the request but for ``wall_s``, which affects nothing. Diverged
    physics, a failed sensor and an undefined fitness are results, answered with the
    reason.

    Raises:
        MalformedMessage: the bytes are no request.
        ExperimentError: invalid settings, a plug-in that is unknown or breaks its
            contract, or a sensor that has no stimulus in the environment.
        InvalidRobot: a robot that breaks the rules of its body space.
    """
    start = time.perf_counter()
    job = decode_request(request, prepare=checked_evaluation)
    settings = checked_evaluation(job.settings)
    check_types(job.robot, body_space(settings.space))
    if job.steps:
        settings = lasting(settings, job.steps)
    result: Evaluation | str
    try:
        result = evaluate(job.robot, settings, job.identity)
    except (SimulationDiverged, SensorFailed, FitnessUndefined) as error:
        result = str(error)
    wall_s = time.perf_counter() - start
    return encode_answer(Answer(job.epoch, job.number, wall_s, result))
