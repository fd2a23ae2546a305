"""An off-line island: events in, commands out."""

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.islands.events import (
    Answered,
    Evaluated,
    EvaluationFailed,
    Finish,
    IslandCommand,
    Record,
    Started,
    Vetted,
    VettingFailed,
)
from coordinator.islands.island import Island
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import Experiment, SelectionSection, body_space
from schema.experiment.file import read_experiment, shipped_experiments
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.tables.columns import ROWS
from schema.wire.messages import Evaluate, Vet
from schema.wire.protobuf import decode_genome
from tests.coordinator.reports import CROWDED, PROVENANCE, VIABLE

BASELINES = ("no-selection", "no-reproduction")

Answer = Callable[[Vet | Evaluate], Answered]


def small(**selection: Any) -> Experiment:  # noqa: ANN401 - any setting
    wanted: dict[str, Any] = {"population": 6, "children": 4, **selection}
    return Experiment(name="test", births=18, selection=SelectionSection(**wanted))


def fitness_of(birth: BirthId) -> float:
    """Return a fitness in (0, 1), in no order and without ties."""
    return (birth.number * 0.6180339887498949 + 0.1) % 1.0


def answer(command: Vet | Evaluate) -> Answered:
    """Reject every third body; fail the simulation of every seventh birth."""
    birth = command.birth
    if isinstance(command, Vet):
        if (birth.number + command.attempt) % 3 == 1:
            return Vetted(birth, command.attempt, CROWDED)
        if (birth.number + command.attempt) % 8 == 7:
            return VettingFailed(birth, command.attempt, "analyzer broke thrice")
        return Vetted(birth, command.attempt, VIABLE)
    if birth.number % 7 == 3:
        return EvaluationFailed(birth, "diverged at 0.3 s", PROVENANCE)
    fitness = fitness_of(birth)
    return Evaluated(birth, Evaluation(fitness, 0.1, fitness / 5, 12.0), PROVENANCE)


def well(command: Vet | Evaluate) -> Answered:
    """Accept every body and every simulation."""
    if isinstance(command, Vet):
        return Vetted(command.birth, command.attempt, VIABLE)
    fitness = fitness_of(command.birth)
    return Evaluated(command.birth, Evaluation(fitness, 0.1, 0.0, 12.0), PROVENANCE)


def requests(commands: list[IslandCommand]) -> list[Vet | Evaluate]:
    return [one for one in commands if isinstance(one, Vet | Evaluate)]


def live(
    island: Island, reply: Answer = answer, order: Iterator[int] | None = None
) -> list[IslandCommand]:
    """Run an island to its end, with requests answered in some order."""
    commands = island.handle(Started())
    open_requests = deque(requests(commands))
    while open_requests:
        open_requests.rotate(-next(order) if order else 0)
        found = island.handle(reply(open_requests.popleft()))
        commands += found
        open_requests += requests(found)
    return commands


def records(commands: list[IslandCommand]) -> list[Record]:
    return [one for one in commands if isinstance(one, Record)]


def rows(commands: list[IslandCommand], table: str) -> list[Any]:
    return [one.row for one in records(commands) if one.table == table]


def test_all_founders_are_vetted_at_once() -> None:
    commands = Island(small(), 1, 0).handle(Started())
    assert all(isinstance(one, Vet) for one in commands)
    assert [one.birth for one in requests(commands)] == [
        BirthId(0, number) for number in range(6)
    ]


def test_a_viable_body_is_evaluated_and_an_unviable_one_replaced() -> None:
    island = Island(small(), 1, 0)
    first, second, *_ = requests(island.handle(Started()))
    assert island.handle(well(first)) == [Evaluate(first.birth, first.robot)]
    (again,) = island.handle(Vetted(second.birth, 0, CROWDED))
    assert isinstance(again, Vet)
    assert (again.birth, again.attempt) == (second.birth, 1)
    assert again.robot != second.robot
    (third,) = island.handle(VettingFailed(second.birth, 1, "broke"))
    assert isinstance(third, Vet)
    assert (third.birth, third.attempt) == (second.birth, 2)


def test_births_are_committed_in_birth_order() -> None:
    island = Island(small(), 1, 0)
    for context in requests(island.handle(Started())):
        island.handle(well(context))
    late = [BirthId(0, number) for number in (3, 1, 0)]
    committed = []
    for birth in late:
        evaluation = Evaluation(0.5, 0.0, 0.0, 12.0)
        found = island.handle(Evaluated(birth, evaluation, PROVENANCE))
        committed.append([(r.table, r.row["birth"]) for r in records(found)])
    assert committed == [
        [],
        [],
        [("births", 0), ("evaluations", 0), ("births", 1), ("evaluations", 1)],
    ]
    assert island.births == 2


