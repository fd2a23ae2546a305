"""Loading of rules of arenas, and refusals of what cannot be decided."""

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.arena.kinds import check_rules
from coordinator.arena.rules import BUILT_IN, CheckedRules, ThesisRules, load_rules
from schema.errors import ExperimentError, one_line
from schema.plugins.arena_rules import (
    ArenaView,
    Conception,
    Death,
    Decisions,
    Patch,
)
from schema.robot.ids import BirthId
from schema.wire.messages import Breed
from tests.coordinator.arena_views import born, resident, view
from tests.coordinator.arena_world import ArenaRun, World, experiment
from tests.coordinator.breeding import WhyNot, viable

A, B, GONE = born(0, 1, 7)
NAN = float("nan")
FOUNDERS = experiment().selection.population


class Scripted:
    """Rules that decide what a test says."""

    answer: Any = Decisions()
    stores = {"food": 1.0}  # noqa: RUF012 - read only
    meeting_distance_m: Any = None

    def __init__(self, *_given: object) -> None:
        self.seen: list[ArenaView] = []

    def decide(self, seen: ArenaView, rng: np.random.Generator) -> Any:  # noqa: ANN401
        self.seen.append(seen)
        return self.answer(seen, rng) if callable(self.answer) else self.answer


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> type[Scripted]:
    """Return a new class of rules, ``scripted``."""
    made = type("Made", (Scripted,), {"__module__": __name__})
    monkeypatch.setitem(BUILT_IN, "scripted", made)
    return made


def decide(rules: CheckedRules) -> Decisions:
    two = [resident(number, {"food": 1.0}) for number in range(2)]
    return rules.decide(view(*two), np.random.default_rng(1))


@pytest.mark.parametrize(
    ("arena", "line"),
    [
        ({"rules": "ecosistem"}, "got 'ecosistem'; did you mean 'ecosystem'?"),
        ({"parameters": {"x": 1}}, "arena.parameters.x: no such key; allowed: none"),
        (
            {"rules": "ecosystem", "parameters": {"patchs": 1}},
            "arena.parameters.patchs: no such key; did you mean 'patches'",
        ),
        (
            {"rules": "ecosystem", "parameters": {"patch_motion": "circlin"}},
            "got 'circlin'; did you mean 'circling'",
        ),
        (
            {"rules": "ecosystem", "parameters": {"rest_s": -1}},
            "arena.parameters.rest_s: must be a number >= 0.0, got -1",
        ),
        (
            {"rules": "ecosystem", "parameters": {"mating_s": NAN}},
            "arena.parameters.mating_s: must be finite, got nan",
        ),
    ],
)
def test_each_mistake_in_settings_is_one_line(arena: dict[str, Any], line: str) -> None:
    with pytest.raises(ExperimentError) as caught:
        load_rules(experiment(**arena))
    assert line in one_line(caught.value)


def mother(*parents: Any, **more: Any) -> Decisions:  # noqa: ANN401 - faults, too
    return Decisions(births=(Conception(parents, **more),))


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        (None, "must return Decisions, got None"),
        (Decisions(births=3), "Expected `array`, got `int`"),  # type: ignore[arg-type]
        (mother(A, B, GONE), "of length <= 2"),
        (mother(A, A), "must name different parents, got"),
        (mother(A, GONE), "must name living robots, got"),
        (mother(3), "Expected `array`, got `int`"),
        (mother(A, radius_m=-1.0), ">= 0"),
        (mother(A, near=(NAN, 0.0)), "stores and patches must be finite"),
        (mother(A, stores={"water": 1.0}), "must be of ['food'], got"),
        (mother(A, stores={"food": "much"}), "Expected `float`, got `str`"),
        (Decisions(deaths=(Death(GONE, "x"),)), "must name living robots, got"),
        (Decisions(deaths=(Death(A, "x"),) * 2), "each robot that dies once, got"),
        (Decisions(deaths=(Death(A, "x" * 41),)), "of length <= 40"),
        (Decisions(deaths=(Death(A, ""),)), "of length >= 1"),
        (Decisions(stores={A: {"water": 1.0}}), "must be of ['food'], got"),
        (Decisions(stores={A: {"food": NAN}}), "stores and patches must be finite"),
        (Decisions(stores={GONE: {"food": 1.0}}), "must name living robots, got"),
        (Decisions(patches=(Patch(0.0, 0.0, -1.0, 0.0),)), ">= 0"),
        (Decisions(patches=(Patch(0.0, NAN, 1.0, 0.0),)), "must be finite"),
        (mother(A, radius_m=float("inf")), "must be finite"),
        (lambda *_: 1 / 0, "raised ZeroDivisionError: division by zero (test_rules.py"),
    ],
)
def test_each_impossible_decision_is_one_line_with_the_place_of_the_class(
    scripted: type[Scripted], answer: object, line: str
) -> None:
    scripted.answer = staticmethod(answer) if callable(answer) else answer
    rules = CheckedRules(experiment(rules="scripted"))
    with pytest.raises(ExperimentError) as caught:
        decide(rules)
    told = one_line(caught.value)
    assert line in told
    assert "\n" not in told
    assert told.startswith("arena.rules: ")
    assert "test_rules.py" in told


