"""An off-line island: events in, commands out."""

from itertools import cycle
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.islands.events import (
    Answered,
    Evaluated,
    EvaluationFailed,
    Finish,
    IslandCommand,
    Started,
)
from coordinator.islands.island import Island
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import Experiment, SelectionSection, body_space
from schema.experiment.file import read_experiment, shipped_experiments
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.tables.columns import ROWS
from schema.wire.messages import Bred, Breed, Evaluate
from schema.wire.protobuf import decode_genome
from tests.coordinator.breeding import bred, failed, reject_some
from tests.coordinator.island_run import live, records, requests, rows
from tests.coordinator.reports import PROVENANCE
from tests.coordinator.sent_requests import ROBOT

BASELINES = ("no-selection", "no-reproduction")


def small(**selection: Any) -> Experiment:  # noqa: ANN401 - any setting
    wanted: dict[str, Any] = {"population": 6, "children": 4, **selection}
    return Experiment(name="test", births=18, selection=SelectionSection(**wanted))


def fitness_of(birth: BirthId) -> float:
    """Return a fitness in (0, 1), in no order and without ties."""
    return (birth.number * 0.6180339887498949 + 0.1) % 1.0


def answer(command: Evaluate) -> Answered:
    """Fail the simulation of every seventh birth."""
    if command.birth.number % 7 == 3:
        return EvaluationFailed(command.birth, "diverged at 0.3 s", PROVENANCE)
    return well(command)


def well(command: Evaluate) -> Evaluated:
    """Accept every simulation."""
    fitness = fitness_of(command.birth)
    return Evaluated(command.birth, Evaluation(fitness, 0.1, 0.0, 12.0), PROVENANCE)


def lived(seed: int = 11, run: int = 0, **selection: Any) -> list[IslandCommand]:  # noqa: ANN401 - any setting
    return live(Island(small(**selection), seed, run), answer, why_not=reject_some)


def test_a_child_is_evaluated_and_a_couple_without_one_replaced() -> None:
    island = Island(small(), 1, 0)
    first, second, *_ = requests(island.handle(Started()))
    event = bred(island, first)
    assert event.child is not None
    assert island.handle(event) == [Evaluate(first.birth, event.child.robot)]
    assert (second.attempt, second.end, second.parents) == (0, 5, ())
    (again,) = requests(island.handle(failed(second)))
    assert again == replace(second, attempt=5, end=10)
    later = bred(island, again)
    assert later.child not in (None, bred(island, second).child)
    for number in range(1, 6):
        work = island._in_flight[number].request
        island.handle(bred(island, work))
    children: list[Breed] = []
    for number in range(6):
        children += requests(island.handle(well(Evaluate(BirthId(0, number), ROBOT))))
    genomes = {one.birth: one.genome for one in island.population}
    work = children[0]
    assert len(set(work.parents)) == 2
    assert set(work.parents) < set(genomes.values())
    (other,) = island.handle(failed(work))
    assert isinstance(other, Breed)
    assert (other.attempt, other.end) == (5, 10)
    assert other.parents != work.parents


def test_a_whole_run_has_the_rows_and_columns_of_the_tables() -> None:
    island = Island(small(), 7, 2, number=3)
    commands = live(island, answer, why_not=reject_some)
    assert island.is_finished
    assert commands[-1] == Finish(3)
    assert sum(isinstance(one, Finish) for one in commands) == 1
    for table in ("births", "evaluations"):
        found = rows(commands, table)
        assert [(row["island"], row["birth"]) for row in found] == [
            (3, number) for number in range(18)
        ]
    for record in records(commands):
        assert list(record.row) == ROWS[record.table].names
    counts = [row["births"] for row in rows(commands, "population")]
    assert sorted(set(counts)) == [6, 10, 14, 18]
    assert all(counts.count(count) == 6 for count in set(counts))


