"""Which evaluation of a robot is shown again."""

from pathlib import Path
from unittest.mock import patch

import pyarrow as pa
import pytest

from analysis.measures.load import Run
from analysis.viewer import resimulate
from analysis.viewer.resimulate import Simulators
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.identity import Identity
from schema.experiment.settings import EvaluationSettings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Part, Robot
from schema.wire.codec import encode_robot

ROBOT = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
BIRTH = BirthId(0, 16)


@pytest.mark.parametrize(
    ("fitness", "trial", "named"),
    [
        ([0.2], 0, "0:16: moves"),
        ([0.2, 0.5, 0.3], 1, "0:16, evaluation 2 of 3, the fittest: moves"),
        ([None, 0.0], 1, "0:16, evaluation 2 of 2, the fittest: moves"),
    ],
)
def test_the_fittest_evaluation_of_a_robot_is_shown(
    fitness: list[float | None], trial: int, named: str
) -> None:
    experiment = read_experiment("scenario1")
    rows = {
        "evaluations": [
            {"trial": number, "fitness": value, "path_velocity": 0.1,
             "straight_velocity": 0.1, "simulated_s": 12.0, "platform": "p"}
            for number, value in enumerate(fitness)
        ],
        "births": [{"genome": None, "robot": encode_robot(ROBOT)}],
    }  # fmt: skip
    asked: list[int] = []

    def alone(
        _robot: Robot, _settings: EvaluationSettings, identity: Identity
    ) -> tuple[Evaluation, pa.Table]:
        asked.append(identity.trial)
        shown = fitness[identity.trial]
        assert shown is not None
        return Evaluation(shown, 0.1, 0.1, 12.0), pa.table({})

    simulators = Simulators(alone, lambda *_: (b"", None), lambda *_: iter(()))  # type: ignore[arg-type]
    run = Run(Path(), "e", 0, 1, "finished", experiment_text(experiment), ())
    with (
        patch.object(
            resimulate,
            "_rows_of",
            lambda _folder, table, _birth: pa.Table.from_pylist(rows[table]),
        ),
        patch.object(resimulate, "robot_of_birth", lambda *_: ROBOT),
    ):
        (motion,) = resimulate.resimulate(run, [BIRTH], simulators, lambda _: None)
    assert asked == [trial]
    assert motion.verdict.startswith(named)
