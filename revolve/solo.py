"""Simulation, evaluation and pictures of single robots, in a process of their own."""

import io
from contextlib import suppress

import msgspec

from revolve.messages import Outcome, Task, problem_of
from schema.agent.extras import extra
from schema.experiment.document import body_space
from schema.experiment.settings import EvaluationSettings, read_evaluation_settings
from schema.plugins.permission import allow
from schema.robot.robot import Robot, check_types

_TASKS = msgspec.msgpack.Decoder(Task)


def outcome_of(data: bytes) -> bytes:
    """Return the encoded outcome of an encoded task; no error passes."""
    try:
        outcome = _done(_TASKS.decode(data))
    except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
        outcome = Outcome(problem=problem_of(error))
    return msgspec.msgpack.encode(outcome)


def _done(task: Task) -> Outcome:
    allow(task.plugins)
    # Before MuJoCo is imported, in case that any task is a picture.
    with suppress(ImportError):
        from analysis.render.stage import choose_engine  # noqa: PLC0415

        choose_engine()
    from worker.kinds import checked  # noqa: PLC0415
    from worker.robot.evaluation import evaluate_traced  # noqa: PLC0415

    # Before the robot, whose neurons may be those of a plug-in.
    settings = checked(read_evaluation_settings(task.settings))
    robot = task.robot
    check_types(robot, body_space(settings.space))
    if task.size is not None:
        return Outcome(picture=_picture(robot, settings, task.size))
    identity, is_judged = task.identity, task.is_judged
    return Outcome(evaluate_traced(robot, settings, identity, is_judged=is_judged))


def _picture(
    robot: Robot, settings: EvaluationSettings, size: tuple[int, int]
) -> bytes:
    with extra("pictures need", "pictures"):
        from PIL import Image  # noqa: PLC0415

        from analysis.render.picture import RobotRenderer  # noqa: PLC0415
    file = io.BytesIO()
    with RobotRenderer(robot, settings, size=size) as renderer:
        Image.fromarray(renderer.picture()).save(file, "PNG")
    return file.getvalue()
