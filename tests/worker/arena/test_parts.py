"""An arena in parts is equal to the arena as a whole, to the last bit."""

from collections.abc import Sequence
from pathlib import Path
from random import Random

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from schema.errors import MalformedMessage, UnexpectedEvent
from schema.experiment.document import Fitness, Measures, Space
from schema.experiment.environment import Environment
from schema.experiment.settings import split_problems
from schema.plugins.permission import allow
from schema.robot.groups import Group
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Trace, needs
from schema.wire.arena import BrainChange, Changes
from schema.wire.arena_state import states_of
from tests.worker.arena.test_changing_world import change, changing
from tests.worker.arena_cases import SETTINGS, crowd, placed, populated, settings_of
from tests.worker.arena_parts import Home, Outcome, Parts, Run
from tests.worker.conftest import random_robot
from worker.arena.world import World

CLOCK = replace(
    SETTINGS.simulation,
    window_steps=400,
    warmup_steps=0,
    sensor_noise=0.05,
    actuator_noise=0.05,
)
FRICTION = change("simulation.friction", 1.0, 0.3, 0.8)
ENERGY = Measures(names=("energy",))
STILL, FAST, DEADLY, SPIN, UP = (
    (),
    (2.0, 1.0, 1.0),
    (-15.0, 0.0, 15.0),
    (0.0, 0.0, 0.0, 30.0, 0.0, 0.0),
    (0.0, 0.0, 15.0),
)
VELOCITIES = (STILL, STILL, STILL, FAST, DEADLY, SPIN, (0.0, float("nan")))
A, B, C = (BirthId(0, number) for number in range(3))
CROWDING = f"{__name__}:crowding"


def whole(world: World, changes: Changes, until: int) -> Outcome:
    """Return what happens in an arena that is advanced at once."""
    world.apply(changes)
    births = {*world.births, *(each.birth for each in changes.insertions)}
    outcome = Outcome()
    outcome.add([Run(world, frozenset(births), world.advance(until, work_j={}))], 0.04)
    outcome.digest = world.digest()
    return outcome


def homes(random: Random, count: int) -> Home:
    """Return a function that gives each cluster to a part, always to the same."""
    known: dict[Group, int] = {}
    return lambda cluster: known.setdefault(cluster, random.randrange(count))


def throw(worlds: Sequence[World], birth: BirthId, velocity: Sequence[float]) -> None:
    """Set the velocity of a core, in the world that holds it."""
    for world in worlds:
        if birth in world.births:
            world.population.find(birth).view.qvel[: len(velocity)] = velocity


@settings(max_examples=8, deadline=None, phases=[Phase.generate])
@given(
    random=st.randoms(use_true_random=False),
    radius_m=st.floats(0.3, 1.5),
    drop_m=st.floats(0.0, 0.4),
)
def test_parts_are_equal_to_the_whole(
    random: Random, radius_m: float, drop_m: float
) -> None:
    """Crowds, throws, births, deaths and divergence, while clusters change parts.

    Robots are put into parts at random, so that many are advanced again together;
    exchanges end at any step.
    """
    wall = {"wall_diameter_m": random.choice((0.0, 4.0))}
    arena = settings_of(drop_m=drop_m, record_touches=True, **wall).arena
    ground = Environment(slope_deg=random.choice((0.0, 10.0)))
    own = replace(
        changing(FRICTION, environment=ground),
        simulation=CLOCK,
        measures=ENERGY,
        arena=arena,
    )
    spares = [*crowd(random_robot, 12, radius_m, seed=random.randrange(99))]
    world, parts = World(own), Parts(own, 3)
    for _ in range(4):
        gone = tuple(birth for birth in world.births if random.random() < 0.1)
        born = [spares.pop() for _ in range(min(len(spares), random.randrange(7)))]
        kept = [birth for birth in world.births if birth not in gone]
        brains = [world.population.find(birth).robot.brain for birth in kept[:1]]
        for birth in kept:
            throw([world, *parts.worlds], birth, random.choice(VELOCITIES))
        changes = Changes(gone, tuple(born), tuple(map(BrainChange, kept, brains)))
        end = world.step + 25 * random.randrange(1, 16)
        stops = random.sample(range(world.step + 1, end), random.randrange(3))
        stops = [*sorted(stops), end]
        expected = whole(world, changes, end)
        assert parts.advance(changes, stops, homes(random, 3)) == expected
    assert parts.state() == world.state()


@pytest.mark.parametrize("touch_at", [0, 1])
def test_births_check_for_merges_in_all_parts(turtle: Robot, touch_at: int) -> None:
    """Two robots are brought together just before another one is born far away.

    They merge at once, not at the next regular check, whether one part holds them or
    two.
    """
    newborns = placed(turtle, (0.0, 0.0), (1.0, 0.0), (20.0, 0.0))
    home = {(A,): 0, (B,): touch_at, (A, B): 0, (C,): 1}.__getitem__
    world, parts = World(SETTINGS), Parts(SETTINGS, 2)
    start = Changes(insertions=newborns[:2])
    assert parts.advance(start, [25], home) == whole(world, start, 25)
    for each in (world, *parts.worlds):
        if B in each.births:
            each.population.find(B).view.qpos[0] = 0.3
    late = Changes(insertions=newborns[2:])
    outcome = parts.advance(late, [26], home)
    assert parts.state().clusters == ((A, B), (C,))
    assert outcome == whole(world, late, 26)
    assert parts.repeats == touch_at


