"""Migration between off-line islands: cases worked out by hand."""

from typing import Any

import msgspec
import pytest

from coordinator.evolution.breeding import Individual
from coordinator.islands.events import (
    Emigrate,
    Finish,
    Immigrated,
    NeighbourClosed,
    Record,
)
from coordinator.islands.island import Island
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment, Islands, SelectionSection, Simulation
from schema.experiment.environment import Environment
from schema.robot.ids import BirthId
from schema.wire.messages import Evaluate
from tests.coordinator.archipelago_run import ArchipelagoRun, migrating

Names = list[tuple[int, int]]
SMALL = SelectionSection(population=4, children=2, parents="random")


def small_islands(*births: int, **migration: Any) -> ArchipelagoRun:  # noqa: ANN401
    """Return islands of four with broods of two; fitness rises with the name.

    Birth n of island i has fitness (4 i + n) / 100 everywhere.
    """
    islands = [Islands(births=each) for each in births]
    return migrating(*islands, selection=SMALL, fit=rising, **{"epoch": 4, **migration})


def rising(birth: BirthId, island: int) -> float:
    del island
    return (4 * birth.island + birth.number) / 100


def living(lived: ArchipelagoRun, island: int, births: int) -> Names:
    """Return the names in the population rows of an island."""
    return [
        (row["island"] if row["birth_island"] is None else row["birth_island"],
         row["birth"])
        for row in lived.rows("population")
        if (row["island"], row["births"]) == (island, births)
    ]  # fmt: skip


def sent(lived: ArchipelagoRun) -> list[tuple[int, int, int, int, int]]:
    columns = ("island", "to", "epoch", "birth_island", "birth")
    return [tuple(row[name] for name in columns) for row in lived.rows("migrations")]


def test_a_copy_of_the_best_replaces_the_worst() -> None:
    lived = small_islands(6, 6).live()
    assert sent(lived) == [(0, 1, 0, 0, 3), (1, 0, 0, 1, 3)]
    assert living(lived, 0, 4) == [(0, 1), (0, 2), (0, 3), (1, 3)]
    assert living(lived, 1, 4) == [(0, 3), (1, 1), (1, 2), (1, 3)]
    (row, _) = lived.rows("migrations")
    assert row == {
        "island": 0, "to": 1, "epoch": 0, "births": 4, "sim_time_s": None,
        "birth_island": 0, "birth": 3, "fitness": 0.03,
    }  # fmt: skip


def test_an_evicted_migrant_leaves_its_place_to_an_immigrant() -> None:
    lived = small_islands(6, 6, handling="evict").live()
    assert living(lived, 0, 4) == [(0, 0), (0, 1), (0, 2), (1, 3)]
    assert living(lived, 1, 4) == [(0, 3), (1, 0), (1, 1), (1, 2)]


def test_evicted_migrants_are_shared_out_and_enough_remain_to_mate() -> None:
    # Two of four must stay: of the three that three neighbours want two go.
    lived = small_islands(6, 6, 6, 6, topology="star", handling="evict").live()
    assert [each for each in sent(lived) if each[0] == 0] == [
        (0, 1, 0, 0, 3),
        (0, 2, 0, 0, 2),
    ]
    assert living(lived, 3, 4) == [(3, 0), (3, 1), (3, 2)]
    assert living(lived, 0, 4) == [(0, 1), (1, 3), (2, 3), (3, 3)]


def test_a_share_of_a_population_is_rounded() -> None:
    lived = small_islands(6, 6, migrants=0.4).live()
    assert sent(lived)[:2] == [(0, 1, 0, 0, 3), (0, 1, 0, 0, 2)]


def test_edges_go_one_way() -> None:
    lived = small_islands(6, 6, topology="edges", edges=((1, 0),)).live()
    assert sent(lived) == [(1, 0, 0, 1, 3)]
    assert living(lived, 1, 4) == [(1, 0), (1, 1), (1, 2), (1, 3)]


def test_an_immigrant_that_lives_on_the_island_already_is_dropped() -> None:
    # Broods are no better than immigrants: 1:3 stays the best of both islands.
    lived = small_islands(8, 8, epoch=2)
    lived.fit = lambda birth, _: 0.9 if birth == (1, 3) else 0.5 - birth.number / 99
    lived.live()
    assert (1, 0, 1, 1, 3) in sent(lived)
    assert living(lived, 0, 6).count((1, 3)) == 1
    assert len(living(lived, 0, 6)) == 4