@pytest.mark.parametrize(
    ("attribute", "value"),
    [("stores", {"food": "much"}), ("stores", 3), ("meeting_distance_m", "near")],
)
def test_attributes_of_another_type_are_refused(
    scripted: type[Scripted], attribute: str, value: object
) -> None:
    setattr(scripted, attribute, value)
    with pytest.raises(ExperimentError, match=f"{attribute}: must have the types"):
        CheckedRules(experiment(rules="scripted"))


def test_numbers_of_numpy_are_numbers(scripted: type[Scripted]) -> None:
    stores: Any = {A: {"food": np.float32(0.5)}}
    near: Any = (np.float64(1.0), np.float32(2.0))
    scripted.answer = Decisions((Conception((A,), near),), stores=stores)
    decided = decide(CheckedRules(experiment(rules="scripted")))
    assert decided == Decisions(
        (Conception((A,), (1.0, 2.0)),), stores={A: {"food": 0.5}}
    )


def test_rules_that_count_for_all_arenas_together_are_found(
    scripted: type[Scripted],
) -> None:
    """The check decides for two arenas alone, then in turns."""
    count: list[int] = []

    def limit(seen: ArenaView, _rng: object) -> Decisions:
        count.append(1)
        old = [robot.birth for robot in seen.robots][: len(count) % 3 == 0]
        return Decisions(deaths=tuple(Death(birth, "x") for birth in old))

    scripted.answer = staticmethod(limit)
    with pytest.raises(ExperimentError, match="as if there were no other"):
        check_rules(experiment(rules="scripted"))


@pytest.mark.parametrize("rules", ["thesis", "ecosystem"])
def test_rules_that_are_built_in_keep_their_contract(rules: str) -> None:
    check_rules(experiment(rules=rules))


# --- decisions of the arena ------------------------------------------------------


def twins_at(second: float, *parents: tuple[int, ...]) -> Any:  # noqa: ANN401
    """Return an answer that has children at one time only."""

    def answer(seen: ArenaView, _rng: object) -> Decisions:
        children = tuple(Conception(born(*each), (0.3, 0.0)) for each in parents)
        return Decisions(children if seen.time_s == second else ())

    return staticmethod(answer)


def lived(
    verdict: WhyNot = viable,
    births: int = 40,
    world: World | None = None,
    parents: str = "tournament",
    **arena: Any,  # noqa: ANN401
) -> ArenaRun:
    given = experiment(births, **{"rules": "scripted", **arena})
    given = replace(given, selection=replace(given.selection, parents=parents))
    return ArenaRun(Arena(given, 1, 0), world or World(), verdict).live(62)


def outcomes(run: ArenaRun) -> list[tuple[list[int], int | None, str]]:
    return [
        ([one["birth"] for one in row["parents"]], row["birth"], row["outcome"])
        for row in run.rows("matings")
    ]


