"""Infancy in an arena: trials of newborns, worked out by hand."""

from collections.abc import Callable
from itertools import count
from typing import Any

import pytest
from msgspec import structs

from coordinator.arena.arena import Arena
from coordinator.evolution.learners.brain_parameters import BrainParameters
from coordinator.islands.events import (
    Ask,
    Asked,
    Commanded,
    Order,
    Record,
    Remove,
    ReplaceBrain,
)
from coordinator.run.learners import Learners
from schema.errors import UnexpectedEvent
from schema.experiment.document import BrainSection, Experiment, Space
from schema.experiment.identity import Origin
from schema.experiment.learning import Learning
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.tables.columns import ROWS
from schema.wire.arena import AdvanceShard, BrainChange
from schema.wire.messages import Breed
from schema.wire.protobuf import decode_robot
from tests.coordinator.arena_world import (
    DT,
    ArenaRun,
    Fit,
    World,
    distinct_fitness,
    equal_fitness,
    experiment,
)
from tests.coordinator.breeding import reject_some

FIRST = BirthId(0, 14)
"""Founder that is inserted first, at step 0."""
LOW, HIGH = 0.25, 0.75


def learning(births: int = 3000, **keys: Any) -> Experiment:  # noqa: ANN401 - any key
    rules = Learning(**{"learner": "(1+1)-es", "budget": 3, **keys})
    return structs.replace(experiment(births), learning=rules)


def life(
    document: Experiment,
    fit: Fit = equal_fitness,
    diverges: Callable[[BirthId, int], bool] = lambda *_: False,
) -> ArenaRun:
    learners = Learners({0: document}, Origin(seed=1))
    return ArenaRun(
        Arena(document, 1, 0), World(fit, diverges), learner=learners.answer
    )


def one_by_one(ask: Ask) -> Asked:
    """Propose one trial: all parameters low, then all high."""
    share = HIGH if ask.number else LOW
    return Asked(ask.birth, ask.number, ((share,) * len(ask.start),))


def exchanged(run: ArenaRun, birth: BirthId) -> list[tuple[int, BrainChange]]:
    """Return the steps at which a robot got a brain, and the changes."""
    begins = [0, *(each.until for each in run.advances)]
    return [
        (begin, change)
        for begin, command in zip(begins, run.advances, strict=False)
        for change in command.changes.brains
        if change.birth == birth
    ]


def trials(run: ArenaRun, birth: BirthId) -> list[tuple[Any, ...]]:
    names = ("trial", "request", "fitness", "reason", "sim_time_s")
    return [
        tuple(row[name] for name in names)
        for row in run.rows("learning")
        if row["birth"] == birth.number
    ]


def order(run: ArenaRun, wanted: Order) -> None:
    """Send an order and carry it out at the next decision."""
    run.tell(Commanded(0, f"{len(run.events)}", run.arena.next_step, wanted))
    run.turn()


def test_an_infancy_of_three_trials_by_hand() -> None:
    """Trials end after 15, 27 and 39 s; the second is the best; mature at 51 s."""

    def fit(birth: BirthId, step: int) -> float:
        known = {3000: 0.2, 5400: 0.5, 7800: 0.3}
        return known.get(step, 0.1) if birth == FIRST else 0.1

    document = learning()
    run = life(document, fit)
    run.learner = one_by_one
    run.live(51)
    asks = [one for one in run.commands if isinstance(one, Ask) and one.birth == FIRST]
    start = asks[0].start
    low = (LOW,) * len(start)
    assert [(one.number, one.most, one.told) for one in asks] == [
        (0, 2, ()),
        (1, 1, (((start, low), (0.2, 0.5)),)),
    ]
    changes = exchanged(run, FIRST)
    assert [step for step, _ in changes] == [3000, 5400, 7800]
    assert all(change.restarts_window for _, change in changes)
    assert document.learning is not None
    read = BrainParameters(document.learning, document.brain, document.space).read
    parts = decode_robot(
        next(row["robot"] for row in run.rows("learning") if row["robot"])
    ).parts
    shares = [read(Robot(parts, change.brain)) for _, change in changes]
    assert [max(each) for each in shares] == pytest.approx([LOW, HIGH, LOW])
    assert [min(each) for each in shares] == pytest.approx([LOW, HIGH, LOW])
    assert trials(run, FIRST) == [
        (0, 0, 0.2, "", 15.0),
        (1, 0, 0.5, "", 27.0),
        (2, 1, 0.3, "", 39.0),
    ]
    rows = [row for row in run.rows("learning") if row["birth"] == FIRST.number]
    assert all(list(row) == ROWS["learning"].names for row in rows)
    assert [row["robot"] is None for row in rows] == [True, False, True]
    assert decode_robot(rows[1]["robot"]).brain == changes[2][1].brain
    samples = {
        row["sim_time_s"]: row["is_mature"]
        for row in run.rows("fitness")
        if row["birth"] == FIRST.number
    }
    assert not any(samples[time_s] for time_s in (15.0, 40.0, 50.0))
    assert [one.birth for one in run.arena.judged] == [FIRST]


