"""Channels in an arena: against a robot alone, and after a snapshot."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Measures
from schema.experiment.file import read_experiment
from schema.experiment.settings import ArenaSettings, arena_settings_of
from schema.robot.brain import Brain, Connection
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import COMPUTED, RECORDED, Trace
from schema.wire.arena import Advance, BrainChange, Changes
from tests.worker.arena_cases import counted, placed, populated
from tests.worker.evaluations import with_simulation
from worker.arena.world import World
from worker.measures import BUILT_IN
from worker.robot.evaluation import simulate

SETTINGS = arena_settings_of(read_experiment("scenario3"))
CLOCK = replace(SETTINGS.simulation, window_steps=400, warmup_steps=0)
ARENA = replace(SETTINGS.arena, drop_m=0.0)
NAMES = tuple(BUILT_IN)


@pytest.fixture
def recorded(traces: list[Trace]) -> tuple[ArenaSettings, list[Trace]]:
    """Return settings with a measure that keeps the traces that it gets."""
    measures = Measures(names=("keep", *NAMES))
    return replace(SETTINGS, simulation=CLOCK, arena=ARENA, measures=measures), traces


def settings(**changes: Any) -> ArenaSettings:  # noqa: ANN401
    measures = Measures(names=NAMES)
    return replace(SETTINGS, simulation=CLOCK, measures=measures, **changes)


def test_channels_of_a_lone_robot_equal_those_of_an_evaluation(
    turtle: Robot, recorded: tuple[ArenaSettings, list[Trace]]
) -> None:
    own, traces = recorded
    world = populated(own, placed(turtle, (0.0, 0.0)))
    (judged,) = world.advance(400).judgements
    assert judged.is_mature
    together = traces[-1]
    alone = simulate(
        turtle, with_simulation(own.simulation, space=own.space, measures=own.measures)
    )
    np.testing.assert_array_equal(together.core_position, alone.core_position)
    assert set(together.channels) == set(alone.channels)
    for name in (*RECORDED, *COMPUTED):
        # An evaluation ends before the tick of its last step.
        end = -1 if name in {"outputs", "commands"} else None
        np.testing.assert_array_equal(
            together.channels[name][:end], alone.channels[name][:end], err_msg=name
        )
    assert together.energy[-1] > 0.0
    assert together.readings.any()


def test_neighbours_are_those_within_half_a_metre(
    turtle: Robot, recorded: tuple[ArenaSettings, list[Trace]]
) -> None:
    """The first and second are 0.4 m apart, the third is 2 m away."""
    own, traces = recorded
    world = populated(own, placed(turtle, (0.0, 0.0), (0.4, 0.0), (2.0, 0.0)))
    world.advance(400)
    assert [trace.neighbours[0] for trace in traces] == [1, 1, 0]


def test_energy_of_robots_that_merge_is_not_lost(
    turtle: Robot, recorded: tuple[ArenaSettings, list[Trace]]
) -> None:
    """A pile of robots merges and splits; energy never falls."""
    own, traces = recorded
    world, regrouped = counted(
        replace(own, arena=replace(ARENA, drop_m=0.25)),
        placed(turtle, (0.0, 0.0), (0.1, 0.0), (0.2, 0.05)),
    )
    world.advance(200)
    assert regrouped.merges > 0
    world.advance(400)
    assert len(traces) == 6  # of both advances
    for trace in traces:
        assert (np.diff(trace.energy) > 0.0).all()
        assert trace.contact.any()


@pytest.mark.parametrize("stops", [(200, 400, 425, 800), (75, 300, 800)])
def test_restored_arena_answers_equally(turtle: Robot, stops: tuple[int, ...]) -> None:
    own = settings()
    places = ((0.0, 0.0), (0.12, 0.0), (1.0, 1.0))
    whole, regrouped = counted(own, placed(turtle, *places))
    steady: list[Advance] = [whole.advance(stop) for stop in stops]
    world = populated(own, placed(turtle, *places))
    for expected, (stop, _) in zip(steady, pairwise((*stops, 0)), strict=True):
        found = world.advance(stop)
        assert found == expected
        world = World.restore(own, world.snapshot())
        assert world.digest() == expected.digest
    assert all(len(one.measures) == len(NAMES) for one in steady[-1].judgements)
    assert regrouped.merges > 0


def test_restored_arena_records_equally(
    turtle: Robot, recorded: tuple[ArenaSettings, list[Trace]]
) -> None:
    """The sample of step 80 has the outputs of the tick of step 75."""
    own, traces = recorded
    noisy = replace(own.simulation, actuator_noise=0.1)
    newborns = placed(turtle, (0.0, 0.0), (0.12, 0.0))
    world = populated(replace(own, simulation=noisy), newborns)
    world.advance(78)
    World.restore(world._settings, world.snapshot()).advance(400)
    world.advance(400)
    *_, first, second, third, fourth = traces
    for one, other in ((first, third), (second, fourth)):
        assert one.outputs[2:].any()
        for name in (*RECORDED, *COMPUTED):
            np.testing.assert_array_equal(one.channels[name], other.channels[name])


def test_trace_has_the_present_brain_before_and_after_a_restore(
    turtle: Robot, recorded: tuple[ArenaSettings, list[Trace]]
) -> None:
    own, traces = recorded
    learnt = Brain(turtle.brain.neurons, (Connection(0, 8, 0.5),))
    world = populated(own, placed(turtle, (0.0, 0.0)))
    world.advance(400)
    world.apply(Changes(brains=(BrainChange(BirthId(0, 0), learnt),)))
    World.restore(own, world.snapshot()).advance(800)
    world.advance(800)
    assert [trace.robot.brain for trace in traces] == [turtle.brain, learnt, learnt]


def test_measures_do_not_change_the_arena(turtle: Robot) -> None:
    newborns = placed(turtle, (0.0, 0.0), (0.12, 0.0))
    plain = populated(replace(SETTINGS, simulation=CLOCK), newborns)
    measured = populated(settings(), newborns)
    one, other = plain.advance(400), measured.advance(400)
    assert one.poses == other.poses
    assert [each.fitness for each in one.judgements] == [
        each.fitness for each in other.judgements
    ]
    assert [each.measures for each in one.judgements] == [(), ()]
