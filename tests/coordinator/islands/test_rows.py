"""Counts of the births table, and the column ``measures`` of evaluations."""

import pyarrow as pa
import pytest
from msgspec.structs import replace

from coordinator.evolution.encodings import encoding_of
from coordinator.islands.events import Evaluated, EvaluationFailed
from coordinator.islands.rows import evaluation_record, named_measures, sizes
from schema.experiment.document import Experiment
from schema.parts import BUILT_IN
from schema.robot.genome import ConnectionGene, Node, develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.tables.columns import EVALUATIONS, ROWS
from tests.coordinator.genomes import NEURON, node

BIRTH = BirthId(0, 3)
FOUND = Evaluation(0.5, 0.1, 0.08, 12.0, (0.25, -3.0))
LABELS = ("height", "limp")


def test_measures_have_their_names_in_the_evaluations_row() -> None:
    row = evaluation_record(Evaluated(BIRTH, FOUND, Provenance()), LABELS).row
    assert row["measures"] == [("height", 0.25), ("limp", -3.0)]
    assert list(row) == ROWS["evaluations"].names
    batch = pa.RecordBatch.from_pylist([{"record": 0, **row}], EVALUATIONS)
    assert dict(batch["measures"][0].as_py()) == {"height": 0.25, "limp": -3.0}


def test_failures_and_experiments_without_measures_have_none() -> None:
    failed = EvaluationFailed(BIRTH, "fell", Provenance())
    assert evaluation_record(failed, LABELS).row["measures"] is None
    plain = Evaluated(BIRTH, replace(FOUND, measures=()), Provenance())
    assert evaluation_record(plain).row["measures"] is None
    assert named_measures(LABELS, ()) is None


def test_sizes_of_a_small_robot() -> None:
    nowhere = ConnectionGene(("input", 0), (3, 3), ("output", 0), 1.0)
    loop = ConnectionGene(("output", 0), (), ("output", 0), 1.0)
    touch = node("TouchSensor", connections=(nowhere,))
    hinge = node("ActiveHinge", (1, touch), hidden=(NEURON,), connections=(loop,))
    passive = node("Hinge", (1, node("FixedBrick")))
    core = node("Core", (0, hinge), (3, passive), hidden=(NEURON, NEURON))
    robot = develop(core, BUILT_IN)
    encoding = encoding_of(Experiment(name="test"))
    assert encoding.newborn(core, robot).connections == 2
    assert len(robot.brain.connections) == 1
    assert sizes(robot, BUILT_IN) == {
        "parts": 5,
        "joints": 2,
        "motors": 1,
        "extremities": 2,
        "inputs": 8,
        "outputs": 1,
        "hidden": 3,
    }


@pytest.mark.parametrize("length", [0, 1, 3])
def test_a_tree_with_one_leaf_has_one_extremity(length: int) -> None:
    chain: tuple[tuple[int, Node], ...] = ()
    for _ in range(length):
        chain = ((1, node("FixedBrick", *chain)),)
    core = node("Core", *chain)
    counts = sizes(develop(core, BUILT_IN), BUILT_IN)
    assert (counts["parts"], counts["extremities"]) == (length + 1, 1)
