"""Trials of a robot in the journal."""

import pytest

from coordinator.islands.events import Asked, Evaluated, EvaluationFailed
from coordinator.storage.journal_codec import decode_entry, encode_entry
from schema.errors import MalformedMessage
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.wire import revolve_pb2 as pb

NAME = BirthId(2, 17)
JUDGED = Evaluation(0.5, 0.1, 0.08, 27.5)
MEASURED = Evaluation(0.5, 0.1, 0.08, 27.5, (0.25, -3.0))


@pytest.mark.parametrize("trial", [0, 1, 200])
def test_trials_are_read_as_they_were_written(trial: int) -> None:
    for event in (
        Evaluated(NAME, JUDGED, Provenance("w", "p", 0.5), trial),
        Evaluated(NAME, MEASURED, Provenance("w", "p", 0.5), trial),
        EvaluationFailed(NAME, "diverged", Provenance("w", "p", 0.5), trial),
    ):
        assert decode_entry(encode_entry(event)) == event


def test_a_first_trial_has_the_bytes_of_older_versions() -> None:
    first = encode_entry(Evaluated(NAME, JUDGED, Provenance("w", "p", 0.5)))
    second = encode_entry(Evaluated(NAME, JUDGED, Provenance("w", "p", 0.5), 1))
    # Field 12, a varint: its key is 12 << 3.
    assert second == first + bytes([12 << 3, 1])


@pytest.mark.parametrize("points", [((0.5, 0.25),), ((0.1,), (1 / 3,), (1.0,))])
def test_answers_of_learners_are_read_as_they_were_written(
    points: tuple[tuple[float, ...], ...],
) -> None:
    event = Asked(NAME, 3, points)
    assert decode_entry(encode_entry(event)) == event


@pytest.mark.parametrize(
    ("points", "values"), [(2, [0.5] * 3), (0, [0.5]), (2, []), (1, [float("nan")])]
)
def test_points_without_equally_many_values_are_refused(
    points: int, values: list[float]
) -> None:
    asked = pb.LearnerEntry(points=points, values=values)
    with pytest.raises(MalformedMessage, match=r"asked|points must have"):
        decode_entry(pb.Entry(asked=asked).SerializeToString())