def test_an_immigrant_is_re_evaluated_if_judge_anew_is_set() -> None:
    lived = small_islands(6, 6, judge_anew=True)
    lived.fit = lambda birth, island: 0.5 + 0.1 * (birth.island == island)
    lived.live()
    asked = [one for one in lived.commands[0] if isinstance(one, Evaluate)]
    (again,) = [one for one in asked if one.requester is not None]
    assert (again.birth, again.requester, again.trial) == (BirthId(1, 0), 0, 1)
    (row,) = [row for row in lived.rows("evaluations") if row["birth_island"] == 1]
    assert (row["island"], row["birth"], row["trial"]) == (0, 0, 1)
    (fitness,) = [
        row["fitness"]
        for row in lived.rows("population")
        if (row["island"], row["births"], row["birth_island"]) == (0, 4, 1)
    ]
    assert fitness == 0.5


@pytest.mark.parametrize(
    "changes",
    [
        {"simulation": Simulation(window_steps=400)},
        {"environment": Environment(slope_deg=5.0)},
    ],
)
def test_other_evaluation_settings_cause_re_evaluation(
    changes: dict[str, object],
) -> None:
    document = small_islands(6, 6).experiment
    first, second = document.islands
    other = msgspec.structs.replace(second, **changes)
    document = msgspec.structs.replace(document, islands=(first, other))
    lived = ArchipelagoRun(document, fit=rising).live()
    reevaluations = [row for row in lived.rows("evaluations") if row["trial"]]
    assert [(row["island"], row["birth_island"]) for row in reevaluations] == [
        (0, 1),
        (1, 0),
    ]


def test_no_island_waits_for_a_finished_one() -> None:
    # What island 1 sends at the end of epoch 1 it sends before it waits.
    lived = small_islands(6, 20).live()
    assert [each[:3] for each in sent(lived)] == [(0, 1, 0), (1, 0, 0), (1, 0, 1)]
    assert all(island.is_finished for island in lived.islands.values())
    assert lived.islands[1].births == 20


@pytest.mark.parametrize("slow", [(0,), (1,), (0, 2)])
def test_slow_islands_change_no_row(slow: tuple[int, ...]) -> None:
    outcome = small_islands(12, 8, 10).live().outcome
    lived = small_islands(12, 8, 10)
    lived.slow = slow
    assert lived.live().outcome == outcome


def test_the_last_command_informs_the_neighbours() -> None:
    lived = small_islands(6, 6, 6).live()
    assert lived.commands[1][-1] == Finish(1, (0, 2))


def test_impossible_migration_events_raise() -> None:
    lived = small_islands(6, 6).live(3)
    island = lived.islands[0]
    for event in (
        Immigrated(0, 2, 0, ()),
        Immigrated(0, 1, 1, ()),
        Immigrated(1, 0, 0, ()),
        NeighbourClosed(0, 3),
    ):
        with pytest.raises(UnexpectedEvent):
            island.handle(event)
    island.handle(NeighbourClosed(0, 1))
    with pytest.raises(UnexpectedEvent):
        island.handle(NeighbourClosed(0, 1))
    alone = Island(Experiment(name="alone"), 1, 0)
    with pytest.raises(UnexpectedEvent, match="no neighbours"):
        alone.handle(NeighbourClosed(0, 1))


def test_an_epoch_ends_at_the_end_of_a_brood() -> None:
    # Broods end with births 4, 6, 8, 10; multiples of 3 are reached at 4, 6, 10.
    lived = small_islands(12, 12, epoch=3).live()
    assert [row["births"] for row in lived.rows("migrations") if not row["island"]] == [
        4, 6, 10,
    ]  # fmt: skip


def test_migrants_are_recorded_before_they_are_sent() -> None:
    lived = small_islands(6, 6).live()
    kinds = [type(one) for one in lived.commands[0]]
    emigrated = kinds.index(Emigrate)
    assert kinds[emigrated - 1] is Record
    assert lived.commands[0][emigrated - 1].table == "migrations"  # type: ignore[union-attr]


def test_a_failed_immigrant_is_no_fitter_than_a_negative_native() -> None:
    lived = small_islands(6, 6, judge_anew=True)
    lived.fit = lambda birth, _: -1.0 - birth.number
    lived.live(turns=1)
    island = lived.islands[0]
    assert isinstance(island, Island)
    migration = island._migration
    assert migration is not None
    natives = [
        Individual(BirthId(0, number), b"", -1.0 - number, 1, 0) for number in range(4)
    ]
    failed = Individual(BirthId(1, 0), b"", 0.5, 1, 0).evaluated(None, ())
    # It replaces the worst, number 3, and is then as fit as number 2.
    found = migration._settle(natives, [failed])
    assert [(one.birth, one.fitness) for one in found] == [
        *((one.birth, one.fitness) for one in natives[:3]),
        (failed.birth, -3.0),
    ]
