"""The journal tells the trials of a robot apart."""

import pytest

from coordinator.islands.events import Evaluated, EvaluationFailed
from coordinator.storage.journal_codec import decode_entry, encode_entry
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance

NAME = BirthId(2, 17)
JUDGED = Evaluation(0.5, 0.1, 0.08, 27.5)


@pytest.mark.parametrize("trial", [0, 1, 200])
def test_a_trial_comes_back_as_it_was(trial: int) -> None:
    for event in (
        Evaluated(NAME, JUDGED, Provenance("w", "p", 0.5), trial),
        EvaluationFailed(NAME, "diverged", Provenance("w", "p", 0.5), trial),
    ):
        assert decode_entry(encode_entry(event)) == event


def test_a_first_trial_is_the_same_bytes_as_before_there_were_others() -> None:
    first = encode_entry(Evaluated(NAME, JUDGED, Provenance("w", "p", 0.5)))
    second = encode_entry(Evaluated(NAME, JUDGED, Provenance("w", "p", 0.5), 1))
    # Field 12, a varint: its key is 12 << 3.
    assert second == first + bytes([12 << 3, 1])
