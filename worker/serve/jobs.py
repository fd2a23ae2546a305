"""One request in, one answer out: what the service hands to a process."""

import time
from collections.abc import Callable

from schema.errors import FitnessUndefined, SimulationDiverged
from schema.experiment.document import body_space
from schema.experiment.settings import lasting, read_evaluation_settings
from schema.robot.results import Evaluation
from schema.robot.robot import check_types
from schema.wire.arena_codec import Live
from schema.wire.codec import (
    Answer,
    decode_request,
    encode_answer,
    is_advance_request,
)
from worker.arena.world import World
from worker.robot.evaluation import evaluate
from worker.serve.shards import Shards


class Jobs:
    """All that one worker process does: evaluations, and its arena shards."""

    def __init__(
        self, *, threads: int = 1, publish: Callable[[Live], None] = lambda _: None
    ) -> None:
        """Hold no shard yet.

        Args:
            threads: that advance one arena together; the result is the same.
            publish: told of each advance, for those who watch.
        """
        self._shards = Shards(World, threads=threads, publish=publish)

    def answer(self, request: bytes) -> bytes:
        """Return the encoded answer to an encoded request of either kind.

        Raises:
            RevolveError: a request that cannot be done here; see ``answer`` and
                ``Shards.answer``.
        """
        if is_advance_request(request):
            return self._shards.answer(request)
        return answer(request)


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded evaluation request.

    A function of its content but for ``wall_s``, which decides nothing. A robot
    whose physics diverge is answered with the reason, not raised: it is a result.

    Raises:
        MalformedMessage: bytes that are no request.
        ExperimentError: settings that are none, a plug-in that nothing answers
            to, a sensor that the world has nothing for.
        InvalidRobot: a robot that breaks the rules of its body space.
    """
    began = time.perf_counter()
    job = decode_request(request)
    settings = read_evaluation_settings(job.settings)
    check_types(job.robot, body_space(settings.space))
    result: Evaluation | str
    try:
        result = evaluate(job.robot, lasting(settings, job.steps), job.identity)
    except (SimulationDiverged, FitnessUndefined) as error:
        result = str(error)
    wall_s = time.perf_counter() - began
    return encode_answer(Answer(job.epoch, job.number, wall_s, result))
