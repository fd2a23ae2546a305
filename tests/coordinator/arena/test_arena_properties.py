"""Properties of every arena in any world."""

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.arena.arena import Arena
from coordinator.islands.events import Record, Started
from schema.robot.ids import BirthId
from tests.coordinator.arena_world import DT, ArenaRun, World, experiment, reject_some

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
