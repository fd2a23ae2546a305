"""Rules of an arena, each tested once by hand: births, culls, samples, ends."""

from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.islands.events import (
    Advanced,
    ArenaEvent,
    Finish,
    Started,
)
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import Experiment
from schema.experiment.file import read_experiment
from schema.robot.ids import BirthId
from schema.tables.columns import ROWS
from schema.wire.arena import Advance
from schema.wire.messages import Bred, Breed
from tests.coordinator.arena_world import (
    DT,
    ArenaRun,
    World,
    distinct_fitness,
    equal_fitness,
    experiment,
)
from tests.coordinator.breeding import reject_some
from tests.coordinator.reports import PROVENANCE


def life(births: int = 3000, *, world: World | None = None) -> ArenaRun:
    return ArenaRun(Arena(experiment(births), 1, 0), world or World())


def numbers(rows: list[dict[str, int]]) -> list[int]:
    return [row["birth"] for row in rows]


def test_founders_are_inserted_each_second_the_last_made_first() -> None:
    lived = life().live(14.9)
    vets = [one for one in lived.commands if isinstance(one, Breed)]
    assert [one.birth.number for one in vets] == list(range(15))
    advances = lived.advances
    inserted = [one.changes.insertions for one in advances]
    assert [each.birth.number for (each,) in inserted] == list(range(14, -1, -1))
    assert [one.number for one in advances] == list(range(15))
    assert [one.until for one in advances] == [*range(200, 3000, 200), 3000]
    times = [row["sim_time_s"] for row in lived.rows("births")]
    assert times == [float(second) for second in range(15)]
    assert not lived.rows("fitness")
    assert not lived.rows("deaths")


def test_each_birth_has_population_rows() -> None:
    lived = life().live(46)
    alive: dict[int, list[int]] = {}
    for row in lived.rows("population"):
        alive.setdefault(row["births"], []).append(row["birth"])
    assert list(alive) == list(range(1, 18))
    assert alive[1] == [14]
    assert alive[3] == [12, 13, 14]
    assert alive[17] == list(range(17))
    newborn = [row for row in lived.rows("population") if row["births"] == 17]
    assert [row["fitness"] for row in newborn] == [*([0.1] * 16), None]


def test_an_arena_of_equals_fills_up_and_is_culled() -> None:
    """The sixteenth is born at 30 s, the thirtieth at 240 s; 9 of 30 stay at 270 s."""
    lived = life().live(286)
    times = {row["birth"]: row["sim_time_s"] for row in lived.rows("births")}
    assert [times[number] for number in (15, 16, 29)] == [30.0, 45.0, 240.0]
    deaths = lived.rows("deaths")
    assert numbers(deaths) == list(range(29, 8, -1))
    assert {(row["sim_time_s"], row["reason"]) for row in deaths} == {(270.0, "cull")}
    # The slots of 255 s and 270 s found the arena full.
    assert times[30] == 285.0
    at_270 = [one for one in lived.advances if one.changes.removals]
    assert [one.until for one in at_270] == [55000]
    assert len(at_270[0].changes.removals) == 21


def test_robots_below_a_share_of_the_mean_are_culled() -> None:
    """Of 0..14 the mean is 7, and 0..4 are below 0.7 x 7 = 4.9."""
    lived = life(world=World(lambda birth, _: birth.number / 100.0)).live(31)
    deaths = lived.rows("deaths")
    assert numbers(deaths) == [0, 1, 2, 3, 4]
    assert {(row["sim_time_s"], row["reason"]) for row in deaths} == {
        (30.0, "selection")
    }
    # The child of that step is inserted after their removal.
    (changes,) = [one.changes for one in lived.advances if one.changes.removals]
    assert changes.removals == tuple(BirthId(0, number) for number in range(5))
    assert [each.birth.number for each in changes.insertions] == [15]
    alive = [row["birth"] for row in lived.rows("population") if row["births"] == 16]
    assert alive == list(range(5, 16))


