"""Presence of hubs and coordinators, as a viewer understands it."""

import pytest

from analysis.viewer.presence import PATIENCE_S, SETTLED_S, Presence
from schema.agent.topics import Member

CHIEF = Member("default", "coordinator", "chief.1")
OTHER = Member("default", "coordinator", "other.1")
HUB = frozenset({"a0"})
NONE: frozenset[str] = frozenset()


@pytest.fixture
def presence() -> Presence:
    made = Presence()
    made.coordinators = {each.alive: each for each in (CHIEF, OTHER)}
    made.watch(CHIEF.alive)
    made.look(HUB, 0.0)
    return made


def test_run_has_ended_when_its_own_coordinator_stays_away(presence: Presence) -> None:
    del presence.coordinators[CHIEF.alive]
    presence.look(HUB, 1.0)
    presence.look(HUB, 1.0 + 0.9 * SETTLED_S)
    assert not presence.has_ended
    presence.look(HUB, 1.0 + SETTLED_S)
    assert presence.has_ended


def test_another_coordinator_may_leave(presence: Presence) -> None:
    del presence.coordinators[OTHER.alive]
    presence.look(HUB, 1.0)
    presence.look(HUB, 100.0)
    assert not presence.has_ended


def test_run_goes_on_without_the_hub_and_after_its_return(presence: Presence) -> None:
    presence.coordinators.clear()
    presence.look(NONE, 1.0)
    presence.look(NONE, 1000.0)
    presence.look(HUB, 1001.0)
    presence.look(HUB, 1001.0 + 0.9 * PATIENCE_S)
    presence.coordinators[CHIEF.alive] = CHIEF
    presence.look(HUB, 1001.0 + 2 * PATIENCE_S)
    assert not presence.has_ended


def test_run_goes_on_after_a_hub_that_was_not_missed(presence: Presence) -> None:
    presence.coordinators.clear()
    presence.look(frozenset({"b1"}), 1.0)
    presence.look(frozenset({"b1"}), 1.0 + 0.9 * PATIENCE_S)
    assert not presence.has_ended
    presence.look(frozenset({"b1"}), 1.0 + 1.01 * PATIENCE_S)
    assert presence.has_ended


def test_run_has_ended_if_only_the_hub_comes_back(presence: Presence) -> None:
    presence.coordinators.clear()
    presence.look(NONE, 1.0)
    presence.look(HUB, 2.0)
    presence.look(HUB, 2.0 + 1.01 * PATIENCE_S)
    assert presence.has_ended


def test_run_has_ended_with_the_hub_that_its_coordinator_is(
    presence: Presence,
) -> None:
    presence.look(frozenset({CHIEF.session}), 1.0)
    presence.look(NONE, 2.0)
    assert presence.has_ended


def test_nothing_has_ended_before_a_run_is_watched() -> None:
    presence = Presence()
    presence.look(HUB, 0.0)
    presence.look(NONE, 1.0)
    presence.look(HUB, 100.0)
    presence.look(HUB, 200.0)
    assert not presence.has_ended