@pytest.mark.parametrize(
    ("thrown", "mate", "distant", "lost"),
    [
        (DEADLY, STILL, STILL, True),
        (DEADLY, STILL, SPIN, True),
        (STILL, STILL, SPIN, False),
        (FAST, SPIN, DEADLY, False),
    ],
)
def test_a_robot_diverges_whatever_others_do(
    turtle: Robot,
    thrown: Sequence[float],
    mate: Sequence[float],
    distant: Sequence[float],
    lost: bool,  # noqa: FBT001 - a case
) -> None:
    """Its core has 21 m/s, no component more than 20."""
    world = populated(SETTINGS, placed(turtle, (0.0, 0.0), (0.26, 0.0), (80.0, 80.0)))
    world.advance(200)
    assert world.state().clusters == ((A, B), (C,))
    for birth, velocity in ((A, thrown), (B, mate), (C, distant)):
        throw([world], birth, velocity)
    assert (A in [each.birth for each in world.advance(210).casualties]) is lost


def test_a_warning_is_read_at_the_check_for_splits(turtle: Robot) -> None:
    """Not because a distant robot is fast; earlier beside a fast robot."""
    world = populated(SETTINGS, placed(turtle, (0.0, 0.0), (0.26, 0.0), (80.0, 80.0)))
    world.advance(200)
    for step, fast, velocity, lost in ((300, C, SPIN, 0), (350, A, UP, 2)):
        world.population.cluster_of[A].data.warning.number[1] = 1
        throw([world], fast, velocity)
        assert len(world.advance(step).casualties) == lost


def test_swept_boxes_hold_robots_on_their_way(turtle: Robot) -> None:
    """Of the last advance alone, also of a robot that is lost in it.

    Without a check for merges it is a point.
    """
    world = populated(settings_of(drop_m=0.0), placed(turtle, (0.0, 0.0), (5.0, 5.0)))
    world.advance(200)
    throw([world], A, (2.0, 0.0, 0.0))
    throw([world], B, (float("nan"),))
    world.advance(300)
    west, south, east, north = world.swept[A]
    end = float(world.population.find(A).view.qpos[0])
    assert west < -0.05
    assert south < -0.1 < 0.1 < north
    assert end + 0.05 < east < end + 0.5
    world.advance(400)
    assert world.swept.keys() == {A}
    assert world.swept[A][0] > west
    world.advance(401)
    x, y, _ = world.population.find(A).place
    assert world.swept == {A: (x, y, x, y)}


def test_states_of_other_steps_or_half_clusters_are_not_taken_in(
    turtle: Robot,
) -> None:
    world = populated(SETTINGS, placed(turtle, (0.0, 0.0), (0.26, 0.0), (3.0, 0.0)))
    world.advance(25)
    other, late = World(SETTINGS), World(SETTINGS)
    other.advance(25)
    other.take_in(states_of(world.state(), (C,)))
    assert other.births == (C,)
    with pytest.raises(UnexpectedEvent, match="live here"):
        other.take_in(world.state())
    with pytest.raises(UnexpectedEvent, match="of step 0, got step 25"):
        late.take_in(world.state())
    half = replace(world.state(), robots=world.state().robots[:1], clusters=((A, B),))
    with pytest.raises(MalformedMessage, match="one cluster"):
        other.take_in(half)
    assert other.births == (C,)


@needs("neighbours")
def crowding(trace: Trace, _fitness: object = None) -> float:
    """Return the mean number of robots nearby."""
    return float(trace.neighbours.mean())


@pytest.mark.parametrize(
    ("parts", "function", "measures", "problems"),
    [
        ((), "locomotion", ("energy", "contact_share"), []),
        (("schema.parts:TOUCH_SENSOR",), "light", (), []),
        (("schema.parts:LIGHT_SENSOR",), "locomotion", (), ["hide the light"]),
        (("schema.robogen_parts:IR_SENSOR",), "locomotion", (), ["look at other"]),
        (("crawlers:PISTON",), "locomotion", (CROWDING,), ["look", "neighbours"]),
        ((), CROWDING, (), ["neighbours"]),
    ],
)
def test_arenas_whose_robots_see_others_are_not_split(
    parts: tuple[str, ...],
    function: str,
    measures: tuple[str, ...],
    problems: list[str],
) -> None:
    allow([str(Path(__file__).parents[2] / "plugins" / "crawlers.py"), __name__])
    types = dict.fromkeys((*Space().part_types, *parts))
    own = replace(
        SETTINGS,
        space=Space(part_types=tuple(types)),
        fitness=Fitness(function=function),
        measures=Measures(names=measures),
    )
    found = list(split_problems(own))
    assert len(found) == len(problems)
    assert all(text in line for text, line in zip(problems, found, strict=True))