def test_children_of_one_decision_are_bred_one_after_the_other(
    scripted: type[Scripted],
) -> None:
    scripted.answer = twins_at(30.0, (0, 1), (2,))
    run = lived()
    assert outcomes(run) == [([0, 1], 15, "born"), ([2], 16, "born")]
    vets = [one.birth.number for one in run.commands if isinstance(one, Breed)]
    assert vets == list(range(17))
    rows = run.rows("births")[-2:]
    assert [row["sim_time_s"] for row in rows] == [30.0, 30.0]
    seen = {one.time_s: one for one in run.arena._rules.rules.memory.seen}  # type: ignore[attr-defined]
    assert seen[45.0].born == born(15, 16)
    assert [one.birth.number for one in seen[45.0].robots] == list(range(17))


def test_child_that_no_body_is_viable_for_leaves_no_gap(
    scripted: type[Scripted],
) -> None:
    scripted.answer = twins_at(30.0, (0, 1), (2, 3), (4,))
    attempts = experiment().selection.max_mating_attempts

    def refuse_first(birth: BirthId, attempt: int) -> str:
        return "no" if birth.number == 15 and attempt < attempts else ""

    assert outcomes(lived(refuse_first)) == [
        ([0, 1], None, "not viable"),
        ([2, 3], 15, "born"),
        ([4], 16, "born"),
    ]


@pytest.mark.parametrize(
    ("births", "limit"), [(40, 16), (16, 30)], ids=["limit", "last birth"]
)
def test_children_beyond_the_room_are_not_born(
    scripted: type[Scripted], births: int, limit: int
) -> None:
    scripted.answer = twins_at(30.0, (0, 1), (2, 3))
    run = lived(births=births, population_limit=limit)
    assert outcomes(run) == [([0, 1], 15, "born"), ([2, 3], None, "no room")]


def test_children_are_born_near_the_wished_place(scripted: type[Scripted]) -> None:
    wish = Conception((A,), (2.0, 1.0), 0.25, {"food": 4.0})
    scripted.answer = staticmethod(
        lambda seen, _rng: Decisions((wish,) if seen.time_s == 30.0 else ())
    )
    run = lived()
    x, y = (run.rows("births")[-1][axis] for axis in "xy")
    assert np.hypot(x - 2.0, y - 1.0) <= 0.25
    child = run.arena.living.get(born(15)[0])
    assert child
    assert child.stores == {"food": 4.0}


def flood(seen: ArenaView, _rng: object) -> Decisions:
    return Decisions(deaths=tuple(Death(one.birth, "flood") for one in seen.robots))


@pytest.mark.parametrize("parents", ["tournament", "none"])
def test_rules_that_bear_no_robot_end_an_empty_arena(
    scripted: type[Scripted], parents: str
) -> None:
    scripted.answer = staticmethod(flood)
    run = lived(parents=parents)
    assert {row["reason"] for row in run.rows("deaths")} == {"flood"}
    assert run.is_done
    assert run.arena.is_extinct
    assert run.arena.births == FOUNDERS


def test_an_arena_that_all_robots_left_goes_on_if_random_ones_are_born() -> None:
    """The thesis's rules need no parents where none are selected."""
    world = World(diverges=lambda birth, _: birth.number < FOUNDERS)
    run = lived(births=FOUNDERS + 2, world=world, parents="none", rules="thesis")
    assert [row["reason"] for row in run.rows("deaths")] == ["diverged"] * FOUNDERS
    children = run.rows("births")[FOUNDERS:]
    assert [row["sim_time_s"] for row in children] == [15.0, 30.0]
    assert not any(row["parents"] for row in children)
    assert run.is_done
    assert not run.arena.is_extinct


def test_thesis_rules_need_enough_mature_and_room() -> None:
    arena = experiment()
    rules, rng = ThesisRules(arena, None), np.random.default_rng(1)
    needed = arena.selection.parents_needed
    mature = [resident(number, {}, fitness=0.1) for number in range(needed)]
    young = resident(needed, {})
    for robots, room, births in (
        ([*mature, young], 1, 1),
        ([*mature, young], 0, 0),
        ([*mature[1:], young], 1, 0),
    ):
        assert len(rules.decide(view(*robots, room=room), rng).births) == births
    assert rules.decide(view(*mature[1:]), rng).is_extinct
    assert not rules.decide(view(*mature, is_due=False), rng).births
