"""Which robots, and which of their evaluations, are simulated again."""

from pathlib import Path
from typing import Any
from unittest.mock import patch

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from msgspec.structs import replace

from analysis.measures.load import LoadedRun
from analysis.viewer import resimulate
from analysis.viewer.motion import named_robot, selected_robots
from analysis.viewer.recording import ViewerError
from analysis.viewer.resimulate import Simulators
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.identity import Identity
from schema.experiment.robust import Robust
from schema.experiment.settings import EvaluationSettings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Part, Robot
from schema.tables.columns import TABLES
from schema.tables.files import parquet_path
from schema.wire.protobuf import encode_robot
from tests.analysis.tables import births, table


def write(folder: Path, **rows: list[dict[str, Any]]) -> None:
    for name in ("evaluations", "fitness", "population"):
        path = parquet_path(folder, "e", 0, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table(name, rows.get(name, [])), path)


def test_the_best_lives_at_the_end_and_the_best_ever_may_be_dead(
    tmp_path: Path,
) -> None:
    fitness = (0.1, 0.5, None, 0.5, 0.3)
    judged = [{"birth": n, "fitness": value} for n, value in enumerate(fitness)]
    last = [
        {"births": 4, "birth": 1, "fitness": 0.5},
        {"births": 5, "birth": 0, "fitness": 0.1},
        {"births": 5, "birth": 4, "fitness": 0.3},
    ]
    young = {"birth": 7, "fitness": 0.9, "is_mature": False}
    # The order of the table does not count.
    write(tmp_path, evaluations=judged[::-1], fitness=[young], population=last)
    said = "best of the last population: 0:4, fitness 0.3000"
    assert named_robot(tmp_path, "best") == (BirthId(0, 4), said)
    said = "best ever: 0:1, fitness 0.5000"
    assert named_robot(tmp_path, "best-ever") == (BirthId(0, 1), said)
    grown = {"birth": 8, "island": 2, "birth_island": 1, "fitness": 0.8}
    grown["is_mature"] = True
    write(tmp_path, evaluations=judged, fitness=[young, grown], population=last)
    birth, said = named_robot(tmp_path, "best-ever")
    assert birth == BirthId(1, 8)
    assert said == (
        "best ever: 1:8, fitness 0.8000 on island 2; shown as on its island of birth"
    )


@pytest.mark.parametrize("name", ["best", "best-ever"])
def test_without_evaluations_there_is_no_best(tmp_path: Path, name: str) -> None:
    write(tmp_path)
    with pytest.raises(ViewerError, match="no robot has a fitness yet"):
        named_robot(tmp_path, name)


def test_ancestry_follows_first_parents_each_once(tmp_path: Path) -> None:
    path = parquet_path(tmp_path, "e", 0, "births")
    path.parent.mkdir(parents=True)
    a, b, c, d = ((0, number) for number in range(4))
    pq.write_table(births((a, []), (b, []), (c, [b, a]), (d, [c, a])), path)
    names = [BirthId(*each) for each in (d, c, a)]
    found = selected_robots(tmp_path, names, has_ancestry=True)
    assert found == [BirthId(*each) for each in (d, c, b, a)]
    with pytest.raises(ViewerError, match="0:9: no robot of that name"):
        selected_robots(tmp_path, [BirthId(0, 9)], has_ancestry=False)


ROBOT = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
BIRTH = BirthId(0, 16)


def shown_again(
    experiment: Experiment,
    fitness: list[float | None],
    trials: tuple[float | None, ...] = (),
) -> tuple[int, str]:
    """Return the number of the evaluation that is simulated, and the verdict.

    Args:
        experiment: settings.
        fitness: of the recorded evaluations.
        trials: fitness of the trials of a robot that learns.
    """
    named = {"island": BIRTH.island, "birth": BIRTH.number}
    rows: dict[str, list[dict[str, Any]]] = {
        "evaluations": [
            {**named, "trial": number, "point": None, "fitness": value,
             "path_velocity": 0.1, "straight_velocity": 0.1, "simulated_s": 12.0,
             "platform": "p"}
            for number, value in enumerate(fitness)
        ],
        "births": [{**named, "genome": None, "robot": encode_robot(ROBOT)}],
        "learning": [
            {**named, "trial": number, "fitness": value}
            for number, value in enumerate(trials)
        ],
    }  # fmt: skip
    asked: list[int] = []
    known = [value for value in fitness if value is not None]

    def alone(
        _robot: Robot, _settings: EvaluationSettings, identity: Identity
    ) -> tuple[Evaluation, pa.Table]:
        asked.append(identity.trial)
        return Evaluation(max(known), 0.1, 0.1, 12.0), pa.table({})

    simulators = Simulators(alone, lambda *_: (b"", None), lambda *_: iter(()))  # type: ignore[arg-type]
    text = experiment_text(experiment)
    run = LoadedRun(Path(), "e", 0, 1, "finished", text, experiment)
    with (
        patch.object(
            resimulate,
            "_rows_of",
            lambda _folder, table, _birth: pa.Table.from_pylist(
                rows[table], TABLES[table] if table == "learning" else None
            ),
        ),
        patch.object(resimulate, "robot_of_birth", lambda *_: ROBOT),
    ):
        (motion,) = resimulate.resimulate(run, [BIRTH], simulators, lambda _: None)
    (number,) = asked
    return number, motion.verdict


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
    shown, verdict = shown_again(read_experiment("scenario1"), fitness)
    assert shown == trial
    assert verdict.startswith(named)


@pytest.mark.parametrize(
    ("fitness", "trials", "trial"),
    [
        ([0.5], (0.2, None, 0.5, 0.5, 0.3), 2),
        ([-0.2], (None, -0.3, -0.2), 2),
        # A re-evaluation has its own number, and only its brain was learnt.
        ([0.5, 0.7], (0.2, 0.1, 0.5), 1),
    ],
)
def test_a_learnt_robot_is_shown_as_in_its_best_trial(
    fitness: list[float | None], trials: tuple[float | None, ...], trial: int
) -> None:
    """Noise and pushes depend on the number of the trial."""
    shown, verdict = shown_again(read_experiment("scenario1"), fitness, trials)
    assert shown == trial
    assert verdict.endswith("moves as recorded, equal to the last bit")


def test_a_motion_without_the_disturbances_of_its_evaluation_is_named_so() -> None:
    experiment = replace(read_experiment("scenario1"), robust=Robust(draws=2))
    _, verdict = shown_again(experiment, [0.2])
    assert verdict == (
        "0:16: evaluates as recorded, equal to the last bit; shown without disturbances"
    )
