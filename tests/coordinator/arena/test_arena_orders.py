"""Orders of operators: when they take effect, and their effect."""

import pytest
from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.islands.events import (
    ArenaCommand,
    Commanded,
    Insert,
    Order,
    Pause,
    Remove,
    ReplaceBrain,
    Resume,
)
from schema.errors import InvalidRobot, UnexpectedEvent
from schema.robot.brain import Brain
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from schema.wire.arena import AdvanceShard
from schema.wire.genome_bytes import encode_genome
from tests.coordinator.arena_world import (
    DT,
    ArenaRun,
    World,
    distinct_fitness,
    equal_fitness,
    experiment,
)
from tests.coordinator.breeding import reject_some


def life() -> ArenaRun:
    return ArenaRun(Arena(experiment(60), 1, 0), World(distinct_fitness), reject_some)


def order(lived: ArenaRun, wanted: Order, name: str = "") -> list[ArenaCommand]:
    """Send an order to the arena."""
    identity = name or f"order {len(lived.events)}"
    return lived.tell(Commanded(0, identity, lived.arena.next_step, wanted))


def genome(lived: ArenaRun) -> bytes:
    return lived.arena.population[0].genome


def test_an_order_takes_effect_at_the_next_decision() -> None:
    lived = life().live(20)
    assert lived.arena.next_step == 5000
    assert order(lived, Remove(BirthId(0, 3))) == []
    assert not lived.rows("deaths")
    lived.turn()
    (death,) = lived.rows("deaths")
    assert (death["birth"], death["sim_time_s"]) == (3, 25.0)
    assert death["reason"] == "removed"
    assert death["z"] == 0.02
    assert lived.advances[-1].changes.removals == (BirthId(0, 3),)


def test_a_paused_arena_stops_until_it_is_resumed() -> None:
    lived = life().live(20)
    order(lived, Pause())
    lived.turn()
    assert not lived.waiting
    assert lived.arena.next_step == lived.arena.step == 5000
    found = order(lived, Resume())
    assert [type(one) for one in found] == [AdvanceShard]
    assert lived.live().is_done


def test_a_pause_changes_nothing_else() -> None:
    paused = life().live(33)
    order(paused, Pause())
    paused.live()
    order(paused, Resume())
    assert paused.live().commands == life().live().commands


def test_a_robot_that_is_inserted_is_a_birth_without_parents() -> None:
    lived = life().live(20)
    child = genome(lived)
    order(lived, Insert(child, (0.5, -0.25)))
    order(lived, Insert(child))
    lived.turn()
    first, second = lived.rows("births")[15:]
    assert (first["birth"], first["sim_time_s"]) == (15, 25.0)
    assert (first["x"], first["y"]) == (0.5, -0.25)
    assert (first["parents"], first["rank"], first["attempts"]) == ([], 1, 1)
    assert second["birth"] == 16
    assert (second["x"], second["y"]) != (0.5, -0.25)
    assert lived.arena.births == 17
    lived.live()
    parents = [one["birth"] for row in lived.rows("births") for one in row["parents"]]
    assert 15 in parents or 16 in parents


def test_inserted_robots_await_room_in_a_full_arena() -> None:
    lived = ArenaRun(
        Arena(experiment(population_limit=16), 1, 0), World(equal_fitness)
    ).live(20)
    order(lived, Insert(genome(lived)))
    order(lived, Insert(genome(lived)))
    lived.turn()
    assert numbers_of(lived) == list(range(16))
    order(lived, Remove(BirthId(0, 7)))
    lived.turn()
    assert numbers_of(lived) == [0, 1, 2, 3, 4, 5, 6, *range(8, 17)]


def numbers_of(lived: ArenaRun) -> list[int]:
    return [one.birth.number for one in lived.arena.population]


def test_inserted_robots_await_the_founders() -> None:
    lived = life().live(3)
    order(lived, Insert(genome(lived)))
    lived.live(16)
    times = [row["sim_time_s"] for row in lived.rows("births")]
    assert times == [float(second) for second in range(15)] + [14.0]


