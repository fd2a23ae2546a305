"""Replies to operators: safe text, and the time that is left."""

from schema.wire.codec import encode
from schema.wire.operator import OperatorReply, decode_operator_reply
from schema.wire.status import IslandStatus, RunStatus, Status


def test_text_of_a_reply_cannot_control_a_terminal() -> None:
    reply = OperatorReply("birth  rank\n\x1b[2J    1\x9b\u202e")
    text = decode_operator_reply(encode(reply)).text
    assert text == "birth  rank\n?[2J    1??"


def test_time_left_counts_what_is_still_to_be_born() -> None:
    done = RunStatus("c", "c", 0, "finished", 0.0, (IslandStatus(9, 50, 0.1, 3),))
    half = RunStatus("d", "d", 0, "running", 2.0, (IslandStatus(30, 50, 0.1, 3),))
    assert Status((done, half), 1, 1, 2.0).left_s == 10.0
    assert Status((done, half), 0, 1, 0.0).left_s is None
    # A slow run beside a fast one: 20 births at 0.5/s.
    slow = RunStatus("e", "e", 0, "running", 0.5, half.islands)
    assert Status((half, slow), 1, 1, 2.5).left_s == 40.0
    assert Status((done,), 0, 1, 0.0).left_s == 0.0


def test_time_left_is_unknown_while_an_arena_is_paused() -> None:
    islands = (IslandStatus(30, 50, 0.1, 3), IslandStatus(9, 50, 0.1, 3, 8.0, True))
    paused = RunStatus("d", "d", 0, "running", 2.0, islands)
    other = RunStatus("e", "e", 0, "running", 2.0, islands[:1])
    assert paused.left_s is None
    assert Status((other, paused), 1, 1, 4.0).left_s is None
    assert Status((other,), 1, 1, 4.0).left_s == 10.0
