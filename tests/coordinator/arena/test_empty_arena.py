"""Tests of what rules see of an arena that all robots have left."""

from coordinator.arena.activity import Activity
from schema.wire.arena import Advance
from schema.wire.poses import PoseArrays


def test_an_arena_without_robots_has_neither_tracks_nor_meetings() -> None:
    tracks = PoseArrays.received(Advance(1, bytes(32), (), (), ()).poses).tracks([])
    assert tracks.shape == (0, 0, 2)
    activity = Activity(0.4, 0.2)
    activity.add(Advance(1, bytes(32), (), (), (), tracks=tracks.tobytes()))
    assert activity.meetings() == ()