def test_infants_neither_mate_nor_die_by_selection() -> None:
    """The founder of second k is mature at 51 + k s; the first child is due at 60 s."""
    run = life(learning(), lambda birth, _: birth.number / 100.0)
    run.live(59.9)
    assert len(run.rows("births")) == 15
    assert run.rows("deaths") == []
    vets = sum(isinstance(one, Breed) for one in run.commands)
    run.live(60.1)
    assert sum(isinstance(one, Breed) for one in run.commands) == vets + 1
    # Ten founders are mature, 14 to 5, whose mean is 9.5: 5 and 6 are below 6.65.
    assert [row["birth"] for row in run.rows("deaths")] == [5, 6]


def test_time_stands_still_while_a_learner_is_asked() -> None:
    run = life(learning())
    while not any(isinstance(one, Ask) for one in run.waiting):
        run.turn() if run.events else run.live(-1.0)
    assert not run.advances
    assert isinstance(run.turn()[-1], AdvanceShard)
    assert run.tell(run.events[-1]) == []  # a duplicate
    with pytest.raises(UnexpectedEvent, match="no such robot has been born"):
        run.arena.handle(Asked(BirthId(0, 99), 0, ()))
    with pytest.raises(UnexpectedEvent, match="0 requests that are done"):
        run.arena.handle(Asked(FIRST, 1, ()))
    with pytest.raises(UnexpectedEvent, match="it has no learners"):
        life(experiment()).live(1).arena.handle(Asked(FIRST, 0, ()))


def test_a_batch_of_trials_is_tried_one_by_one() -> None:
    """CMA-ES proposes all four further trials at once."""
    run = life(learning(learner="cma-es", budget=5), distinct_fitness).live(80)
    asks = [one for one in run.commands if isinstance(one, Ask) and one.birth == FIRST]
    assert [one.most for one in asks] == [4]
    assert [step for step, _ in exchanged(run, FIRST)] == [
        3000, 5400, 7800, 10200, 12600,
    ]  # fmt: skip
    found = trials(run, FIRST)
    assert [each[:2] for each in found] == [(trial, 0) for trial in range(5)]
    assert [each[2] for each in found] == [
        distinct_fitness(FIRST, step) for step in (3000, 5400, 7800, 10200, 12600)
    ]


def test_an_infant_tries_the_brain_of_the_fittest_mature_robot() -> None:
    """The first child is born at 60 s, when founder 14 is the fittest mature one."""
    document = structs.replace(
        learning(peers=1, budget=3),
        brain=BrainSection(type="modular"),
        space=Space(max_hidden=60),
    )
    run = life(document, lambda birth, _: birth.number / 100.0)
    run.live(100)
    child = BirthId(0, 15)
    born = next(row for row in run.rows("births") if row["birth"] == child.number)
    rows = [row for row in run.rows("learning") if row["birth"] == child.number]
    start_s = born["sim_time_s"]
    assert [(row["trial"], row["request"], row["sim_time_s"]) for row in rows] == [
        (0, 0, start_s + 15.0), (1, 0, start_s + 27.0), (2, 0, start_s + 39.0)
    ]  # fmt: skip
    assert [row["sample_birth"] for row in rows] == [None, 14, None]
    assert [row["sample_island"] for row in rows] == [None, 0, None]
    (ask,) = (
        one for one in run.commands if isinstance(one, Ask) and one.birth == child
    )
    # Of equal fitness, the first trial is the best.
    assert (ask.most, ask.told) == (1, ())
    assert ask.start == tuple(rows[0]["parameters"])
    assert ask.start != tuple(rows[1]["parameters"])