def test_births_name_their_parents_ranks_and_broods() -> None:
    commands = lived(7)
    born = {row["birth"]: row for row in rows(commands, "births")}
    alive: dict[int, set[int]] = {}
    for row in rows(commands, "population"):
        alive.setdefault(row["births"], set()).add(row["birth"])
    for number, row in born.items():
        parents = [parent["birth"] for parent in row["parents"]]
        brood = max(0, (number - 6) // 4 + 1)
        assert row["generation"] == brood
        if number < 6:
            assert (parents, row["rank"]) == ([], 1)
            continue
        assert len(set(parents)) == 2
        assert set(parents) <= alive[6 + 4 * (brood - 1)]
        assert row["rank"] == 1 + max(born[parent]["rank"] for parent in parents)


def test_births_rows_describe_the_evaluated_robot() -> None:
    experiment = small()
    island = Island(experiment, 7, 0)
    judged = {}

    def remember(command: Evaluate) -> Answered:
        judged[command.birth.number] = command.robot
        return answer(command)

    attempts = set()
    for row in rows(live(island, remember, why_not=reject_some), "births"):
        robot = judged[row["birth"]]
        genome = decode_genome(row["genome"])
        assert develop(genome, body_space(experiment.space)) == robot
        assert row["parts"] == len(robot.parts) == len(row["body"])
        assert row["motors"] == robot.brain.count("output")
        attempts.add(row["attempts"])
    assert min(attempts) == 1
    assert max(attempts) > 2


def test_a_failed_evaluation_has_no_measures_and_counts_as_zero() -> None:
    island = Island(small(survivors="random"), 7, 0)
    commands = live(island, answer)
    found = {row["birth"]: row for row in rows(commands, "evaluations")}
    numbers = ("fitness", "path_velocity", "straight_velocity", "simulated_s")
    for number, row in found.items():
        has_failed = number % 7 == 3
        assert row["status"] == ("failed" if has_failed else "ok")
        assert row["reason"] == ("diverged at 0.3 s" if has_failed else "")
        assert all((row[name] is None) == has_failed for name in numbers)
        assert row["worker"] == "worker-1"
    alive = rows(commands, "population")
    assert any(row["birth"] == 3 and row["fitness"] is None for row in alive)
    failed = [one for one in island.population if one.has_failed]
    assert failed
    assert all(one.fitness == 0.0 for one in failed)
    assert not set(island.judged) & set(failed)
    assert {*island.judged, *failed} == set(island.population)


def test_the_last_brood_is_cut_where_the_births_end() -> None:
    experiment = replace(small(), births=9)
    island = Island(experiment, 7, 0)
    commands = live(island, answer)
    assert [row["birth"] for row in rows(commands, "births")] == list(range(9))
    assert {row["births"] for row in rows(commands, "population")} == {6, 9}
    assert len(island.population) == 6


def test_a_run_may_consist_of_founders_only() -> None:
    island = Island(replace(small(), births=6), 7, 0)
    assert live(island, answer)[-1] == Finish(0)
    assert island.births == len(island.population) == 6


@pytest.mark.parametrize("window", [1, 3, 4])
def test_the_window_limits_births_in_flight_and_changes_none(window: int) -> None:
    island = Island(small(window=window), 11, 0)
    in_flight = []

    def watched(command: Evaluate) -> Answered:
        in_flight.append(len(island._in_flight) if island.births >= 6 else 0)
        return answer(command)

    assert records(live(island, watched, why_not=reject_some)) == records(lived())
    assert max(in_flight) == window


def test_without_selection_fitness_decides_nothing() -> None:
    def negated(command: Evaluate) -> Answered:
        event = well(command)
        fitness = -event.evaluation.fitness
        return replace(event, evaluation=replace(event.evaluation, fitness=fitness))

    runs = [
        live(Island(small(parents="random", survivors="random"), 7, 0), reply)
        for reply in (well, negated)
    ]
    assert rows(runs[0], "births") == rows(runs[1], "births")


@settings(max_examples=12, deadline=None)
@given(st.lists(st.integers(0, 30), min_size=1, max_size=50))
def test_the_order_of_answers_changes_no_record(turns: list[int]) -> None:
    shuffled = live(Island(small(), 11, 0), answer, cycle(turns), reject_some)
    assert records(shuffled) == records(lived())


IMPOSSIBLE = (
    (Started(), "it has started before"),
    (EvaluationFailed(BirthId(0, 0), "why", PROVENANCE), "it has not been bred"),
    (Bred(BirthId(0, 0), 5, ("why",)), "it is at attempt 0"),
    (Bred(BirthId(0, 6), 0), "births 0..5 have begun"),
    (Bred(BirthId(1, 0), 0), "births 0..5 have begun"),
)


def test_impossible_events_raise_and_change_nothing() -> None:
    island = Island(small(), 11, 0)
    tried: list[int] = []

    def provoked(birth: BirthId, attempt: int) -> str:
        # Before the first answer.
        for event, why in () if tried else IMPOSSIBLE:
            with pytest.raises(UnexpectedEvent, match=why):
                island.handle(event)
        tried.append(attempt)
        return reject_some(birth, attempt)

    assert records(live(island, answer, why_not=provoked)) == records(lived())


def test_an_error_is_raised_if_no_child_is_ever_viable() -> None:
    def barren(birth: BirthId, _attempt: int) -> str:
        return "" if birth.number < 6 else "crowded"

    with pytest.raises(
        ExperimentError, match=r"birth 6 of island 0: .* = 500 attempts.*: crowded;"
    ):
        live(Island(small(), 11, 0), well, why_not=barren)


@pytest.mark.parametrize("name", ["scenario1", "scenario2", *BASELINES])
def test_the_shipped_experiments_run_to_their_end(name: str) -> None:
    experiment = replace(read_experiment(name), births=50)
    assert experiment.name == name
    island = Island(experiment, 1, 0)
    commands = live(island, answer, why_not=reject_some)
    assert island.is_finished
    assert len(rows(commands, "births")) == 50
    assert len(island.population) == 15
    ranks = max(row["rank"] for row in rows(commands, "births"))
    assert (ranks == 1) == (name == "no-reproduction")
    best = sorted(rows(commands, "evaluations"), key=lambda r: -(r["fitness"] or 0.0))
    kept = {one.birth.number for one in island.population}
    is_elitist = {row["birth"] for row in best[:15]} == kept
    assert is_elitist == (name != "no-selection")


def test_the_shipped_experiments_are_the_thesis_s() -> None:
    assert {"scenario1", "scenario2", "no-selection", "no-reproduction"} <= set(
        shipped_experiments()
    )
    schemes = {
        name: read_experiment(name).selection
        for name in ("scenario1", "scenario2", "no-selection", "no-reproduction")
    }
    assert {s.population for s in schemes.values()} == {15}
    assert {read_experiment(name).births for name in schemes} == {3000}
    assert [s.children for s in schemes.values()] == [15, 1, 15, 15]
    assert [s.parents for s in schemes.values()] == [
        *("tournament", "tournament", "random", "none")
    ]
    assert [s.survivors for s in schemes.values()] == [
        *("best", "best", "random", "best")
    ]
