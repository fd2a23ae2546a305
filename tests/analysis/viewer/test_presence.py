"""Presence of hubs and coordinators, as a viewer understands it."""

import pytest

from analysis.viewer.presence import PATIENCE_S, SETTLED_S, Presence
from schema.agent.topics import Member

CHIEF = Member("default", "coordinator", "chief.1")
OTHER = Member("default", "coordinator", "other.1")
HUB, NEW_HUB, CHIEFS_HUB = (frozenset({name}) for name in ("a0", "b1", CHIEF.session))
NONE: frozenset[str] = frozenset()
BOTH = (CHIEF, OTHER)

Step = tuple[tuple[Member, ...], frozenset[str], float]


@pytest.mark.parametrize(
    ("steps", "has_ended"),
    [
        # Its own coordinator stays away.
        ([((OTHER,), HUB, 1.0), ((OTHER,), HUB, 1.0 + 0.9 * SETTLED_S)], False),
        ([((OTHER,), HUB, 1.0), ((OTHER,), HUB, 1.0 + SETTLED_S)], True),
        # Another one may leave.
        ([((CHIEF,), HUB, 1.0), ((CHIEF,), HUB, 100.0)], False),
        # The run goes on without the hub and after its return.
        (
            [((), NONE, 1.0), ((), NONE, 1000.0), ((), HUB, 1001.0),
             ((), HUB, 1001.0 + 0.9 * PATIENCE_S),
             ((CHIEF,), HUB, 1001.0 + 2 * PATIENCE_S)],
            False,
        ),
        # A hub was started again, and its absence was not noticed.
        ([((), NEW_HUB, 1.0), ((), NEW_HUB, 1.0 + 0.9 * PATIENCE_S)], False),
        ([((), NEW_HUB, 1.0), ((), NEW_HUB, 1.0 + 1.01 * PATIENCE_S)], True),
        # Only the hub comes back.
        ([((), NONE, 1.0), ((), HUB, 2.0), ((), HUB, 2.0 + 1.01 * PATIENCE_S)], True),
        # The hub is the coordinator itself.
        ([(BOTH, CHIEFS_HUB, 1.0), (BOTH, NONE, 2.0)], True),
    ],
)  # fmt: skip
def test_a_run_has_ended_when_its_coordinator_stays_away(
    steps: list[Step],
    has_ended: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    presence = Presence()
    presence.coordinators = {each.alive: each for each in BOTH}
    presence.watch(CHIEF.alive)
    presence.look(HUB, 0.0)
    for there, hubs, now_s in steps:
        assert not presence.has_ended
        presence.coordinators = {each.alive: each for each in there}
        presence.look(hubs, now_s)
    assert presence.has_ended == has_ended


def test_nothing_has_ended_before_a_run_is_watched() -> None:
    presence = Presence()
    for hubs, now_s in ((HUB, 0.0), (NONE, 1.0), (HUB, 100.0), (HUB, 200.0)):
        presence.look(hubs, now_s)
    assert not presence.has_ended
