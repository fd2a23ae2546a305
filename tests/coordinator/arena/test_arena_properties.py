"""Properties of every arena in any world."""

import random
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.islands.events import (
    Advanced,
    Append,
    Commanded,
    Pause,
    Record,
    Remove,
    Resume,
    Started,
    Vetted,
    VettingFailed,
)
from coordinator.storage.journal import decode_record, encode_event
from schema.robot.ids import BirthId
from schema.wire.arena import NO_POSES
from tests.coordinator.arena_world import (
    DT,
    ArenaRun,
    World,
    distinct_fitness,
    experiment,
    reject_some,
)

fixed = settings(max_examples=12, derandomize=True, database=None, deadline=None)


@given(
    luck=st.integers(0, 2**32),
    limit=st.integers(15, 30),
    floor=st.integers(5, 15),
    share=st.floats(0.0, 1.5),
)
@fixed
def test_floor_and_limit_hold_in_every_world(
    luck: int, limit: int, floor: int, share: float
) -> None:
    def fit(birth: BirthId, step: int) -> float:
        return random.Random(f"{luck} {birth} {step}").random()  # noqa: S311

    def diverges(birth: BirthId, step: int) -> bool:
        return random.Random(f"{birth} {step} {luck}").random() < 0.002  # noqa: S311

    rules = {
        "population_limit": limit,
        "population_floor": floor,
        "survive_share_of_mean": share,
    }
    lived = ArenaRun(
        Arena(experiment(45, **rules), 3, 0), World(fit, diverges), reject_some
    )
    while not lived.commands or lived.waiting:
        before = lived.arena.step
        found = lived.turn() if lived.commands else lived.tell(Started())
        assert len(lived.arena.population) <= limit
        culled = [
            one
            for one in found
            if isinstance(one, Record)
            and one.table == "deaths"
            and one.row["reason"] in ("selection", "cull")
        ]
        if culled:
            assert lived.arena.step > before
            since = {
                one: lived.world.step - then for one, then in lived.world.born.items()
            }
            mature = [one for one, age in since.items() if age * DT >= 15.0]
            assert len(mature) - len(culled) >= floor
    assert lived.arena.births <= 45


def test_a_replayed_journal_gives_the_same_commands_and_rows() -> None:
    lived = ArenaRun(
        Arena(experiment(40), 7, 0), World(distinct_fitness), reject_some
    ).live(50)
    for wanted in (Pause(), Remove(BirthId(0, 2)), Resume()):
        identity = type(wanted).__name__
        lived.tell(Commanded(0, identity, lived.arena.next_step, wanted))
        if lived.waiting:
            lived.turn()
    lived.live()
    kept = Advanced | Commanded | Vetted | VettingFailed
    journal = [encode_event(one) for one in lived.events if isinstance(one, kept)]
    again = Arena(experiment(40), 7, 0)
    commands = again.handle(Started())
    for entry in journal:
        event = decode_record(Path("journal"), entry)
        assert isinstance(event, kept)
        commands += again.handle(event)
    assert len(commands) == len(lived.commands)
    for one, other in zip(commands, lived.commands, strict=True):
        if isinstance(other, Append):
            bare = replace(other.event.advance, poses=NO_POSES)
            assert one == Append(replace(other.event, advance=bare))
        else:
            assert one == other


def test_other_seeds_and_runs_give_other_places() -> None:
    places = [
        [
            (row["x"], row["y"])
            for row in ArenaRun(Arena(experiment(15), seed, run), World())
            .live()
            .rows("births")
        ]
        for seed, run in ((1, 0), (2, 0), (1, 1))
    ]
    assert len({tuple(each) for each in places}) == 3
