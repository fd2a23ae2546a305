"""What a run tells those who watch: numbered, complete, and no body of the dead."""

from dataclasses import replace

from coordinator.islands.events import Record
from coordinator.run.feed import Feed
from coordinator.storage.folder import RunDetails
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.columns import Row, body_rows
from schema.wire.news import Crewman, Newborn, News

CORE = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
WORKERS = (Crewman("w", "x", (0,)),)


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


def _told(news: News | None) -> News:
    assert news is not None
    return news


def test_news_are_numbered_and_tell_each_row_once() -> None:
    feed = _feed(_birth(0), _birth(1))
    first = _told(feed.news(()))
    feed.unread.append(_birth(2, None, 0, 1))
    second = _told(feed.news(()))
    assert (first.sequence, second.sequence) == (1, 2)
    assert [one.birth.number for one in first.births] == [0, 1]
    assert second.births == (
        Newborn(BirthId(0, 2), (BirthId(0, 0), BirthId(0, 1)), 2, 3, None, CORE),
    )
    assert feed.news(()) is None


def test_who_works_is_told_when_it_changes() -> None:
    feed = _feed()
    assert _told(feed.news(WORKERS)).workers == WORKERS
    assert feed.news(WORKERS) is None
    assert _told(feed.news(())).workers == ()


def test_all_of_it_is_the_sum_of_the_news() -> None:
    feed = _feed(_birth(0), _birth(1), *_population(2, 0, 1))
    parts = [_told(feed.news(WORKERS))]
    for record in (_birth(2, None, 0, 1), *_population(3, 1, 2)):
        feed.unread.append(record)
    parts.append(_told(feed.news(WORKERS)))
    whole = feed.whole()
    assert (whole.sequence, whole.is_whole) == (2, True)
    told = [one for news in parts for one in news.births]
    assert [one.birth for one in whole.births] == [one.birth for one in told]
    levels = [level for news in parts for level in news.levels]
    assert whole.levels == (replace(levels[0], members=()), levels[1])
    assert whole.workers == WORKERS


def test_all_of_it_says_nothing_that_the_news_have_not_said() -> None:
    feed = _feed(_birth(0))
    feed.news(())
    feed.unread.append(_birth(1))
    assert len(feed.whole().births) == 1


def test_the_dead_leave_no_body_on_line() -> None:
    feed = _feed(_birth(0, 0.0), _birth(1, 1.0), *_population(2, 0, 1))
    feed.news(())
    feed.unread.append(_death(0))
    news = _told(feed.news(()))
    assert [gone.birth for gone in news.deaths] == [BirthId(0, 0)]
    assert [one.body for one in feed.whole().births] == [None, CORE]


def test_who_is_not_selected_leaves_no_body_off_line() -> None:
    feed = _feed(_birth(0), _birth(1), *_population(2, 0, 1), _birth(2), _birth(3))
    feed.news(())
    for record in (*_population(4, 1, 3), _birth(4)):
        feed.unread.append(record)
    feed.news(())
    bodies = {one.birth.number: one.body for one in feed.whole().births}
    assert bodies == {0: None, 1: CORE, 2: None, 3: CORE, 4: CORE}
