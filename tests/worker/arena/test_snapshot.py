"""A restored world continues like the original, to the last bit."""

from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import MalformedMessage
from schema.experiment.changes import SettingChange
from schema.experiment.document import ArenaWorld
from schema.experiment.environment import Environment
from schema.experiment.identity import Origin
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Casualty, Changes, Insertion
from schema.wire.arena_state import ArenaState, state_digest
from schema.wire.codec import decode
from tests.worker.arena_cases import (
    SECOND,
    SETTINGS,
    counted,
    crowd,
    populated,
    seconds,
    settings_of,
)
from worker.arena.world import World

Robots = Callable[[int], Robot]
RECORDING = settings_of(record_touches=True)


@pytest.mark.slow
def test_thirty_robots_continue_after_a_snapshot(robot_of: Robots) -> None:
    """The snapshot is taken right after merges, with contacts."""
    world, regrouped = counted(RECORDING, crowd(robot_of, 30, 1.0))
    taken: list[tuple[int, bytes]] = []
    merges = 0
    while len(taken) < 2:
        world.advance(world.step + 8)
        touching = sum(len(c.touching()) for c in world.population.clusters)
        if regrouped.merges > merges and touching:
            merges = regrouped.merges
            taken.append((world.step, world.snapshot()))
    end = world.step + SECOND + 3
    world.advance(end)
    expected = _continued(world)
    for step, data in taken:
        restored = World.restore(RECORDING, data, threads=2)
        assert restored.step == step
        assert restored.snapshot() == data
        restored.advance(end)
        assert _continued(restored) == expected
        restored.close()


def _continued(world: World) -> list[object]:
    """Return two more advances of a world."""
    first = seconds(world, 0.7)
    world.apply(Changes(removals=(world.births[4],)))
    return [first, seconds(world, 0.5)]


def test_advance_has_the_digest_of_its_snapshot(robot_of: Robots) -> None:
    """A coordinator identifies snapshot files by the digest."""
    world = populated(RECORDING, crowd(robot_of, 14, 0.5))
    advance = seconds(world, 2.0)
    assert advance.touches
    assert state_digest(world.snapshot()) == advance.digest


def test_a_digest_depends_on_the_state_only(robot_of: Robots) -> None:
    """Parts of an arena give the same digest in any order of clusters and deaths."""
    world = populated(SETTINGS, crowd(robot_of, 4, 0.5))
    state = decode(ArenaState, world.snapshot(), ADVANCE_BYTES)
    lost = [Casualty(b, 7, "fell", (0.0, 0.0, 1.0)) for b in world.births[:2]]
    orders = [
        replace(state, clusters=state.clusters[::turn], casualties=tuple(lost[::turn]))
        for turn in (1, -1)
    ]
    assert len(state.clusters) > 1
    assert orders[0].digest == orders[1].digest != state.digest
    (birth, data), *others = state.robots
    changed = replace(state, robots=((birth, data[:-1] + b"\1"), *others))
    assert changed.digest != state.digest
    joined = (*state.clusters[2:], state.clusters[0] + state.clusters[1])
    assert replace(state, clusters=joined).digest != state.digest


def test_a_key_at_its_default_does_not_change_the_digest() -> None:
    """An arena has the digest that it had before its sections got a new key."""
    before = replace(SETTINGS, arena=ArenaWorld())
    snapshot = World(before).snapshot()
    # The keys of its rules stand for new ones.
    assert World.restore(SETTINGS, snapshot).digest() == World(before).digest()
    change = SettingChange(setting="simulation.friction", at=(0,), values=(1.0,))
    others = [
        settings_of(end_s=1.0),
        settings_of(parameters={"share": 0.5}),
        replace(SETTINGS, environment=Environment(slope_deg=1.0)),
        replace(SETTINGS, changes=(change,)),
        replace(SETTINGS, changes=(replace(change, period=10.0),)),
        replace(SETTINGS, origin=Origin(seed=1)),
    ]
    digests = {World(settings).digest() for settings in (SETTINGS, *others)}
    assert len(digests) == 1 + len(others)
    for settings in others:
        with pytest.raises(MalformedMessage, match="other settings"):
            World.restore(settings, snapshot)


def test_snapshot_right_after_changes_continues_equally(robot_of: Robots) -> None:
    """The snapshot includes newborns in the air."""
    world = populated(SETTINGS, crowd(robot_of, 3, 0.3))
    seconds(world, 1.0)
    newborns = crowd(robot_of, 3, 0.3, seed=5, first=10)
    world.apply(Changes(removals=(BirthId(0, 1),), insertions=newborns))
    restored = World.restore(SETTINGS, world.snapshot())
    assert seconds(restored, 1.0) == seconds(world, 1.0)


def test_other_bytes_are_rejected_as_snapshot(turtle: Robot) -> None:
    world = populated(SETTINGS, [Insertion(BirthId(0, 0), turtle, (0.0, 0.0))])
    data = world.snapshot()
    rng = np.random.default_rng(1)
    with pytest.raises(MalformedMessage, match="other settings"):
        World.restore(RECORDING, data)
    for cut in (0, 1, 40, len(data) // 2, len(data) - 1):
        with pytest.raises(MalformedMessage):
            World.restore(SETTINGS, data[:cut])
    for _ in range(50):
        with pytest.raises(MalformedMessage):
            World.restore(SETTINGS, rng.bytes(int(rng.integers(200))))


def test_a_snapshot_with_a_robot_of_unknown_parts_is_refused(turtle: Robot) -> None:
    world = populated(SETTINGS, [Insertion(BirthId(0, 0), turtle, (0.0, 0.0))])
    forged = world.snapshot().replace(b"Hinge", b"Hings")
    with pytest.raises(MalformedMessage, match="Hings"):
        World.restore(SETTINGS, forged)


def test_a_snapshot_with_text_that_is_not_utf_8_is_refused() -> None:
    fallen = [((0, 1), 2, "reason", (0.0, 0.0, 0.0))]
    state = [bytes(32), 3, [], [], fallen]
    data = msgspec.msgpack.encode(state).replace(b"reason", b"reas\xff\xff")
    with pytest.raises(MalformedMessage):
        World.restore(SETTINGS, data)
