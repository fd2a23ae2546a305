"""Requests in, answers out: the analyzer's work without its network."""

import time

from analyzer.report import analyze
from schema.experiment.document import body_space
from schema.experiment.settings import read_vetting_settings
from schema.robot.robot import check_body
from schema.wire.codec import Answer, decode_body, decode_request, encode_answer


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded request.

    Args:
        request: a ``Request`` with ``VettingSettings``, about a body: a brain that it
            holds is not looked at.

    Returns:
        An ``Answer`` with a report; it depends on nothing but the request, except
        for ``wall_s``.

    Raises:
        MalformedMessage: not a request's bytes.
        ExperimentError: settings that are none, or name what is not there.
        InvalidRobot: a body that the body space does not allow.
    """
    start = time.perf_counter()
    asked = decode_request(request, decode_body)
    settings = read_vetting_settings(asked.settings)
    space = body_space(settings.space)
    check_body(asked.robot.parts, space)
    report = analyze(asked.robot, space, settings.vetting)
    wall_s = time.perf_counter() - start
    return encode_answer(Answer(asked.epoch, asked.number, wall_s, report))
