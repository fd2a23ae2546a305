"""A run that is killed repeatedly has the tables of an undisturbed run.

Everything but the physics is real: island, loop, analyzer, journal and tables.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from msgspec import structs

from coordinator.islands.events import Ask, Asked, EvaluationFailed
from coordinator.run.history import begun_loop
from coordinator.run.learners import Learners
from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME, Journal
from coordinator.storage.snapshots import Snapshots
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment, SelectionSection
from schema.experiment.file import experiment_text
from schema.experiment.learning import Learning
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.tables.description import RunDetails
from schema.tables.files import read_table
from schema.wire.messages import Evaluate, Failure, Request
from schema.wire.protobuf import encode_robot
from tests.coordinator.reports import PROVENANCE
from tests.coordinator.run.test_arena_resume import Killed
from tests.coordinator.run.test_arena_resume import run as conduct

EXPERIMENT = Experiment(
    name="resume", births=40, selection=SelectionSection(population=8, children=6)
)
LEARNING = structs.replace(
    EXPERIMENT,
    births=20,
    learning=Learning(budget=7, inherit="lamarckian", parameters={"population": 4}),
)
DETAILS = RunDetails("resume", 0, 3, experiment_text(EXPERIMENT))


@dataclass
class Worker:
    """Agents that answer by the robot's bytes, and die after some answers."""

    left: int
    asked: int = field(default=0)

    def answer(self, request: Request) -> Evaluation | Failure:
        """Return a fitness that depends on the robot alone; one in nine fails."""
        self.asked += 1
        if self.asked > self.left:
            raise Killed
        assert isinstance(request.work, Evaluate)
        number = crc32(encode_robot(request.work.robot))
        if number % 9 == 0:
            return Failure("diverged")
        return Evaluation(number / 2**32, 0.2, 0.1, 12.0)


def run(
    path: Path, *, answers: int = 10**9, experiment: Experiment = EXPERIMENT
) -> int:
    """Start or resume until the end or N evaluations; return their number."""
    worker = Worker(answers)
    has_ended = conduct(path, document=experiment, worker=worker.answer)
    return worker.asked - (not has_ended)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an undisturbed run."""
    path = tmp_path_factory.mktemp("undisturbed") / "run"
    assert run(path) == EXPERIMENT.births
    return path


def test_answered_requests_are_not_repeated(tmp_path: Path, undisturbed: Path) -> None:
    path = tmp_path / "run"
    asked = [run(path, answers=answers) for answers in (0, 1, 5, 13, 2)]
    assert asked == [0, 1, 5, 13, 2]
    assert run(path) == EXPERIMENT.births - sum(asked)
    assert compare(undisturbed, path) == []
    # Every row stands once, and the failed are among them.
    table = read_table(path, "evaluations")
    assert table["record"].to_pylist() == list(range(EXPERIMENT.births))
    assert {"ok", "failed"} == set(table["status"].to_pylist())


@pytest.mark.parametrize("seed", range(6))
def test_lost_ends_of_all_files_are_restored(
    tmp_path: Path, undisturbed: Path, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    path = tmp_path / "run"
    for _ in range(3):
        run(path, answers=int(rng.integers(0, 12)))
        # As a failing power supply may leave them, each by itself.
        for file in [path / NAME, *sorted((path / "segments").iterdir())]:
            os.truncate(file, int(file.stat().st_size * rng.uniform(0.3, 1.0)))
    run(path)
    assert compare(undisturbed, path) == []


def test_resuming_a_finished_run_changes_nothing(
    tmp_path: Path, undisturbed: Path
) -> None:
    path = tmp_path / "run"
    run(path, answers=20)
    run(path)
    assert run(path) == 0
    assert compare(undisturbed, path) == []


def test_newborns_that_learn_are_resumed_in_the_middle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after a kill between the answer of a learner and what follows from it."""
    whole, path = tmp_path / "whole", tmp_path / "run"
    assert run(whole, experiment=LEARNING) == LEARNING.births * 7
    answer, rng = Learners.answer, np.random.default_rng(1)
    asked: list[Ask] = []

    def counted(self: Learners, ask: Ask) -> Asked:
        asked.append(ask)
        if len(asked) in (3, 9, 21):
            raise Killed
        return answer(self, ask)

    monkeypatch.setattr(Learners, "answer", counted)
    for _ in range(12):
        run(path, answers=int(rng.integers(0, 20)), experiment=LEARNING)
    run(path, experiment=LEARNING)
    assert compare(whole, path) == []
    assert read_table(path, "learning").num_rows == LEARNING.births * 7
    # Two requests for each newborn; those three were lost, and no answer was asked for
    # twice.
    assert len(asked) == LEARNING.births * 2 + 3


def test_an_unexpected_event_comes_with_the_last_ones(undisturbed: Path) -> None:
    with Journal.open(undisturbed) as journal:
        events = journal.replay()
    stranger = EvaluationFailed(BirthId(0, 10**6), "no such robot", PROVENANCE)
    details = structs.replace(DETAILS, document=experiment_text(EXPERIMENT))
    loop = begun_loop(details, Snapshots(undisturbed))
    for event in events:
        loop.repeat(event)
    with pytest.raises(UnexpectedEvent) as caught:
        loop.repeat(stranger)
    last = str(caught.value).partition("; the last events: ")[2].split("; ")
    assert len(last) == 20
    birth = "birth=BirthId(island=0, number=1000000)"
    assert last[-1] == f"EvaluationFailed({birth}, reason=no such robot, trial=0)"
    assert last[-2].startswith(type(events[-1]).__name__)