def test_an_infant_that_diverges_has_a_failed_trial() -> None:
    def diverges(birth: BirthId, step: int) -> bool:
        return birth == FIRST and step > 5000

    run = life(learning(), diverges=diverges).live(40)
    reason = "diverged: qacc"
    assert trials(run, FIRST) == [(0, 0, 0.1, "", 15.0), (1, 0, None, reason, 25.995)]
    (death,) = run.rows("deaths")
    assert (death["birth"], death["reason"]) == (FIRST.number, "diverged")
    assert all(row["robot"] is None for row in run.rows("learning")[:2])


def test_orders_end_an_infancy() -> None:
    run = life(learning()).live(19)
    order(run, Remove(FIRST))
    assert trials(run, FIRST)[1:] == [(1, 0, None, "removed", 20.0)]
    other = BirthId(0, 13)
    order(run, ReplaceBrain(other, Brain()))
    assert run.arena.step == 4200
    assert len(trials(run, other)) == 0  # the brain does not fit the body
    living = next(one for one in run.arena.population if one.birth == other)
    brain = run.arena.encoding.robot_of(living.genome).brain
    order(run, ReplaceBrain(other, brain))
    ((_, last),) = exchanged(run, other)[-1:]
    assert (last.brain, last.restarts_window) == (brain, True)
    assert trials(run, other)[-1][3] == "brain replaced"
    at_s = trials(run, other)[-1][4]
    assert run.live(at_s + 11.0).arena.judged == ()
    run.live(at_s + 12.0)
    assert [one.birth for one in run.arena.judged] == [other]


@pytest.mark.parametrize("inherit", ["darwinian", "lamarckian"])
def test_what_is_learnt_is_inherited_or_kept(inherit: str) -> None:
    document = learning(inherit=inherit)
    run = life(document, lambda _, step: step * 1e-5).live(45)
    births = {row["birth"]: row for row in run.rows("births")}
    grown = next(one for one in run.arena.population if one.birth == FIRST)
    rows = [row for row in run.rows("learning") if row["birth"] == FIRST.number]
    adult = decode_robot(rows[-1]["robot"])
    developed: Robot = run.arena.encoding.robot_of(grown.genome)
    if inherit == "darwinian":
        assert grown.genome == births[FIRST.number]["genome"]
        assert grown.learnt == adult
        assert developed.brain != adult.brain
    else:
        assert grown.learnt is None
        assert developed.brain.connections == adult.brain.connections


def test_a_run_that_ends_has_rows_of_its_infants() -> None:
    run = life(learning(16)).live()
    assert run.is_done
    ended = run.arena.step * DT
    born = {row["birth"]: row["sim_time_s"] for row in run.rows("births")}
    assert born[15] == 60.0
    assert ended == 75.0
    assert trials(run, BirthId(0, 15)) == [(0, 0, 0.1, "", 75.0)]
    assert len(run.rows("learning")) == 15 * 3 + 1
    assert run.tell(Asked(BirthId(0, 15), 0, ())) == []


def test_a_budget_of_one_is_no_learning() -> None:
    plain, run = life(experiment(20)).live(), life(learning(20, budget=1)).live()
    assert run.commands == plain.commands


def test_a_brain_without_parameters_has_no_infancy() -> None:
    document = learning(what="weights")
    unconnected = structs.replace(document.generation, p_connect_neurons=0.0)
    run = life(structs.replace(document, generation=unconnected)).live(15)
    assert not any(isinstance(one, Ask) for one in run.commands)
    assert [one.birth for one in run.arena.judged] == [FIRST]


def test_the_order_of_answers_changes_no_row() -> None:
    runs = []
    for step in (0, 1, 3):
        document = learning(24)
        run = life(document, distinct_fitness)
        run.verdict, run.order = reject_some, count(0, step)
        runs.append(run.live())
    rows = [
        [one for one in run.commands if isinstance(one, Record | AdvanceShard)]
        for run in runs
    ]
    assert rows[0] == rows[1] == rows[2]
    again = Arena(document, 1, 0)
    found = [one for event in runs[0].events for one in again.handle(event)]
    assert found == runs[0].commands
    assert len(runs[0].rows("learning")) > 24