def test_a_whole_run_has_the_rows_and_columns_of_the_tables() -> None:
    island = Island(small(), 7, 2, number=3)
    commands = live(island)
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
    commands = live(Island(small(), 7, 0))
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

    def remember(command: Vet | Evaluate) -> Answered:
        if isinstance(command, Evaluate):
            judged[command.birth.number] = command.robot
        return answer(command)

    attempts = set()
    for row in rows(live(island, remember), "births"):
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
    commands = live(island)
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


def test_the_best_of_all_births_are_alive() -> None:
    island = Island(small(), 7, 0)
    live(island, well)
    best = sorted(range(18), key=lambda n: -fitness_of(BirthId(0, n)))[:6]
    assert [one.birth.number for one in island.population] == sorted(best)


def test_comma_selection_keeps_the_last_brood_only() -> None:
    island = Island(small(keep_parents=False, children=6), 7, 0)
    live(island, well)
    assert [one.birth.number for one in island.population] == list(range(12, 18))


def test_the_last_brood_is_cut_where_the_births_end() -> None:
    experiment = msgspec.structs.replace(small(), births=9)
    island = Island(experiment, 7, 0)
    commands = live(island)
    assert [row["birth"] for row in rows(commands, "births")] == list(range(9))
    assert {row["births"] for row in rows(commands, "population")} == {6, 9}
    assert len(island.population) == 6


def test_a_run_may_consist_of_founders_only() -> None:
    island = Island(msgspec.structs.replace(small(), births=6), 7, 0)
    assert live(island)[-1] == Finish(0)
    assert island.births == len(island.population) == 6


@pytest.mark.parametrize("window", [1, 3, 4])
def test_no_more_births_are_in_flight_than_the_window_allows(window: int) -> None:
    island = Island(small(window=window), 7, 0)
    commands = island.handle(Started())
    waiting = deque(requests(commands))
    most = 0
    while waiting:
        found = island.handle(answer(waiting.popleft()))
        waiting += requests(found)
        if island.births >= 6:
            most = max(most, len({one.birth for one in waiting}))
    assert most == window
    assert island.is_finished


def test_the_window_changes_no_birth() -> None:
    lives = [records(live(Island(small(window=w), 7, 0))) for w in (1, 2, 4)]
    assert lives[0] == lives[1] == lives[2]


def test_one_child_at_a_time_competes_at_once() -> None:
    island = Island(small(children=1), 7, 0)
    commands = live(island, well)
    counts = sorted({row["births"] for row in rows(commands, "population")})
    assert counts == list(range(6, 19))
    generations = [row["generation"] for row in rows(commands, "births")]
    assert generations == [0] * 6 + list(range(1, 13))


def test_without_reproduction_every_child_is_a_new_random_robot() -> None:
    commands = live(Island(small(parents="none", children=3), 7, 0))
    found = rows(commands, "births")
    assert all(row["parents"] == [] and row["rank"] == 1 for row in found)
    assert [row["generation"] for row in found] == [0] * 6 + sorted([1, 2, 3, 4] * 3)
    genes = [part["gene"] for row in found for part in row["body"]]
    assert len(set(genes)) == len(genes)


def test_without_selection_fitness_decides_nothing() -> None:
    experiment = small(parents="random", survivors="random")
    lives = []
    for sign in (1.0, -1.0):

        def judge(command: Vet | Evaluate, sign: float = sign) -> Answered:
            found = well(command)
            if isinstance(found, Evaluated):
                fitness = sign * found.evaluation.fitness
                return Evaluated(
                    found.birth, Evaluation(fitness, 0.0, 0.0, 12.0), PROVENANCE
                )
            return found

        commands = live(Island(experiment, 7, 0), judge)
        lives.append(rows(commands, "births"))
    assert lives[0] == lives[1]


