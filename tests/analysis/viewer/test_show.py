"""Tests of the recording of a run."""

from unittest.mock import MagicMock

from analysis.viewer.show import Show
from schema.parts import BUILT_IN
from schema.robot.ids import BirthId
from schema.robot.robot import Part
from schema.wire.updates import Birth, Update
from tests.coordinator.arena_world import poses

BODY = (Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),)


def news(sequence: int, *numbers: int) -> Update:
    """Return news of births in an arena, of which number N is born at 10 N seconds."""
    births = tuple(
        Birth(BirthId(0, each - 1), (), 1, each, 10.0 * each, BODY) for each in numbers
    )
    return Update("r", 1, sequence, is_whole=False, experiment="e", births=births)


def test_births_so_far_are_right_after_a_lost_message() -> None:
    """Births 3 and 4 are requested again, and arrive after 5."""
    recording = MagicMock()
    show = Show(recording, BUILT_IN)
    for update in (news(1, 1, 2), news(3, 5), news(4, 1, 2, 3, 4, 5), news(5, 6)):
        show.tell(update)
    first = BirthId(0, 0)
    times_s = (5.0, 10.0, 25.0, 35.0, 45.0, 55.0, 65.0)
    rows = poses([first], *times_s, joints={first: 0})
    show.move(0, rows.rows())
    births = recording.log_poses.call_args.args[2]
    assert births.tolist() == [0, 1, 2, 3, 4, 5, 6]
