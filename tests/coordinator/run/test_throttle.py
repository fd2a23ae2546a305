"""Arenas by the clock: delays for viewers, and steps longer than the document's."""

from pathlib import Path

import pytest

import tests.analyzers
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.local import LocalAgents
from coordinator.run.history import arena_history
from coordinator.run.session import RunSession
from coordinator.run.throttle import RealTimeThrottle
from coordinator.storage.folder import RunFolder
from schema.experiment.file import experiment_text, read_draft
from schema.tables.description import RunDetails
from schema.wire.arena import AdvanceShard, Changes
from worker.arena.world import World
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards


def advance(shard: int = 0) -> AdvanceShard:
    return AdvanceShard(shard, 0, 1000, Changes(), wants_snapshot=False)


def test_each_advance_waits_for_its_time() -> None:
    throttle = RealTimeThrottle(2.0)
    assert not throttle.holds_back(advance(), 0.0, 100.0)
    # 5 simulated seconds take 2.5 s.
    assert throttle.holds_back(advance(), 5.0, 100.1)
    assert throttle.wake_s == pytest.approx(102.5)
    assert throttle.due(102.4) == []
    assert throttle.due(102.6) == [advance()]
    assert throttle.due(102.6) == []
    assert throttle.holds_back(advance(), 10.0, 102.6)
    assert throttle.wake_s == pytest.approx(105.0)


def test_late_arena_does_not_catch_up() -> None:
    throttle = RealTimeThrottle(1.0)
    throttle.holds_back(advance(), 0.0, 0.0)
    assert not throttle.holds_back(advance(), 5.0, 60.0)
    assert throttle.holds_back(advance(), 10.0, 60.5)
    assert throttle.wake_s == pytest.approx(65.0)


def test_arenas_are_held_back_independently() -> None:
    throttle = RealTimeThrottle(1.0)
    throttle.holds_back(advance(0), 0.0, 0.0)
    assert not throttle.holds_back(advance(1), 20.0, 7.0)
    assert throttle.holds_back(advance(0), 5.0, 1.0)
    assert throttle.wake_s == pytest.approx(5.0)
    assert throttle.holds_back(advance(1), 23.0, 7.0)
    assert throttle.due(20.0) == [advance(0), advance(1)]


DOCUMENT = """
name = "clocks"
births = 20
[arena]
snapshot_interval_s = 20.0
[[islands]]
[[islands]]
[islands.simulation]
timestep_s = 0.01
brain_steps = 10
pose_steps = 20
warmup_steps = 300
window_steps = 600
"""
SPEED = 2.0


@pytest.fixture(scope="module")
def advanced(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[float]]:
    """Return the folder of a run at ``SPEED``, and the arenas' times after 20 s."""
    place = tmp_path_factory.mktemp("clocks")
    (place / "clocks.toml").write_text(DOCUMENT)
    (document,) = read_draft(str(place / "clocks.toml"), None).checked()
    details = RunDetails(document.name, 0, 1, experiment_text(document))
    worker = Jobs(Shards(World))
    fleet = JobRouter(
        LocalAgents(
            {"analyzer": tests.analyzers.answer, "worker": worker.answer}, "any"
        )
    )
    held = RunFolder(place / "run", details)
    run = RunSession(held, fleet, speed=SPEED)
    run.start()
    for turn in range(200):
        now_s = turn / 10
        ends = fleet.listen(0.0, now_s)
        run.loop.act(now_s, ends.get(run.loop.client, ()))
    arenas = run.status(20.0).islands
    run.close()
    return place / "run", [each.simulated_s or 0.0 for each in arenas]


def test_arenas_keep_to_the_same_speed(advanced: tuple[Path, list[float]]) -> None:
    _, simulated_s = advanced
    assert simulated_s == pytest.approx([SPEED * 20.0] * 2, abs=5.0)


def test_a_snapshot_after_the_time_of_interest_is_not_used(
    advanced: tuple[Path, list[float]],
) -> None:
    folder, _ = advanced
    (newest,) = (folder / "snapshots").glob("island-1-*.bin")
    newest_s = 0.01 * int(newest.stem.rpartition("-")[2])
    _, after = arena_history(folder, 1, newest_s + 0.1)
    assert after.snapshot == newest.read_bytes()
    _, before = arena_history(folder, 1, newest_s - 0.1)
    assert before.snapshot == b""
    assert len(before.history) > len(after.history)