def test_new_parents_are_selected_after_max_mating_attempts() -> None:
    island = Island(small(max_mating_attempts=3, population=9), 7, 0)
    waiting = deque(requests(island.handle(Started())))
    couples = []
    while waiting:
        context = waiting.popleft()
        candidate = island._in_flight[context.birth.number].candidate
        if context.birth.number == 9 and candidate.attempt < 9:
            assert candidate.couple is not None
            names = tuple(one.birth.number for one in candidate.couple)
            couples.append((candidate.attempt // 3, names))
            waiting += requests(
                island.handle(Vetted(context.birth, candidate.attempt, CROWDED))
            )
        elif context.birth.number <= 9:
            waiting += requests(island.handle(well(context)))
    by_block = {block: {c for b, c in couples if b == block} for block in range(3)}
    assert all(len(found) == 1 for found in by_block.values())
    assert len(set.union(*by_block.values())) > 1


@settings(max_examples=25, deadline=None)
@given(st.data())
def test_the_order_of_answers_changes_no_record(
    data: st.DataObject,
) -> None:
    numbers = data.draw(st.lists(st.integers(0, 30), min_size=200, max_size=200))
    shuffled = Island(small(), 11, 0)
    commands = live(shuffled, order=iter(numbers * 5))
    assert records(commands) == records(live(Island(small(), 11, 0)))


@settings(max_examples=25, deadline=None)
@given(st.data())
def test_duplicates_change_nothing(data: st.DataObject) -> None:
    island = Island(small(), 11, 0)
    commands = island.handle(Started())
    waiting = deque(requests(commands))
    given_answers: list[Answered] = []
    while waiting:
        given_answers.append(answer(waiting.popleft()))
        found = island.handle(given_answers[-1])
        commands += found
        waiting += requests(found)
        again = data.draw(st.sampled_from(given_answers[-8:]))
        assert island.handle(again) == []
    assert records(commands) == records(live(Island(small(), 11, 0)))


@pytest.mark.parametrize(("seed", "run"), [(12, 0), (11, 1)])
def test_another_seed_or_run_gives_other_genomes(seed: int, run: int) -> None:
    one = rows(live(Island(small(), 11, 0)), "births")
    other = rows(live(Island(small(), seed, run)), "births")
    assert all(a["genome"] != b["genome"] for a, b in zip(one, other, strict=True))


EVALUATED = Evaluated(BirthId(0, 0), Evaluation(0.1, 0.1, 0.1, 12.0), PROVENANCE)


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (Started(), "it has started before"),
        (EVALUATED, "it has not been vetted"),
        (EvaluationFailed(BirthId(0, 0), "why", PROVENANCE), "it has not been vetted"),
        (Vetted(BirthId(0, 0), 1, VIABLE), "it is at attempt 0"),
        (VettingFailed(BirthId(0, 0), 1, "why"), "it is at attempt 0"),
        (Vetted(BirthId(0, 6), 0, VIABLE), "births 0..5 have begun"),
        (Vetted(BirthId(1, 0), 0, VIABLE), "births 0..5 have begun"),
    ],
)
def test_an_impossible_event_raises_and_changes_nothing(event: Any, why: str) -> None:  # noqa: ANN401 - any event
    island = Island(small(), 11, 0)
    commands = island.handle(Started())
    with pytest.raises(UnexpectedEvent, match=why):
        island.handle(event)
    waiting = deque(requests(commands))
    while waiting:
        found = island.handle(answer(waiting.popleft()))
        commands += found
        waiting += requests(found)
    assert records(commands) == records(live(Island(small(), 11, 0)))


def test_an_event_before_the_start_raises() -> None:
    with pytest.raises(UnexpectedEvent, match="0 of 18 born"):
        Island(small(), 11, 0).handle(EVALUATED)


def test_a_fitness_that_is_not_finite_raises() -> None:
    island = Island(small(), 11, 0)
    island.handle(Started())
    island.handle(Vetted(BirthId(0, 0), 0, VIABLE))
    evaluation = Evaluation(float("nan"), 0.0, 0.0, 12.0)
    with pytest.raises(UnexpectedEvent, match="fitness must be finite"):
        island.handle(Evaluated(BirthId(0, 0), evaluation, PROVENANCE))


def never(command: Vet | Evaluate) -> Answered:
    """Reject every body."""
    assert isinstance(command, Vet)
    return Vetted(command.birth, command.attempt, CROWDED)


def test_an_error_is_raised_if_no_founder_is_ever_viable() -> None:
    with pytest.raises(ExperimentError, match=r"max_tries = 100 .* parts 1 and 2"):
        live(Island(small(), 11, 0), never)


def test_an_error_is_raised_if_no_child_is_ever_viable() -> None:
    def barren(command: Vet | Evaluate) -> Answered:
        return well(command) if command.birth.number < 6 else never(command)

    with pytest.raises(
        ExperimentError, match=r"birth 6 of island 0: .* = 500 attempts"
    ):
        live(Island(small(), 11, 0), barren)


@pytest.mark.parametrize("name", ["scenario1", "scenario2", *BASELINES])
def test_the_shipped_experiments_run_to_their_end(name: str) -> None:
    experiment = msgspec.structs.replace(read_experiment(name), births=50)
    assert experiment.name == name
    island = Island(experiment, 1, 0)
    commands = live(island)
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
