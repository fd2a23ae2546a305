"""Births of a run folder must be of the encoding that the run uses now."""

from pathlib import Path

import pyarrow as pa
import pytest
from msgspec import structs

from coordinator.evolution.breeding import Breeder
from coordinator.evolution.encodings import encoding_of
from coordinator.run import stored_genomes
from coordinator.run.stored_genomes import check_stored_genomes
from schema.errors import RunFolderError
from schema.experiment.document import EncodingSection, Experiment, Space
from schema.experiment.learning import Learning
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.protobuf import decode_robot, encode_robot

THESIS = Experiment(name="test")
CPPN = Experiment(name="test", encoding=EncodingSection(type="cppn"))
SMALL = Space(max_parts=3)
FOLDER = Path("runs/a")


def stored(
    monkeypatch: pytest.MonkeyPatch, experiment: Experiment, count: int = 1
) -> pa.Table:
    """Let the folder hold births of an experiment; return them."""
    encoding, breeder = encoding_of(experiment), Breeder(experiment, 7, 0)
    rows = []
    for number in range(count):
        candidate = breeder.candidate(BirthId(0, number), 0, ())
        assert candidate is not None
        robot = encode_robot(candidate.robot) if encoding.stores_robots else None
        genome = encoding.to_bytes(candidate.genome)
        rows.append({"birth": number, "genome": genome, "robot": robot})
    columns = {"birth": pa.int64(), "genome": pa.binary(), "robot": pa.binary()}
    table = pa.Table.from_pylist(rows, schema=pa.schema(columns))
    monkeypatch.setattr(stored_genomes, "read_table", lambda *_: table)
    return table


@pytest.mark.parametrize(
    ("then", "now", "why"),
    [
        (THESIS, CPPN, r"another encoding than 'cppn' is now: not"),
        (CPPN, structs.replace(CPPN, space=SMALL), r"birth 0 .* into another robot"),
    ],
)
def test_births_of_another_encoding_or_development_are_refused(
    monkeypatch: pytest.MonkeyPatch, then: Experiment, now: Experiment, why: str
) -> None:
    stored(monkeypatch, then)
    with pytest.raises(RunFolderError, match=why):
        check_stored_genomes(FOLDER, now)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_births_of_the_same_encoding_are_accepted(
    monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    stored(monkeypatch, CPPN, count)
    check_stored_genomes(FOLDER, CPPN)


def test_births_of_the_thesis_encoding_are_not_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(stored_genomes, "read_table")
    check_stored_genomes(FOLDER, THESIS)


def test_a_learnt_brain_is_not_another_encoding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A smaller body is, also where brains are learnt."""
    rows = stored(monkeypatch, CPPN).to_pylist()
    learnt = Robot(decode_robot(rows[0]["robot"]).parts, Brain())
    table = pa.Table.from_pylist([{**rows[0], "robot": encode_robot(learnt)}])
    monkeypatch.setattr(stored_genomes, "read_table", lambda *_: table)
    learning = structs.replace(CPPN, learning=Learning())
    check_stored_genomes(FOLDER, learning)
    with pytest.raises(RunFolderError, match="into another robot now"):
        check_stored_genomes(FOLDER, CPPN)
    with pytest.raises(RunFolderError, match="into another robot now"):
        check_stored_genomes(FOLDER, structs.replace(learning, space=SMALL))
