"""Replay of arenas: equal to the original, or reported as different."""

from collections.abc import Callable, Sequence

from msgspec.structs import replace

from schema.experiment.document import Fitness, Simulation, Space
from schema.experiment.environment import FLAT, Environment
from schema.experiment.file import read_experiment
from schema.experiment.identity import NO_IDENTITY, Origin
from schema.experiment.settings import (
    EvaluationSettings,
    arena_settings,
    read_arena_settings,
)
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import BrainChange, Changes
from schema.wire.arena_codec import PastAdvance, Rebuild
from tests.worker.arena_cases import crowd
from worker.arena.replay import Scene, alone, together
from worker.arena.world import World

Robots = Callable[[int], Robot]
SETTINGS = arena_settings(read_experiment("scenario3"), Origin())
TURN, TICKS = 50, 2
A, B, C = (BirthId(0, number) for number in range(3))


def lived(turns: Sequence[Changes]) -> tuple[PastAdvance, ...]:
    """Return the history of an arena, with changes at the start of each turn."""
    world = World(read_arena_settings(SETTINGS))
    history: list[PastAdvance] = []
    for changes in turns:
        world.apply(changes)
        advance = world.advance(world.step + TURN)
        history.append(PastAdvance(changes, advance.step, advance.digest))
    return tuple(history)


def scenes(history: Sequence[PastAdvance], birth: BirthId) -> list[Scene]:
    past = Rebuild(b"", tuple(history))
    found = list(together(SETTINGS, past, frozenset({birth})))
    assert [scene.step for scene in found] == [past.until for past in history]
    return found


def test_replay_on_one_platform_is_equal(robot_of: Robots) -> None:
    newborns = crowd(robot_of, 3, 0.4)
    found = scenes(lived([Changes((), newborns), Changes((A,)), Changes()]), A)
    assert [scene.is_equal for scene in found] == [True] * 3
    assert [scene.motion.num_rows for scene in found] == [TICKS, 0, 0]


def test_replay_of_a_drift_is_an_approximation_and_says_so(
    robot_of: Robots,
) -> None:
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
    settings = EvaluationSettings(
        space=Space(),
        simulation=Simulation(window_steps=80),
        fitness=Fitness(),
        environment=Environment(
            scenery=f"<mujoco><worldbody>{body}</worldbody></mujoco>"
        ),
    )
    _, plain = alone(turtle, replace(settings, environment=FLAT), NO_IDENTITY)
    _, poses = alone(turtle, settings, NO_IDENTITY)
    lengths = [len(angles) for angles in poses["angles"].to_pylist()]
    assert lengths == [len(angles) for angles in plain["angles"].to_pylist()] == [2] * 4
