"""The column ``measures`` of the rows of evaluations and samples."""

from dataclasses import replace

import pyarrow as pa

from coordinator.islands.events import Evaluated, EvaluationFailed
from coordinator.islands.rows import evaluation_record, named_measures
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.tables.columns import EVALUATIONS, ROWS

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
