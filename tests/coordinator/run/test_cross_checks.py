"""Audits: which evaluations are done twice, and what happens to the pair."""

import pytest
from msgspec.structs import replace

from coordinator.islands.events import (
    QUARANTINED,
    Audited,
    Evaluated,
    EvaluationFailed,
)
from coordinator.run.cross_checks import Checks, CrossChecks, audit_records, describe
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.tables.columns import ROWS
from schema.wire.messages import Bred

BIRTH = BirthId(2, 7)
ONE = Evaluated(BIRTH, Evaluation(0.25, 0.0, 0.05, 12.0), Provenance("a", "p", 0.1))
OTHER = replace(ONE, provenance=Provenance("b", "q", 0.7))
DIFFERENT = replace(OTHER, evaluation=replace(ONE.evaluation, fitness=0.25 + 1e-16))
FAILED = EvaluationFailed(BIRTH, "flew away", Provenance("c", "p", 0.1))


def chosen(share: float) -> list[int]:
    checks = Checks(share)
    return [n for n in range(4000) if checks.chooses(BirthId(0, n), 0)]


def test_birth_decides_whether_an_evaluation_is_checked() -> None:
    assert chosen(0.0) == []
    assert len(chosen(1.0)) == 4000
    some = chosen(0.05)
    # Within four standard deviations of a binomial law.
    assert abs(len(some) - 200) < 4 * (4000 * 0.05 * 0.95) ** 0.5
    assert some == chosen(0.05)
    assert set(some) < set(chosen(0.2))


def test_first_job_of_equal_answers_counts_in_any_order() -> None:
    for order in ((4, 5), (5, 4)):
        audits = CrossChecks()
        audits.pair(4, 5)
        outcomes = {4: ONE, 5: OTHER}
        first, second = order
        assert audits.settle(first, outcomes[first]) == []
        both = audits.settle(second, outcomes[second])
        assert both == [Audited(ONE, OTHER), ONE]


@pytest.mark.parametrize("other", [FAILED, replace(DIFFERENT)])
def test_different_answers_give_no_result(other: Evaluated | EvaluationFailed) -> None:
    audits = CrossChecks()
    audits.pair(4, 5)
    audits.settle(5, other)
    (audited,) = audits.settle(4, replace(ONE, evaluation=_far()))
    assert isinstance(audited, Audited)
    assert not audited.agrees
    told = describe(audited)
    assert "birth 7 of island 2" in told
    assert "a (p) says fitness 9.5" in told
    assert other.provenance.agent in told


def _far() -> Evaluation:
    return replace(ONE.evaluation, fitness=9.5)


def test_equal_failures_agree() -> None:
    assert Audited(FAILED, replace(FAILED, provenance=Provenance("d"))).agrees
    assert not Audited(FAILED, replace(FAILED, reason="fell")).agrees


def test_two_quarantines_settle_an_audit_whatever_ended_the_processes() -> None:
    """The table says that the answers are not equal; the run goes on."""
    first, second = (
        EvaluationFailed(BIRTH, f"{QUARANTINED}by {cause}", Provenance(worker))
        for worker, cause in (("a", "CPU limit"), ("b", "SIGSEGV"))
    )
    audits = CrossChecks()
    audits.pair(4, 5)
    assert audits.settle(5, second) == []
    assert audits.settle(4, first) == [Audited(first, second), first]
    assert not Audited(first, second).agrees
    assert not Audited(first, FAILED).is_settled
    assert not Audited(ONE, second).is_settled


def test_outcome_of_a_single_job_passes_unchanged() -> None:
    audits = CrossChecks()
    bred = Bred(BIRTH, 0, ("why",))
    assert audits.settle(1, ONE) == [ONE]
    assert audits.settle(2, bred) == [bred]


def test_rows_have_the_columns_of_their_table() -> None:
    records = audit_records(Audited(ONE, FAILED))
    for record in records:
        assert list(record.row) == ROWS["audits"].names
    assert [record.row["fitness"] for record in records] == [0.25, None]
