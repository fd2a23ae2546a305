"""Rules of the ecosystem, worked out by hand."""

from typing import Any

import numpy as np
import pytest

from coordinator.arena.ecosystem import Ecosystem, EcosystemRules
from schema.plugins.arena_rules import ArenaView, Decisions, Meeting, Resident
from schema.robot.ids import BirthId
from tests.coordinator.arena_views import born, resident, view
from tests.coordinator.arena_world import experiment

RNG = np.random.default_rng(1)
A, B = born(0, 1)
IN, OUT = (0.0, 0.0), (9.0, 9.0)
HALF = (IN, IN, OUT, OUT)


def rules(**parameters: Any) -> EcosystemRules:  # noqa: ANN401 - of any key
    """Return rules with one patch at the origin, and no losses but those given."""
    free = {"energy_per_s": 0.0, "energy_per_j": 0.0, "lifespan_s": 0.0}
    one = {"patches": 1, "patch_spread_m": 0.0, "patch_radius_m": 0.5}
    made = EcosystemRules(experiment(), Ecosystem(**(free | one | parameters)))
    # At its first decision the patches are placed.
    made.decide(view(time_s=99.0), RNG)
    return made


def robot(number: int = 0, energy: float = 10.0, **more: Any) -> Resident:  # noqa: ANN401
    rests = more.pop("rests_until_s", 0.0)
    more.setdefault("place", OUT)
    return resident(number, {"energy": energy, "rests_until_s": rests}, **more)


def decide(made: EcosystemRules, seen: ArenaView) -> tuple[Decisions, list[float]]:
    """Return the decisions, and the energy of each robot that lives on."""
    decisions = made.decide(seen, RNG)
    return decisions, [each["energy"] for each in decisions.stores.values()]


@pytest.mark.parametrize(
    ("robots", "energy", "left"),
    [
        pytest.param([robot(place=IN)], [10.5], 1.5, id="one takes its most"),
        pytest.param([robot()], [10.0], 2.0, id="none is in the patch"),
        pytest.param([robot(track=HALF)], [10.25], 1.75, id="half of the time"),
        pytest.param(
            [robot(number, place=IN) for number in range(8)],
            [10.25] * 8,
            0.0,
            id="too little is shared",
        ),
        pytest.param(
            [robot(0, place=IN), *(robot(n, track=HALF) for n in range(1, 9))],
            [10.4, *[10.2] * 8],
            0.0,
            id="shared in proportion to time",
        ),
        pytest.param([robot(track=())], [10.0], 2.0, id="newborn without a track"),
    ],
)
def test_energy_that_robots_take_from_a_patch(
    robots: list[Resident], energy: list[float], left: float
) -> None:
    made = rules(patch_capacity=2.0, patch_inflow=0.5, intake_per_s=0.5)
    decisions, found = decide(made, view(*robots))
    assert found == pytest.approx(energy)
    assert decisions.patches[0].content == pytest.approx(left)


def test_patch_grows_with_time_up_to_its_capacity() -> None:
    made = rules(patch_capacity=2.0, patch_inflow=0.25, intake_per_s=1.5)
    contents = []
    for place, interval_s in ((IN, 1.0), (OUT, 1.0), (OUT, 4.0), (OUT, 4.0)):
        seen = view(robot(place=place), interval_s=interval_s)
        contents.append(decide(made, seen)[0].patches[0].content)
    assert contents == pytest.approx([0.5, 0.75, 1.75, 2.0])


def test_losses_by_life_and_work_and_deaths_by_energy_and_age() -> None:
    made = rules(energy_per_s=0.25, energy_per_j=2.0, lifespan_s=50.0)
    robots = (
        robot(0, 10.0, age_s=10.0, work_j=0.5),
        robot(1, 1.5, age_s=10.0, work_j=0.5),
        robot(2, 1.0, age_s=49.0),
        robot(3, 1.0, age_s=50.0),
        robot(4, 0.5, age_s=50.0),
    )
    decisions, energy = decide(made, view(*robots, interval_s=2.0))
    assert energy == pytest.approx([8.5, 0.5])
    died = [(death.birth.number, death.reason) for death in decisions.deaths]
    assert died == [(1, "no energy"), (3, "age"), (4, "no energy")]


def met(duration_s: float = 1.0, pair: tuple[BirthId, ...] = (A, B)) -> Any:  # noqa: ANN401
    return (Meeting(pair[0], pair[1], duration_s, 0.1),)


