"""Lifetime learning of an off-line island: events in, commands out."""

from collections import deque
from collections.abc import Iterator
from itertools import cycle
from math import log
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.islands.events import (
    Answered,
    Ask,
    Asked,
    Evaluated,
    EvaluationFailed,
    IslandCommand,
    Started,
)
from coordinator.islands.island import Island
from coordinator.run.learners import Learners
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import (
    BrainSection,
    EncodingSection,
    Experiment,
    SelectionSection,
    Space,
    body_space,
)
from schema.experiment.identity import Origin
from schema.experiment.learning import Learning
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.tables.columns import ROWS
from schema.wire.messages import Breed, Evaluate
from schema.wire.protobuf import decode_genome, decode_robot
from tests.coordinator.breeding import bred
from tests.coordinator.island_run import live, records, requests, rows
from tests.coordinator.reports import PROVENANCE

FIRST = BirthId(0, 0)
PLAIN = Experiment(
    name="test", births=14, selection=SelectionSection(population=6, children=4)
)


def learning(**keys: Any) -> Experiment:  # noqa: ANN401 - any key
    return replace(PLAIN, learning=Learning(**{"budget": 5, **keys}))


def weight_sum(robot: Robot) -> float:
    """Return a fitness that depends on the brain: the mean parameter."""
    values = [edge.weight for edge in robot.brain.connections]
    values += [each for neuron in robot.brain.neurons for each in neuron.parameters]
    return sum(values) / len(values)


def judge(command: Evaluate) -> Answered:
    """Return a fitness of the brain; one trial in six fails."""
    if (command.birth.number + command.trial) % 6 == 4:
        return EvaluationFailed(command.birth, "diverged", PROVENANCE, command.trial)
    found = Evaluation(weight_sum(command.robot), 0.1, 0.0, 12.0)
    return Evaluated(command.birth, found, PROVENANCE, command.trial)


def lived(
    experiment: Experiment, order: Iterator[int] | None = None
) -> tuple[Island, list[IslandCommand]]:
    """Run an island to its end; return it and its commands."""
    island = Island(experiment, 1, 0)
    learners = Learners({0: experiment}, Origin(seed=1))

    def answer(command: Evaluate | Ask) -> Answered:
        is_ask = isinstance(command, Ask)
        return learners.answer(command) if is_ask else judge(command)  # type: ignore[arg-type]

    return island, live(island, answer, order)


def begun(experiment: Experiment) -> tuple[Island, list[Any]]:
    """Return an island whose first body is viable, and the requests that follow."""
    island = Island(experiment, 1, 0)
    first, *_ = requests(island.handle(Started()))
    return island, requests(island.handle(bred(island, first)))


def test_a_budget_of_one_is_no_learning() -> None:
    _, plain = lived(PLAIN)
    _, found = lived(learning(budget=1))
    assert rows(found, "births") == rows(plain, "births")
    assert rows(found, "evaluations") == rows(plain, "evaluations")
    assert rows(found, "population") == rows(plain, "population")
    assert [row["trial"] for row in rows(found, "learning")] == [0] * 14


@pytest.mark.parametrize("learner", ["cma-es", "(1+1)-es", "random"])
def test_trials_of_a_request_are_in_flight_together(learner: str) -> None:
    island, (first, ask) = begun(learning(learner=learner, budget=30))
    assert isinstance(first, Evaluate)
    assert isinstance(ask, Ask)
    assert (first.trial, ask.number, ask.most, ask.told) == (0, 0, 29, ())
    count, size = len(ask.start), {"random": 29, "(1+1)-es": 1}.get(learner)
    asked = Learners({0: island.experiment}, Origin()).answer(ask)
    trials = requests(island.handle(asked))
    assert len(trials) == len(asked.points) == (size or 3 + int(3 * log(count)))
    assert [each.trial for each in trials] == [*range(1, len(trials) + 1)]
    commands = [each for one in (*trials, first) for each in island.handle(judge(one))]
    if learner != "random":
        (again,) = commands
        assert isinstance(again, Ask)
        ((points, fitness),) = again.told
        assert points == (ask.start, *asked.points)
        assert fitness[0] == weight_sum(first.robot)
        assert (again.number, again.most) == (1, 29 - len(trials))


