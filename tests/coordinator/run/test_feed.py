"""Updates for viewers: numbered, complete, without bodies of dead robots."""

import pytest
from msgspec.structs import replace

from coordinator.islands.events import Record
from coordinator.islands.rows import body_rows
from coordinator.run.feed import Feed
from schema.limits import UPDATE_BYTES
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.columns import Row
from schema.tables.description import RunDetails
from schema.wire.codec import decode, encode
from schema.wire.updates import ArenaSample, Birth, Update, WorkerInfo

CORE = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
BODY = CORE.parts
WORKERS = (WorkerInfo("w", "x", (0,)),)


def _birth(number: int, sim_time_s: float | None = None, *parents: int) -> Record:
    row: Row = {
        "island": 0,
        "birth": number,
        "parents": [{"island": 0, "birth": each} for each in parents],
        "rank": 1 + len(parents) // 2,
        "body": body_rows(CORE),
        "sim_time_s": sim_time_s,
    }
    return Record("births", row)


def _population(births: int, *members: int) -> list[Record]:
    return [
        Record(
            "population",
            {"island": 0, "births": births, "birth": each, "fitness": 0.5 + each},
        )
        for each in members
    ]


def _death(number: int) -> Record:
    row = {
        "island": 0, "birth": number, "births": 2, "sim_time_s": 9.0, "reason": "cull"
    }  # fmt: skip
    return Record("deaths", row)


def _feed(*records: Record) -> Feed:
    feed = Feed("run", 1, RunDetails("experiment", 0, 1, "{}"))
    for record in records:
        feed.unread.append(record)
    return feed


def whole(feed: Feed) -> Update:
    """Return the state as a viewer reads it."""
    return decode(Update, encode(feed.whole()), UPDATE_BYTES)


def _sent(update: Update | None) -> Update:
    assert update is not None
    return update


def test_updates_are_numbered_and_hold_each_row_once() -> None:
    feed = _feed(_birth(0), _birth(1))
    first = _sent(feed.update(()))
    feed.unread.append(_birth(2, None, 0, 1))
    second = _sent(feed.update(()))
    assert (first.sequence, second.sequence) == (1, 2)
    assert [one.birth.number for one in first.births] == [0, 1]
    assert second.births == (
        Birth(BirthId(0, 2), (BirthId(0, 0), BirthId(0, 1)), 2, 3, None, BODY),
    )
    assert feed.update(()) is None


def test_elites_are_sent_once_and_the_whole_has_the_fittest() -> None:
    document = (
        '{"name": "e", "grid": {"measures": ["x"], "bounds": [[0, 1]], "bins": [2]}}'
    )
    feed = Feed("run", 1, RunDetails("experiment", 0, 1, document))
    sent = []
    for number, fitness in enumerate((1.0, 3.0, 2.0)):
        row = {"island": 0, "birth": number, "fitness": fitness,
               "measures": [("x", 0.2)]}  # fmt: skip
        feed.unread.append(Record("evaluations", row))
        sent.append(feed.update(()))
    first, second, third = sent
    assert third is None
    elites = [_sent(update).elites[0] for update in (first, second)]
    assert [(one.births, one.fitness) for one in elites] == [(1, 1.0), (2, 3.0)]
    assert whole(feed).elites == (elites[1],)


def test_changed_workers_make_an_update() -> None:
    feed = _feed()
    assert _sent(feed.update(WORKERS)).workers == WORKERS
    assert feed.update(WORKERS) is None
    assert _sent(feed.update(())).workers == ()


def test_the_whole_is_the_sum_of_the_updates() -> None:
    feed = _feed(_birth(0), _birth(1), *_population(2, 0, 1))
    parts = [_sent(feed.update(WORKERS))]
    for record in (_birth(2, None, 0, 1), *_population(3, 1, 2)):
        feed.unread.append(record)
    parts.append(_sent(feed.update(WORKERS)))
    state = whole(feed)
    assert (state.sequence, state.is_whole) == (2, True)
    births = [one.birth for update in parts for one in update.births]
    assert [one.birth for one in state.births] == births
    levels = [level for update in parts for level in update.levels]
    assert state.levels == (replace(levels[0], members=()), levels[1])
    assert state.workers == WORKERS


def test_the_whole_holds_nothing_that_no_update_held() -> None:
    feed = _feed(_birth(0))
    feed.update(())
    feed.unread.append(_birth(1))
    assert len(whole(feed).births) == 1


def test_bodies_of_dead_robots_are_dropped_on_line() -> None:
    feed = _feed(_birth(0, 0.0), _birth(1, 1.0), *_population(2, 0, 1))
    feed.update(())
    feed.unread.append(_death(0))
    update = _sent(feed.update(()))
    assert [gone.birth for gone in update.deaths] == [BirthId(0, 0)]
    assert [one.body for one in whole(feed).births] == [None, BODY]


def test_bodies_of_robots_that_were_not_selected_are_dropped_off_line() -> None:
    feed = _feed(_birth(0), _birth(1), *_population(2, 0, 1), _birth(2), _birth(3))
    feed.update(())
    for record in (*_population(4, 1, 3), _birth(4)):
        feed.unread.append(record)
    feed.update(())
    bodies = {one.birth.number: one.body for one in whole(feed).births}
    assert bodies == {0: None, 1: BODY, 2: None, 3: BODY, 4: BODY}


def test_samples_of_arenas_with_own_rules_are_sent_once_and_not_kept() -> None:
    fitness: Row = {"island": 0, "birth": 1, "sim_time_s": 5.0, "stores": None}
    feed = _feed(Record("fitness", fitness))
    assert feed.update(()) is None
    stores = [("energy", 3.0)]
    feed.unread.append(Record("fitness", {**fitness, "stores": stores}))
    sent = decode(Update, encode(_sent(feed.update(()))), UPDATE_BYTES)
    stored = ((BirthId(0, 1), 3.0),)
    assert sent.samples == (ArenaSample(0, 5.0, "energy", stored),)
    assert feed.update(()) is None
    assert not whole(feed).samples


def test_of_a_long_replay_the_last_samples_are_sent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("coordinator.run.feed._MOST_SAMPLED", 3)
    feed, place = _feed(), {"x": 0.0, "y": 0.0, "radius_m": 1.0, "content": 2.0}
    for second in range(9):
        row = {"island": 0, "sim_time_s": float(second), **place}
        feed.unread.append(Record("patches", row))
        feed.read()
    times = [one.sim_time_s for one in _sent(feed.update(())).samples]
    assert times == [6.0, 7.0, 8.0]


@pytest.mark.parametrize(
    ("sim_time_s", "expected"), [(None, (2, 0.75, 1.5)), (4.0, (1, 1.5, 1.5))]
)
def test_failed_robots_count_as_zero_off_line(
    sim_time_s: float | None, expected: tuple[int, float, float]
) -> None:
    """In an arena a robot without fitness is immature, and does not count."""
    failed, grown = _population(2, 0, 1)
    failed = Record("population", {**failed.row, "fitness": None})
    feed = _feed(_birth(0, sim_time_s), _birth(1, sim_time_s), failed, grown)
    (level,) = _sent(feed.update(())).levels
    assert (level.judged, level.mean, level.best) == expected