def test_every_living_robot_is_sampled_every_five_seconds() -> None:
    lived = life().live(46)
    rows = lived.rows("fitness")
    assert sorted({row["sim_time_s"] for row in rows}) == [
        15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0,
    ]  # fmt: skip
    at_45 = [row for row in rows if row["sim_time_s"] == 45.0]
    assert numbers(at_45) == list(range(16))
    assert {row["births"] for row in at_45} == {16}
    assert at_45[14] == {
        "island": 0, "birth_island": None, "birth": 14,
        "sim_time_s": 45.0, "births": 16, "age_s": 45.0,
        "path_velocity": 0.0, "straight_velocity": 0.02, "fitness": 0.1,
        "is_mature": True, "measures": None, "stores": None, "work_j": None,
    }  # fmt: skip
    assert (at_45[15]["age_s"], at_45[15]["is_mature"]) == (15.0, True)


def test_only_the_mature_have_children() -> None:
    lived = life(60, world=World(distinct_fitness)).live()
    times = {row["birth"]: row["sim_time_s"] for row in lived.rows("births")}
    ranks = {row["birth"]: row["rank"] for row in lived.rows("births")}
    for row in lived.rows("births")[15:]:
        parents = [parent["birth"] for parent in row["parents"]]
        assert len(set(parents)) == 2
        assert all(row["sim_time_s"] - times[one] >= 15.0 for one in parents)
        assert row["rank"] == 1 + max(ranks[one] for one in parents)
        assert row["generation"] is None
    for row in lived.rows("deaths"):
        assert row["sim_time_s"] - times[row["birth"]] >= 15.0


def test_a_couple_has_five_attempts_and_then_loses_its_birth() -> None:
    def stubborn(birth: BirthId, attempt: int) -> str:
        return "crowded" if birth.number >= 15 and attempt < 7 else ""

    lived = ArenaRun(Arena(experiment(), 1, 0), verdict=stubborn).live(46)
    works = [one for one in lived.commands if isinstance(one, Breed)][15:]
    ranges = [(one.birth.number, one.attempt, one.end) for one in works]
    assert ranges == [(15, 0, 5), (15, 5, 10)]
    (born,) = lived.rows("births")[15:]
    assert (born["birth"], born["sim_time_s"]) == (15, 45.0)
    assert 8 <= born["attempts"] <= 10


def test_an_arena_ends_at_the_birth_interval_after_the_last_birth() -> None:
    lived = life(16).live()
    assert lived.arena.births == 16
    assert lived.arena.step == 9000
    assert lived.commands[-1] == Finish(0)
    assert lived.is_done
    assert not lived.arena.is_extinct
    assert lived.advances[-1].until == 9000
    assert max(row["sim_time_s"] for row in lived.rows("fitness")) == 45.0


def test_snapshots_are_wanted_every_hundred_seconds() -> None:
    lived = life().live(310)
    wanted = [one.until for one in lived.advances if one.wants_snapshot]
    assert wanted == [20000, 40000, 60000]


def test_a_diverged_robot_is_a_death_with_its_reason() -> None:
    def diverges(birth: BirthId, step: int) -> bool:
        return birth.number == 3 and step == 4000

    lived = life(world=World(diverges=diverges)).live(31)
    (death,) = lived.rows("deaths")
    x, y = lived.world.places[BirthId(0, 3)]
    assert death == {
        "island": 0, "birth_island": None, "birth": 3,
        "sim_time_s": pytest.approx(19.995), "births": 15,
        "reason": "diverged", "detail": "diverged: qacc", "x": x, "y": y, "z": 0.5,
    }  # fmt: skip
    assert 3 not in [one.birth.number for one in lived.arena.population]
    assert not any(one.changes.removals for one in lived.advances)
    at_20 = [row for row in lived.rows("fitness") if row["sim_time_s"] == 20.0]
    assert len(at_20) == 14


