"""In which order agents are asked; asking has a limited share of the time."""

from coordinator.network.info_queue import LONGEST_PAUSE_S, SHARE, InfoQueue
from schema.agent.topics import Member


def member(name: str) -> Member:
    return Member("f", "worker", name)


def test_the_newest_and_the_oldest_agent_are_asked_in_turn() -> None:
    queue = InfoQueue()
    queue.add_again(member("silent"), 1, 0.0)
    for name in ("a", "b", "c"):
        queue.add(member(name))
    names = [taken.name for _ in range(4) if (taken := queue.take(5.0))]
    assert names == ["c", "a", "b", "silent"]
    assert queue.take(5.0) is None


def test_pauses_grow_with_each_silence_up_to_a_limit() -> None:
    for silences, pause_s in ((1, 1.0), (2, 2.0), (4, 8.0), (1000, LONGEST_PAUSE_S)):
        queue = InfoQueue()
        queue.add_again(member("a"), silences, 10.0)
        assert queue.take(10.0 + 0.99 * pause_s) is None
        assert queue.take(10.0 + pause_s) == member("a")


def test_asking_takes_a_limited_share_of_the_time() -> None:
    queue = InfoQueue()
    for number in range(10_000):
        queue.add(member(f"fake{number}"))
    now_s = spent_s = 0.0
    while now_s < 10.0:
        if queue.take(now_s) is None:
            now_s += 0.001
            continue
        queue.spent(now_s, now_s + 0.003)
        now_s += 0.003
        spent_s += 0.003
    assert 0.5 * SHARE < spent_s / now_s <= SHARE + 0.001