@pytest.mark.parametrize("inherit", ["darwinian", "lamarckian"])
@pytest.mark.parametrize("brain", ["network", "cpg"])
def test_the_best_trial_counts_and_is_inherited_or_not(
    inherit: str, brain: str
) -> None:
    experiment = replace(learning(inherit=inherit), brain=BrainSection(type=brain))
    island, commands = lived(experiment)
    trials = rows(commands, "learning")
    assert [row["birth"] for row in trials] == sorted(5 * [*range(14)])
    assert all(row.keys() == set(ROWS["learning"].names) for row in trials)
    types, learnt = body_space(experiment.space), 0
    born = {row["birth"]: row for row in rows(commands, "births")}
    for row in rows(commands, "evaluations"):
        number = row["birth"]
        own = [each for each in trials if each["birth"] == number]
        assert [each["trial"] for each in own] == [0, 1, 2, 3, 4]
        found = [each["fitness"] for each in own]
        assert found.count(None) == sum((number + k) % 6 == 4 for k in range(5))
        assert all((each["fitness"] is None) == bool(each["reason"]) for each in own)
        best = max(each for each in found if each is not None)
        assert (row["fitness"], row["trial"]) == (best, 0)
        assert own[0]["distance"] == 0.0 < own[1]["distance"] < 1.0
        inherited = develop(decode_genome(born[number]["genome"]), types)
        has_learnt = best != found[0]
        learnt += has_learnt
        assert (born[number]["robot"] is None) == (
            inherit == "lamarckian" or not has_learnt
        )
        stored = born[number]["robot"]
        robot = decode_robot(stored) if stored else inherited
        assert weight_sum(robot) == best
        if inherit == "darwinian" and found[0] is not None:
            assert weight_sum(inherited) == found[0]
    assert learnt > 8
    for one in island.population:
        robot = one.learnt or develop(decode_genome(one.genome), types)
        assert weight_sum(robot) == one.fitness


@given(st.lists(st.integers(0, 40), min_size=1, max_size=20))
@settings(max_examples=8, deadline=None)
def test_rows_do_not_depend_on_the_order_of_answers(turns: list[int]) -> None:
    experiment = learning(learner="(1+1)-es", inherit="samples", peers=1)
    shuffled, straight = lived(experiment, cycle(turns))[1], lived(experiment)[1]
    assert records(shuffled) == records(straight)


def test_a_failure_of_all_trials_is_a_failure() -> None:
    island, (first, ask) = begun(learning(budget=3, learner="random"))
    assert isinstance(ask, Ask)
    trials = island.handle(Asked(FIRST, 0, ((0.5,) * len(ask.start),) * 2))
    for each in (*trials, first):
        assert isinstance(each, Evaluate)
        reason = f"diverged in {each.trial}"
        commands = island.handle(
            EvaluationFailed(FIRST, reason, PROVENANCE, each.trial)
        )
    (row,) = rows(commands, "evaluations")
    assert (row["status"], row["reason"], row["fitness"]) == (
        "failed", "diverged in 0", None
    )  # fmt: skip
    (born,) = rows(commands, "births")
    assert born["robot"] is None


def test_answers_to_nothing_are_unexpected() -> None:
    island, (_, ask) = begun(learning(budget=3))
    assert isinstance(ask, Ask)
    point = ask.start
    for event in (
        Asked(FIRST, 1, (point,)),
        Asked(FIRST, 0, ()),
        Asked(FIRST, 0, (point,) * 3),
        Asked(FIRST, 0, (point[1:],)),
        Asked(BirthId(0, 1), 0, (point,)),
        EvaluationFailed(FIRST, "diverged", PROVENANCE, 1),
    ):
        with pytest.raises(UnexpectedEvent):
            island.handle(event)
    plain, _ = begun(PLAIN)
    with pytest.raises(UnexpectedEvent, match="it has no learners"):
        plain.handle(Asked(FIRST, 0, (point,)))


def test_a_learner_that_is_made_again_asks_for_the_same() -> None:
    """As after a restart, whatever the learner."""
    experiment = learning(budget=12, learner="(1+1)-es")
    island, waiting = begun(experiment)
    kept = Learners({0: experiment}, Origin(seed=1))
    asked = 0
    while waiting:
        each = waiting.pop(0)
        if isinstance(each, Ask):
            event: Answered = kept.answer(each)
            new = Learners({0: experiment}, Origin(seed=1)).answer(each)
            assert new == event
            asked += 1
        else:
            assert isinstance(each, Evaluate)
            event = judge(each)
        waiting += requests(island.handle(event))
    assert asked == 11


def test_nothing_to_learn_is_one_trial() -> None:
    experiment = replace(learning(what="weights"), brain=BrainSection(type="cpg"))
    _, commands = lived(experiment)
    counts = [
        sum(row["birth"] == number for row in rows(commands, "learning"))
        for number in range(14)
    ]
    # A single motor has no coupling.
    assert {*counts} == {1, 5}


MODULAR: dict[str, Any] = {
    "brain": BrainSection(type="modular"),
    "space": Space(max_hidden=60),
}
"""Brains of which all robots have the same parameters, sensors of touch aside."""


