"""Simulation, evaluation and pictures of single robots, in a process of their own."""

import io
from contextlib import suppress

import msgspec

from analysis.extras import extra
from revolve.messages import Outcome, Task, problem_of
from schema.errors import SensorFailed, SimulationDiverged
from schema.experiment.document import body_space
from schema.experiment.settings import EvaluationSettings
from schema.plugins.permission import allow
from schema.robot.robot import Robot, check_types
from schema.wire.trace import pack_trace

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
    from worker.robot.evaluation import evaluate_traced, simulate  # noqa: PLC0415
    from worker.serve.checks import checked_evaluation  # noqa: PLC0415

    # Before the robot, whose neurons may be those of a plug-in.
    settings = checked_evaluation(task.settings)
    robot = task.robot
    check_types(robot, body_space(settings.space))
    if task.size is not None:
        return Outcome(picture=_picture(robot, settings, task.size))
    if task.is_judged:
        outcome, trace = evaluate_traced(robot, settings, task.identity)
    else:
        outcome = ""
        try:
            trace = simulate(robot, settings, identity=task.identity)
        except (SimulationDiverged, SensorFailed) as error:
            outcome, trace = str(error), None
    packed = None if trace is None else pack_trace(trace)
    if isinstance(outcome, str):
        return Outcome(packed, failure=outcome)
    return Outcome(packed, outcome)


def _picture(
    robot: Robot, settings: EvaluationSettings, size: tuple[int, int]
) -> bytes:
    """Return a picture of a robot in neutral pose, as PNG."""
    with extra("pictures need", "pictures"):
        from PIL import Image  # noqa: PLC0415

        from analysis.render.picture import RobotRenderer  # noqa: PLC0415
    file = io.BytesIO()
    with RobotRenderer(robot, settings, size=size) as renderer:
        Image.fromarray(renderer.picture()).save(file, "PNG")
    return file.getvalue()