def pair_of(**more: Any) -> list[Resident]:  # noqa: ANN401
    return [robot(0, place=(3.0, 1.0), **more), robot(1, place=(4.0, 1.0), **more)]


def test_robots_mate_after_their_time_together_only_and_pay_at_once() -> None:
    made = rules(mating_s=2.0, child_energy=8.0, mating_cost=1.0, rest_s=20.0)
    decisions, energy = decide(made, view(*pair_of(), meetings=met()))
    assert (decisions.births, energy) == ((), [10.0, 10.0])
    decisions, energy = decide(made, view(*pair_of(), time_s=101.0, meetings=met()))
    (child,) = decisions.births
    assert (child.parents, child.near) == ((A, B), (3.5, 1.0))
    assert child.stores == {"energy": 8.0}
    assert energy == [5.0, 5.0]
    assert {s["rests_until_s"] for s in decisions.stores.values()} == {121.0}


def test_time_together_begins_anew_after_a_pause() -> None:
    made = rules(mating_s=2.0, child_energy=8.0)
    for meetings, births in ((met(), 0), ((), 0), (met(), 0), (met(), 1)):
        seen = view(*pair_of(), meetings=meetings, children=())
        assert len(decide(made, seen)[0].births) == births


@pytest.mark.parametrize(
    ("more", "births"),
    [
        ({}, 1),
        ({"rests_until_s": 100.0}, 1),
        ({"rests_until_s": 100.5}, 0),
        ({"age_s": 15.0}, 1),
        ({"age_s": 14.9}, 0),
        ({"energy": 5.0}, 0),
        ({"energy": 5.1}, 1),
    ],
)
def test_who_may_mate(more: dict[str, float], births: int) -> None:
    made = rules(mating_s=1.0, child_energy=8.0, mating_cost=1.0, maturity_s=15.0)
    decisions, _ = decide(made, view(*pair_of(**more), meetings=met()))
    assert len(decisions.births) == births


def test_each_mates_once_at_a_decision_those_who_met_longest_first() -> None:
    made = rules(mating_s=1.0)
    a, b, c = born(0, 1, 2)
    meetings = (*met(1.0, (a, b)), *met(1.5, (b, c)))
    seen = view(*(robot(number) for number in range(3)), meetings=meetings)
    assert [one.parents for one in decide(made, seen)[0].births] == [(b, c)]


@pytest.mark.parametrize(
    ("child", "energy"), [(None, [9.0, 9.0]), (BirthId(0, 9), [5.0, 5.0])]
)
def test_energy_of_a_child_that_was_not_born_is_given_back(
    child: BirthId | None, energy: list[float]
) -> None:
    made = rules(mating_s=1.0, child_energy=8.0, mating_cost=1.0)
    decide(made, view(*pair_of(), meetings=met()))
    poor = pair_of(energy=5.0)
    assert decide(made, view(*poor, children=(child,)))[1] == energy


def test_gain_of_mating_comes_from_nowhere() -> None:
    made = rules(mating_s=1.0, child_energy=8.0, mating_cost=1.0, mating_gain=3.0)
    assert decide(made, view(*pair_of(), meetings=met()))[1] == [8.0, 8.0]


def test_patches_circle_by_schedule() -> None:
    made = rules(
        patches=2, patch_spread_m=2.0, patch_motion="circling", patch_period_s=400.0
    )
    at = {}
    for time_s in (100.0, 200.0):
        patches = decide(made, view(time_s=time_s))[0].patches
        at[time_s] = [value for patch in patches for value in (patch.x, patch.y)]
    assert at[100.0] == pytest.approx([0.0, 2.0, 0.0, -2.0])
    assert at[200.0] == pytest.approx([-2.0, 0.0, 2.0, 0.0])


def test_empty_patches_regrow_elsewhere() -> None:
    made = rules(
        patch_motion="regrowing", patch_spread_m=3.0, patch_capacity=2.0,
        intake_per_s=1.5, patch_inflow=0.0,
    )  # fmt: skip
    (old,) = made._patches
    for content, has_moved in ((0.5, False), (0.0, True)):
        feeding = robot(place=(old.x, old.y))
        (patch,) = decide(made, view(feeding))[0].patches
        assert patch.content == content
        assert ((patch.x, patch.y) != (old.x, old.y)) == has_moved
        assert np.hypot(patch.x, patch.y) <= 3.0
