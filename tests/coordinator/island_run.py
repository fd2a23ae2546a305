"""Off-line island whose requests a function answers, each of them twice."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from coordinator.islands.events import Answered, Ask, IslandCommand, Record, Started
from coordinator.islands.island import Island
from schema.wire.messages import Breed, Evaluate
from tests.coordinator.breeding import WhyNot, bred, viable

Answer = Callable[[Any], Answered]


def requests(commands: Sequence[IslandCommand]) -> list[Any]:
    return [one for one in commands if isinstance(one, Breed | Evaluate | Ask)]


def records(commands: Sequence[IslandCommand]) -> list[Record]:
    return [one for one in commands if isinstance(one, Record)]


def rows(commands: Sequence[IslandCommand], table: str) -> list[Any]:
    return [one.row for one in records(commands) if one.table == table]


def live(
    island: Island,
    answer: Answer,
    order: Iterator[int] | None = None,
    why_not: WhyNot = viable,
) -> list[IslandCommand]:
    """Run an island to its end, with requests answered in some order.

    Robots are bred here; ``answer`` gives the other answers.

    It must not be finished while requests are open, and ignore second answers.
    """
    commands = island.handle(Started())
    waiting, answers = deque(requests(commands)), list[Answered]()
    while waiting:
        assert not island.is_finished
        waiting.rotate(-next(order) if order else 0)
        asked = waiting.popleft()
        is_birth = isinstance(asked, Breed)
        answers.append(bred(island, asked, why_not) if is_birth else answer(asked))
        following = island.handle(answers[-1])
        assert island.handle(answers[-1]) == []
        commands += following
        waiting += requests(following)
    assert island.is_finished
    assert not any(island.handle(event) for event in answers)
    return commands
