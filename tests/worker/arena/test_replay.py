"""Replay of arenas: equal to the original, or reported as different."""

from collections.abc import Callable, Sequence
from itertools import starmap
from typing import NamedTuple

import msgspec
import pyarrow as pa
from msgspec.structs import replace

from schema.experiment.document import Fitness, Simulation
from schema.experiment.environment import FLAT, Environment
from schema.experiment.file import read_experiment
from schema.experiment.identity import NO_IDENTITY, Origin
from schema.experiment.settings import arena_settings, read_arena_settings
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import BrainChange, Changes, Insertion, PastAdvance, Rebuild
from tests.worker.arena_cases import crowd, settings_of
from tests.worker.evaluations import with_simulation
from worker.arena.replay import alone, together
from worker.arena.world import World

Robots = Callable[[int], Robot]
SETTINGS = arena_settings(read_experiment("scenario3"), Origin())
TURN, TICKS = 50, 2
A, B, C = (BirthId(0, number) for number in range(3))


def lived(
    turns: Sequence[Changes], settings: bytes = SETTINGS, turn: int = TURN
) -> tuple[PastAdvance, ...]:
    """Return the history of an arena, with changes at the start of each turn."""
    world = World(read_arena_settings(settings))
    history: list[PastAdvance] = []
    for changes in turns:
        world.apply(changes)
        advance = world.advance(world.step + turn)
        history.append(PastAdvance(changes, advance.step, advance.digest))
    return tuple(history)


class Scene(NamedTuple):
    is_equal: bool
    samples: pa.Table
    motion: pa.Table


def scenes(
    history: Sequence[PastAdvance], birth: BirthId, settings: bytes = SETTINGS
) -> list[Scene]:
    past = Rebuild(b"", tuple(history))
    found = list(starmap(Scene, together(settings, past, frozenset({birth}))))
    assert len(found) == len(history)
    return found


def test_replay_on_one_platform_is_equal(robot_of: Robots) -> None:
    newborns = crowd(robot_of, 3, 0.4)
    found = scenes(lived([Changes((), newborns), Changes((A,)), Changes()]), A)
    assert [scene.is_equal for scene in found] == [True] * 3
    assert [scene.motion.num_rows for scene in found] == [TICKS, 0, 0]


PICKY = """
def short(trace, parameters):
    if len(trace.core_position) == 4:
        raise ValueError("no fitness of four samples")
    return 0.0
"""


def test_replay_judges_only_when_the_original_did(
    turtle: Robot, own_module: Callable[[str], str]
) -> None:
    """Between two advances, the fitness of the robot is undefined for a while."""
    settings = replace(
        settings_of(drop_m=0.0),
        simulation=Simulation(window_steps=400),
        fitness=Fitness(function=f"{own_module(PICKY)}:short"),
    )
    text, turn = msgspec.json.encode(settings), 4 * TURN
    newborn = Insertion(A, turtle, (0.0, 0.0))
    history = lived([Changes((), (newborn,)), Changes()], text, turn)
    found = scenes(history, A, text)
    assert [scene.is_equal for scene in found] == [True] * 2
    assert [scene.motion.num_rows for scene in found] == [4 * TICKS] * 2
    assert [scene.samples.num_rows for scene in found] == [turn // 40] * 2


def test_replay_of_an_arena_in_which_all_robots_die(turtle: Robot) -> None:
    """The robot diverges at the second of four ticks."""
    heavy = Simulation(gravity=2000.0)
    settings = replace(settings_of(drop_m=5.0), simulation=heavy)
    text = msgspec.json.encode(settings)
    newborn = Insertion(A, turtle, (0.0, 0.0))
    (scene,) = scenes(lived([Changes((), (newborn,))], text, 4 * 25), A, text)
    assert scene.is_equal
    assert scene.motion.num_rows == 0


def test_replay_of_a_drift_is_an_approximation_and_says_so(robot_of: Robots) -> None:
    """C died only in the replay; A only in the original, and returned as a migrant."""
    one, other = crowd(robot_of, 2, 0.4)
    swaps = tuple(BrainChange(birth, robot_of(0).brain) for birth in (A, C))
    there = Changes(removals=(C,), insertions=(one,), brains=swaps)
    history = [
        *lived([Changes((), (one, other))]),
        PastAdvance(there, 2 * TURN, bytes(32)),
        PastAdvance(Changes((B,)), 3 * TURN, bytes(32)),
    ]
    found = scenes(history, A)
    assert [scene.is_equal for scene in found] == [True, False, False]
    assert [scene.motion.num_rows for scene in found] == [TICKS] * 3


def test_poses_of_an_evaluation_leave_out_the_objects(turtle: Robot) -> None:
    box = '<geom type="box" size=".1 .1 .1"/>'
    body = f'<body pos="2 0 0.1"><freejoint/>{box}</body>'
    scenery = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    clock, environment = Simulation(window_steps=80), Environment(scenery=scenery)
    settings = with_simulation(clock, environment=environment)
    _, plain = alone(turtle, replace(settings, environment=FLAT), NO_IDENTITY)
    _, poses = alone(turtle, settings, NO_IDENTITY)
    lengths = [len(angles) for angles in poses["angles"].to_pylist()]
    assert lengths == [len(angles) for angles in plain["angles"].to_pylist()] == [2] * 4