def test_an_order_to_insert_prevents_extinction_at_its_decision() -> None:
    world = World(distinct_fitness, lambda _birth, step: step == 6000)
    lived = ArenaRun(Arena(experiment(60), 1, 0), world).live(25)
    assert lived.arena.next_step == 6000
    order(lived, Insert(genome(lived)))
    born = lived.arena.births
    lived.turn()
    assert not lived.arena.is_extinct
    assert not lived.arena.is_finished
    assert numbers_of(lived) == [born]


def test_a_replaced_brain_is_not_inherited() -> None:
    lived = life().live(20)
    brain = brain_of(lived, 4)
    rewired = replace(brain, connections=())
    order(lived, ReplaceBrain(BirthId(0, 4), rewired))
    before = lived.arena.population
    lived.turn()
    (change,) = lived.advances[-1].changes.brains
    assert (change.birth, change.brain) == (BirthId(0, 4), rewired)
    assert lived.arena.population[4].genome is before[4].genome


def brain_of(lived: ArenaRun, number: int) -> Brain:
    inserted = [each for one in lived.advances for each in one.changes.insertions]
    (found,) = [each for each in inserted if each.birth.number == number]
    return found.robot.brain


def test_a_robot_can_be_changed_and_removed_before_its_first_advance() -> None:
    lived = life().live(20)
    order(lived, Pause())
    order(lived, Insert(genome(lived)))
    lived.turn()
    founders = replace(brain_of(lived, 0), connections=())
    assert order(lived, ReplaceBrain(BirthId(0, 15), founders)) == []
    order(lived, Insert(genome(lived)))
    order(lived, Remove(BirthId(0, 16)))
    order(lived, Resume())
    changes = lived.advances[-1].changes
    assert [each.birth.number for each in changes.insertions] == [15]
    assert changes.insertions[0].robot.brain == founders
    assert (changes.brains, changes.removals) == ((), ())
    (death,) = lived.rows("deaths")
    assert (death["birth"], death["reason"], death["z"]) == (16, "removed", None)
    assert lived.live().is_done


def test_orders_on_dead_robots_are_ignored() -> None:
    lived = life().live(20)
    undisturbed = life().live()
    order(lived, Remove(BirthId(0, 99)))
    order(lived, ReplaceBrain(BirthId(0, 99), Brain()))
    # A brain that does not fit the body.
    order(lived, ReplaceBrain(BirthId(0, 1), Brain()))
    assert lived.live().commands == undisturbed.commands


def test_a_repeated_order_is_carried_out_once() -> None:
    lived = life().live(20)
    order(lived, Insert(genome(lived)), "one")
    order(lived, Insert(genome(lived)), "one")
    lived.turn()
    assert order(lived, Insert(genome(lived)), "one") == []
    assert lived.arena.births == 16


@pytest.mark.parametrize(("island", "off"), [(1, 0), (0, 1), (0, -1000)])
def test_an_order_for_another_step_or_island_raises(island: int, off: int) -> None:
    lived = life().live(20)
    step = lived.arena.next_step + off
    with pytest.raises(UnexpectedEvent, match="orders take effect at 5000"):
        lived.arena.handle(Commanded(island, "x", step, Pause()))


@pytest.mark.parametrize(
    "wanted",
    [
        Insert(encode_genome(Node("Wheel", -1, 0, ()))),
        Insert(encode_genome(Node("FixedBrick", -1, 0, ()))),
        Insert(encode_genome(Node("Core", -1, 0, ())), (float("nan"), 0.0)),
        Insert(b"\xff no genome"),
    ],
)
def test_an_invalid_robot_is_rejected(wanted: Insert) -> None:
    lived = life().live(20)
    with pytest.raises(InvalidRobot):
        order(lived, wanted)
    assert lived.live().commands == life().live().commands


def test_a_finished_arena_ignores_orders() -> None:
    lived = ArenaRun(Arena(experiment(15), 1, 0), World(equal_fitness)).live()
    assert lived.arena.step * DT == 15.0
    assert order(lived, Pause()) == []