def by_birth(commands: list[IslandCommand]) -> dict[int, list[Any]]:
    """Return the trials of each birth."""
    found: dict[int, list[Any]] = {}
    for row in rows(commands, "learning"):
        found.setdefault(row["birth"], []).append(row)
    return found


def samples_of(trials: list[Any]) -> list[Any]:
    """Return the trials of brains of other robots."""
    return [row for row in trials if row["sample_birth"] is not None]


@pytest.mark.parametrize("brain", ["network", "modular"])
def test_a_child_tries_the_best_brains_of_its_parents_first(brain: str) -> None:
    rules = learning(inherit="samples", budget=5, learner="(1+1)-es")
    experiment = replace(rules, **(MODULAR if brain == "modular" else {}))
    _, commands = lived(experiment)
    trials, tried = by_birth(commands), 0
    best = {
        birth: max(own, key=lambda row: row["fitness"] or -1.0)["parameters"]
        for birth, own in trials.items()
    }
    for born in rows(commands, "births"):
        own = trials[born["birth"]]
        parents = [each["birth"] for each in born["parents"]]
        samples = samples_of(own)
        assert [row["trial"] for row in samples] == [*range(1, len(samples) + 1)]
        of = [row["sample_birth"] for row in samples]
        assert [row["request"] for row in own] == [0] * len(of) + [
            *([0, 0, 1, 2, 3][: 5 - len(of)])
        ]
        # Two parents may have the same brain, or the one that the child has.
        assert of == [each for each in parents if each in of]
        for row, parent in zip(samples, of, strict=True):
            common = {*row["parameters"]} & {*best[parent]}
            least = 0.05 if brain == "network" else 0.5
            assert len(common) > least * len(row["parameters"])
        tried += len(of)
    assert tried > 8
    assert not any(samples_of(trials[birth]) for birth in range(6))


def test_a_learner_begins_at_the_best_of_birth_and_samples() -> None:
    """By hand: of the trials 0 to 2, one of the two samples is the best."""
    island = Island(replace(learning(inherit="samples", budget=4), **MODULAR), 1, 0)
    learners = Learners({0: island.experiment}, Origin(seed=1))
    waiting, asked = deque(requests(island.handle(Started()))), list[Ask]()
    points: dict[int, tuple[float, ...]] = {}
    assert island._learning is not None
    read = island._learning.parameters.read
    while waiting:
        each = waiting.popleft()
        if isinstance(each, Breed):
            event: Any = bred(island, each)
        elif isinstance(each, Ask):
            event = learners.answer(each)
            if each.birth.number == 6:
                asked.append(each)
        else:
            fitness = {0: 0.2, 1: 0.5, 2: 0.3, 3: 0.4}[each.trial]
            if each.birth.number == 6:
                points[each.trial] = read(each.robot)
            found = Evaluation(fitness, 0.1, 0.0, 12.0)
            event = Evaluated(each.birth, found, PROVENANCE, each.trial)
        waiting += requests(island.handle(event))
    (ask,) = asked
    assert len({*points.values()}) == 4
    assert (ask.number, ask.most, ask.told) == (0, 1, ())
    assert ask.start == pytest.approx(points[1], abs=1e-12)


def test_peers_are_the_fittest_others_of_the_population() -> None:
    experiment = replace(learning(peers=2, learner="random"), **MODULAR)
    _, commands = lived(experiment)
    trials = by_birth(commands)
    fitness = {row["birth"]: row["fitness"] for row in rows(commands, "evaluations")}
    first = [row["birth"] for row in rows(commands, "population") if row["births"] == 6]
    # Where a trial has failed, another one counts: all founders have a fitness.
    ranked = sorted(first, key=lambda birth: (-fitness[birth], birth))
    for birth in range(6, 10):
        of = [row["sample_birth"] for row in samples_of(trials[birth])]
        assert of == ranked[:2]
    rules = learning(peers=1, inherit="samples", budget=6, learner="random")
    _, commands = lived(replace(rules, **MODULAR))
    for born in rows(commands, "births")[6:]:
        own = by_birth(commands)[born["birth"]]
        of = [row["sample_birth"] for row in samples_of(own)]
        parents = [each["birth"] for each in born["parents"]]
        assert of[:2] == parents
        assert len(of) == 3
        assert of[2] not in parents


def test_own_encodings_without_from_robot_inherit_nothing() -> None:
    patterns = EncodingSection(type="cppn")
    experiment = replace(learning(inherit="lamarckian"), encoding=patterns)
    with pytest.raises(ExperimentError, match="it has no method from_robot"):
        Island(experiment, 1, 0)


def test_wrong_parameters_are_refused_before_the_first_birth() -> None:
    experiment = learning(parameters={"population": 3})
    with pytest.raises(ExperimentError, match="must be a whole number >= 4"):
        Island(experiment, 1, 0)