def test_an_arena_with_too_few_robots_to_mate_is_extinct() -> None:
    def diverges(birth: BirthId, step: int) -> bool:
        return birth.number >= 4 and step == 4000

    lived = life(world=World(diverges=diverges)).live()
    assert lived.arena.is_extinct
    assert lived.is_done
    assert lived.arena.step == 6000
    assert len(lived.arena.population) == 4


def test_touches_and_poses_are_recorded() -> None:
    lived = life().live(15)
    assert [append.event.pose_rows for append in lived.bulk] == [*range(1, 16)]
    row = lived.rows("touches")[0]
    assert row == {
        "island": 0, "birth_island": None, "birth": 13,
        "other_island": 0, "other_birth": 14,
        "sim_time_s": 2.0, "over_s": 1.0, "duration_s": 0.25,
    }  # fmt: skip


def test_rows_have_the_columns_of_their_tables() -> None:
    lived = life(40, world=World(distinct_fitness)).live()
    for name in ("births", "population", "fitness", "deaths", "touches"):
        rows = lived.rows(name)
        assert rows
        for row in rows:
            assert sorted(row) == sorted(ROWS[name].names)


@pytest.mark.parametrize(
    "change",
    [
        {"number": 99},
        {"island": 1},
        {"number": -1},
        {"step": 3999},
        {"judgements": ()},
        {"fitness": float("nan")},
    ],
)
def test_a_wrong_advance_raises_and_changes_nothing(change: dict[str, Any]) -> None:
    lived, undisturbed = life(20).live(20), life(20).live()
    right = lived.world.advance(lived.waiting[0])  # type: ignore[arg-type]
    advance = right.advance
    if "fitness" in change:
        judged = tuple(replace(one, **change) for one in advance.judgements)
        wrong = replace(right, advance=replace(advance, judgements=judged))
    elif "step" in change or "judgements" in change:
        wrong = replace(right, advance=replace(advance, **change))
    else:
        wrong = replace(right, **change)
    with pytest.raises(UnexpectedEvent, match=r"arena 0 at step .* born"):
        lived.arena.handle(wrong)
    lived.waiting.clear()
    lived.tell(right)
    assert lived.live().commands == undisturbed.commands


def test_answers_that_were_never_requested_raise() -> None:
    lived = life()
    with pytest.raises(UnexpectedEvent, match="has not started"):
        lived.arena.handle(Bred(BirthId(0, 0), 0))
    lived.tell(Started())
    unexpected: tuple[ArenaEvent, ...] = (
        Started(),
        Bred(BirthId(0, 15), 0),
        Bred(BirthId(1, 3), 0),
        Bred(BirthId(0, 2**40), 0, ("x",)),
        Advanced(0, 0, Advance(200, bytes(32), (), (), ()), 0, PROVENANCE),
    )
    for event in unexpected:
        with pytest.raises(UnexpectedEvent):
            lived.arena.handle(event)


def test_second_answers_are_ignored() -> None:
    lived = ArenaRun(Arena(experiment(20), 1, 0), verdict=reject_some)
    lived.tell(Started())
    while lived.waiting:
        lived.turn()
        assert lived.arena.handle(lived.events[-1]) == []
    assert not any(lived.arena.handle(event) for event in lived.events[1:])


def test_an_off_line_experiment_has_no_arena() -> None:
    with pytest.raises(ExperimentError, match=r"has no \[arena\]"):
        Arena(read_experiment("scenario1"), 1, 0)


def without_reproduction() -> Experiment:
    base = experiment(20)
    selection = replace(base.selection, parents="none")
    return replace(base, selection=selection)


def test_children_may_be_random_robots() -> None:
    lived = ArenaRun(Arena(without_reproduction(), 1, 0), World(equal_fitness)).live()
    assert all(row["parents"] == [] for row in lived.rows("births"))
    # No mature parents are needed: the first birth is at 15 s.
    assert lived.rows("births")[15]["sim_time_s"] == 15.0 == 3000 * DT
