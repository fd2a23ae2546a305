"""Migration between arenas, and between arenas and off-line islands."""

from math import dist
from typing import Any

from msgspec.structs import replace

from coordinator.arena.arena import Arena
from schema.experiment.document import ArenaSection as Rules
from schema.experiment.document import Islands
from schema.experiment.learning import Learning
from schema.robot.ids import BirthId
from schema.wire.arena import AdvanceShard
from schema.wire.messages import Evaluate
from schema.wire.protobuf import decode_robot
from tests.coordinator.archipelago_run import ARENA, ArchipelagoRun, migrating
from tests.coordinator.arena_world import World


def arenas(
    *births: int,
    arena: Islands = ARENA,
    **migration: Any,  # noqa: ANN401 - any setting
) -> ArchipelagoRun:
    return migrating(*(replace(arena, births=each) for each in births), **migration)


def inserted(lived: ArchipelagoRun, island: int) -> dict[BirthId, tuple[float, float]]:
    """Return the robots that were inserted into an arena, and their places."""
    return dict(lived.worlds[island].places)


def test_a_moved_robot_dies_at_its_source_and_lives_at_its_target() -> None:
    lived = arenas(9, 9, handling="evict", replaced="none").live()
    first = lived.rows("migrations")[0]
    name = BirthId(first["birth_island"], first["birth"])
    assert (first["island"], first["to"], first["epoch"], name.island) == (0, 1, 0, 0)
    (death,) = [
        row
        for row in lived.rows("deaths")
        if (row["island"], row["reason"], row["birth"]) == (0, "migrated", name.number)
    ]
    assert death["sim_time_s"] == first["sim_time_s"]
    assert name in inserted(lived, 1)
    assert all(row["birth_island"] is None for row in lived.rows("deaths")[:1])
    rows = [row for row in lived.rows("fitness") if row["birth_island"] == 0]
    assert {(row["island"], row["birth"]) for row in rows} >= {(1, name.number)}
    # It must mature again.
    assert not rows[0]["is_mature"]
    assert rows[0]["age_s"] <= 5.0


def test_copies_live_in_both_arenas_and_replace_the_worst() -> None:
    lived = arenas(9, 9).live()
    first = lived.rows("migrations")[0]
    name = BirthId(0, first["birth"])
    there, here = inserted(lived, 1)[name], inserted(lived, 0)[name]
    assert there != here
    assert dist(there, (0.0, 0.0)) <= 2.0
    replaced = [row for row in lived.rows("deaths") if row["reason"] == "replaced"]
    assert {row["island"] for row in replaced} == {0, 1}
    samples = [
        row
        for row in lived.rows("fitness")
        if (row["island"], row["sim_time_s"]) == (1, replaced[-1]["sim_time_s"])
        and row["is_mature"]
    ]
    worst = min(samples, key=lambda row: row["fitness"])
    assert replaced[-1]["birth"] == worst["birth"]


def test_infants_do_not_migrate_and_immigrants_keep_what_they_learnt() -> None:
    infants = replace(ARENA, learning=Learning(learner="random", budget=3))
    lived = arenas(24, 24, arena=infants, epoch=4, handling="evict").live()
    rows = lived.rows("learning")
    learnt = {
        BirthId(row["island"], row["birth"]): decode_robot(row["robot"])
        for row in rows
        if row["robot"] is not None
    }
    sent = lived.rows("migrations")
    assert learnt.keys() >= {BirthId(r["birth_island"], r["birth"]) for r in sent}
    changes = [
        (number, command.changes)
        for number, commands in lived.commands.items()
        for command in commands
        if isinstance(command, AdvanceShard)
    ]
    came = {
        (number, each.birth): each.robot
        for number, change in changes
        for each in change.insertions
        if each.birth.island != number
    }
    assert len(came) > 2
    assert all(robot == learnt[birth] for (_, birth), robot in came.items())
    # No immigrant learns, and no robot twice.
    exchanged = {(n, each.birth) for n, change in changes for each in change.brains}
    assert not exchanged & came.keys()
    names = [(row["island"], row["birth"], row["trial"]) for row in rows]
    assert len({*names}) == len(names)


def test_seconds_may_end_an_epoch_before_births_do() -> None:
    lived = arenas(12, 12, epoch=11, epoch_s=30.0).live()
    times = [row["sim_time_s"] for row in lived.rows("migrations") if not row["island"]]
    assert times[:3] == [30.0, 60.0, 90.0]


def test_immigrants_of_a_full_arena_await_room() -> None:
    rules = Rules(population_limit=5, population_floor=3, full_cull_share=0.4)
    full = replace(ARENA, arena=rules)
    lived = arenas(8, 8, arena=full, epoch=6, migrants=3, replaced="none")
    lived.start()
    while lived.waiting:
        lived.turn()
        assert all(len(island.population) <= 5 for island in lived.islands.values())
    assert all(island.is_finished for island in lived.islands.values())
    assert any(birth.island == 0 for birth in inserted(lived, 1))


def falling(lived: ArchipelagoRun, island: int, step: int) -> None:
    """Let all but one of an arena's robots diverge at a step."""
    world = World(
        fit=lived.worlds[island].fit,
        diverges=lambda birth, at: at == step and birth != BirthId(island, 0),
    )
    lived.worlds[island] = world


def test_immigrants_save_an_arena_with_too_few_robots() -> None:
    lived = arenas(20, 20, migrants=3, replaced="none")
    falling(lived, 0, 4000)
    lived.live()
    arena = lived.islands[0]
    assert isinstance(arena, Arena)
    assert not arena.is_extinct
    assert arena.births == 20
    assert len([one for one in inserted(lived, 0) if one.island == 1]) >= 3


def test_an_arena_with_too_few_robots_is_extinct_without_immigrants() -> None:
    lived = arenas(20, 20, replaced="none")
    falling(lived, 0, 4000)
    falling(lived, 1, 4000)
    lived.live()
    for island in lived.islands.values():
        assert isinstance(island, Arena)
        assert island.is_extinct
        assert island.is_finished


def test_immigrants_from_arenas_are_re_evaluated_off_line() -> None:
    lived = migrating(Islands(births=35), replace(ARENA, births=12)).live()
    reevaluations = [
        one
        for one in lived.commands[0]
        if isinstance(one, Evaluate) and one.requester is not None
    ]
    assert reevaluations
    assert {one.birth.island for one in reevaluations} == {1}
    rows = [row for row in lived.rows("evaluations") if row["birth_island"] == 1]
    assert len(rows) == len(reevaluations)
    first = next(row for row in lived.rows("fitness") if row["birth_island"] == 0)
    assert (first["island"], first["is_mature"]) == (1, False)


def test_a_diverged_immigrant_is_a_death_of_the_target() -> None:
    lived = arenas(12, 12)
    lived.worlds[1] = World(
        fit=lived.worlds[1].fit, diverges=lambda birth, _: birth.island == 0
    )
    lived.live()
    fallen = [row for row in lived.rows("deaths") if row["reason"] == "diverged"]
    assert fallen
    assert {(row["island"], row["birth_island"]) for row in fallen} == {(1, 0)}
