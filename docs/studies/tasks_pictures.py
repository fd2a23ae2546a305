"""Draws the pictures of docs/tasks.md: best robots that docs/studies/tasks.py kept.

    python -m docs.studies.tasks_pictures

Each picture shows three moments of an evaluation from a fixed camera.
"""

import sys
from pathlib import Path

from analysis.render.files import gait_strip, save_picture
from analysis.render.picture import RobotRenderer, Simulate
from analysis.render.stage import choose_engine
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

PICTURES = Path(__file__).resolve().parents[1] / "pictures" / "tasks"
SIZE = (280, 210)
"""Width and height of each of the three pictures [pixels]."""
SHARES = (0.1, 0.5, 0.99)
"""Moments of the evaluation."""


def main() -> int:
    """Draw all tasks; return 0."""
    choose_engine()
    # They import MuJoCo, which needs to know the engine.
    from docs.studies.tasks import ROBOTS, TASKS  # noqa: PLC0415
    from schema.formats.files import read_robot  # noqa: PLC0415
    from worker.robot.evaluation import simulate  # noqa: PLC0415

    PICTURES.mkdir(exist_ok=True)
    for task, (shipped, _) in TASKS.items():
        file = ROBOTS / f"{task}.yaml"
        if not file.exists():
            print(f"{task}: no robot in {file}")
            continue
        experiment = read_experiment(shipped)
        settings = evaluation_settings_of(experiment)
        robot = read_robot(file, body_space(experiment.space))
        poses = motion(simulate, robot, settings)
        shown = [poses[int(share * len(poses))] for share in SHARES]
        with RobotRenderer(robot, settings, size=SIZE) as renderer:
            frame = renderer.framing(shown)
            strip = [renderer.picture(pose, frame) for pose in shown]
        out = PICTURES / f"{task}.png"
        save_picture(gait_strip(strip), out)
        print(f"{out}: {out.stat().st_size / 1000:.0f} kB")
    return 0


def motion(
    simulate: Simulate, robot: Robot, settings: EvaluationSettings
) -> list[Floats]:
    """Return the state of an evaluation at each tick."""
    poses: list[Floats] = []
    simulate(robot, settings, watch=lambda data: poses.append(data.qpos.copy()))
    return poses


if __name__ == "__main__":
    sys.exit(main())
