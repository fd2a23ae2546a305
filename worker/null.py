"""A worker that does not simulate: what everything else costs.

Every robot is judged 0 at once. For benchmarks of dispatch, network and tables.
"""

from schema.codec import Answer, decode_request, encode_answer
from schema.evaluation import Evaluation
from schema.network import Agent
from schema.service import serve_as_process
from schema.supervision import Post


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded evaluation request: fitness 0.

    Raises:
        MalformedMessage: bytes that are no request.
    """
    job = decode_request(request)
    nothing = Evaluation(0.0, 0.0, 0.0, 0.0)
    return encode_answer(Answer(job.epoch, job.number, 0.0, nothing))


def process(agent: Agent, post: Post) -> None:
    """Be one process of a crew of such workers; returns when asked to end."""
    serve_as_process(answer, agent, post)
