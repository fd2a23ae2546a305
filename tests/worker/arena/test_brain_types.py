"""Brains of all types in arenas: equal alone, after a restore, and when they break."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import MalformedMessage, SimulationDiverged
from schema.experiment.document import BrainSection
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.parts import Parameter
from schema.plugins import load
from schema.robot.brain import Brain, Connection, Neuron, Widths
from schema.robot.cpg import PHASE_OSCILLATOR
from schema.robot.ids import BirthId
from schema.robot.neurons import Tick
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.wire.arena import BrainChange, Changes, Insertion
from tests.worker.arena_cases import SETTINGS, populated, seconds, state_of
from worker.arena.world import World
from worker.robot.evaluation import simulate

OSCILLATING: dict[str, tuple[ArenaSettings, Callable[[int], Neuron]]] = {
    "cpg": (
        replace(SETTINGS, brain=BrainSection(type="cpg")),
        lambda part: Neuron(
            "output", PHASE_OSCILLATOR, part, (1.0 + 0.1 * part, 0.3, 0.9, 0.5)
        ),
    ),
    "modular": (
        replace(
            SETTINGS,
            brain=BrainSection(type="modular"),
            space=replace(SETTINGS.space, max_hidden=60),
        ),
        lambda part: Neuron("output", "ModuleNeuron", part, (0.1 * part,)),
    ),
    "neurons": (
        replace(
            SETTINGS,
            space=replace(
                SETTINGS.space, neuron_types=("Simple", "my_brains:Adapting")
            ),
        ),
        lambda part: Neuron("output", "Adapting", part, (0.3, 2.5, 0.1 * part)),
    ),
    "brain": (
        replace(SETTINGS, brain=BrainSection(type="my_brains:Wave")),
        lambda part: Neuron("output", "Waver", part, (0.9, 0.2 * part)),
    ),
}


def off_line(settings: ArenaSettings, **clock: int) -> EvaluationSettings:
    """Return settings in which a robot alone lives as in an arena."""
    world = replace(settings.simulation, drop_m=settings.arena.drop_m, **clock)
    return EvaluationSettings(
        settings.space, world, settings.fitness, brain=settings.brain
    )


def robots(turtle: Robot, make: Callable[[int], Neuron]) -> list[Robot]:
    """Return two robots with neurons of a type, coupled in different ways."""
    inputs = tuple(n for n in turtle.brain.neurons if n.layer == "input")
    neurons = (*inputs, make(1), make(3))
    edges = (Connection(8, 9, 0.7), Connection(9, 8, 0.4), Connection(1, 8, 0.3))
    return [Robot(turtle.parts, Brain(neurons, edges[:n])) for n in (3, 1)]


@pytest.mark.usefixtures("_own_brains")
@pytest.mark.parametrize("name", list(OSCILLATING))
def test_restored_arena_continues_equal_to_the_last_bit(
    name: str, turtle: Robot
) -> None:
    settings, make = OSCILLATING[name]
    first, second = robots(turtle, make)
    a, b = BirthId(0, 0), BirthId(0, 1)
    world = populated(
        settings,
        [Insertion(a, first, (0.0, 0.0), 0.0), Insertion(b, second, (0.4, 0.1), 1.0)],
    )
    seconds(world, 3.0)
    again = World.restore(settings, world.snapshot())
    assert np.abs(world.population.find(a).states).max() > 0.0
    digests = [seconds(each, 2.0).digest for each in (world, again)]
    assert digests[0] == digests[1]
    assert state_of(world, a) != state_of(world, b)


@pytest.mark.usefixtures("_own_brains")
@pytest.mark.parametrize("name", list(OSCILLATING))
def test_robot_in_an_arena_ticks_as_off_line(name: str, turtle: Robot) -> None:
    settings, make = OSCILLATING[name]
    robot = robots(turtle, make)[0]
    birth = BirthId(0, 0)
    world = populated(settings, [Insertion(birth, robot, (0.0, 0.0), 0.0)])
    seconds(world, 5.0)
    track = simulate(robot, off_line(settings, window_steps=400))
    found = np.array(world.population.find(birth).window.positions)
    assert np.array_equal(found, track.core_position)


class Breaking:
    """Neuron type that is not finite after a second if its input is above 1."""

    name = "Breaking"
    parameters: tuple[Parameter, ...] = ()
    states = 1

    def step(
        self, state: Floats, inputs: Floats, parameters: Floats, tick: Tick
    ) -> Floats:
        del parameters
        return np.where((tick.age_s > 1.0) & (inputs > 1.0), np.nan, 0.5 + 0.0 * state)


class Picky(Breaking):
    """Neuron type that raises after a second if an input is above 1."""

    def step(
        self, state: Floats, inputs: Floats, parameters: Floats, tick: Tick
    ) -> Floats:
        del parameters
        if ((tick.age_s > 1.0) & (inputs > 1.0)).any():
            raise ValueError("input\ntoo great")
        return 0.5 + 0.9 * state


BREAKING = {"test:Breaking": Breaking(), "test:Picky": Picky()}


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("Breaking", "brain diverged: state not finite"),
        (
            "Picky",
            "brain failed: neuron type Breaking raised ValueError: input too great",
        ),
    ],
)
def test_robot_whose_brain_breaks_is_a_casualty_and_its_neighbour_lives_on(
    turtle: Robot, monkeypatch: pytest.MonkeyPatch, kind: str, reason: str
) -> None:
    real = load._load
    monkeypatch.setattr(
        load, "_load", lambda path, key: BREAKING.get(path) or real(path, key)
    )
    monkeypatch.setattr("schema.experiment.brains.check_neuron_type", lambda *_: None)
    monkeypatch.setattr("worker.robot.brains.check_controls", lambda *_: None)
    space = replace(SETTINGS.space, neuron_types=(f"test:{kind}", "Simple"))
    settings = replace(SETTINGS, space=space)
    inputs = tuple(n for n in turtle.brain.neurons if n.layer == "input")
    motors = (Neuron("output", "Breaking", 1), Neuron("output", "Breaking", 3))
    push = Neuron("hidden", "Simple", 0, (-2.0, 1.0))
    parts = turtle.parts
    sick = Robot(parts, Brain((*inputs, *motors, push), (Connection(10, 8, 1.0),)))
    well = Robot(parts, Brain((*inputs, *motors)))
    a, b = BirthId(0, 0), BirthId(0, 1)
    world = populated(
        settings,
        [Insertion(a, sick, (0.0, 0.0), 0.0), Insertion(b, well, (0.35, 0.0), 0.0)],
    )
    found = seconds(world, 2.0)
    assert [(one.birth, one.step, one.reason) for one in found.casualties] == [
        (a, 225, reason)
    ]
    assert world.births == (b,)
    assert np.isfinite(world.population.find(b).view.qpos).all()
    # The neighbour's brain went on as in a world of its own.
    alone = populated(settings, [Insertion(b, well, (0.35, 0.0), 0.0)])
    seconds(alone, 2.0)
    states = [each.population.find(b).states for each in (world, alone)]
    assert states[0].tobytes() == states[1].tobytes()


@pytest.mark.usefixtures("_own_brains")
def test_robot_whose_brain_raises_at_birth_is_a_casualty(
    turtle: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> Floats:
        raise KeyError("gone")

    settings, make = OSCILLATING["brain"]
    world = World(settings)
    bank = world.population.model_cache.controls.bank(())
    monkeypatch.setattr(type(bank), "step", fail)
    newborn = Insertion(BirthId(0, 0), robots(turtle, make)[0], (0.0, 0.0))
    world.apply(Changes(insertions=(newborn,)))
    assert world.births == ()
    (casualty,) = seconds(world, 1.0).casualties
    assert casualty.reason == "brain failed: KeyError: 'gone'"


@pytest.mark.parametrize("method", ["pack", "bank"])
@pytest.mark.usefixtures("_own_brains")
def test_robot_whose_brain_cannot_be_made_is_a_casualty(
    turtle: Robot, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    """A newborn, and a robot that gets such a brain; its neighbour lives on."""
    settings, make = OSCILLATING["brain"]
    first, second = robots(turtle, make)
    a, b, c = (BirthId(0, number) for number in range(3))
    world = populated(
        settings,
        [Insertion(a, first, (0.0, 0.0), 0.0), Insertion(b, first, (0.5, 0.0), 0.0)],
    )
    control = world.population.model_cache.controls._control
    pack, bank, bad = type(control).pack, type(control).bank, list[Any]()

    def fails_to_pack(own: Any, brain: Brain, width: Widths) -> Any:  # noqa: ANN401
        packed = pack(own, brain, width)
        if brain == second.brain:
            if method == "pack":
                raise KeyError("gone")
            bad.append(packed)
        return packed

    def fails_to_start(own: Any, packed: Any, *rest: Any) -> Any:  # noqa: ANN401
        if any(one is other for one in packed for other in bad):
            raise KeyError("gone")
        return bank(own, packed, *rest)

    monkeypatch.setattr(type(control), "pack", fails_to_pack)
    monkeypatch.setattr(type(control), "bank", fails_to_start)
    changes = Changes(
        insertions=(Insertion(c, second, (1.0, 0.0), 0.0),),
        brains=(BrainChange(b, second.brain),),
    )
    world.apply(changes)
    assert world.births == (a,)
    found = seconds(world, 1.0).casualties
    reason = "brain failed: KeyError: 'gone'"
    assert [(one.birth, one.reason) for one in found] == [(b, reason), (c, reason)]
    with pytest.raises(SimulationDiverged, match=f"^{reason}$"):
        simulate(second, off_line(settings))


@pytest.mark.usefixtures("_own_brains")
def test_outputs_of_a_wrong_shape_are_a_failure(
    turtle: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings, make = OSCILLATING["brain"]
    robot = robots(turtle, make)[0]
    world = populated(settings, [Insertion(BirthId(0, 0), robot, (0.0, 0.0), 0.0)])
    bank = world.population.model_cache.controls.bank(())
    monkeypatch.setattr(type(bank), "step", lambda *_: np.zeros((1, 2)))
    (casualty,) = seconds(world, 1.0).casualties
    outputs = world.population.model_cache.controls.width.outputs
    story = f"ValueError: step must return (R, O) = (1, {outputs}), got (1, 2)"
    assert casualty.reason == f"brain failed: {story}"
    with pytest.raises(SimulationDiverged) as caught:
        simulate(robot, off_line(settings))
    assert str(caught.value) == f"brain failed by 0.000 s: {story}"


def test_snapshot_with_a_brain_of_another_type_is_refused(turtle: Robot) -> None:
    world = populated(SETTINGS, [Insertion(BirthId(0, 0), turtle, (0.0, 0.0), 0.0)])
    other: dict[str, Any] = {"space": replace(SETTINGS.space, neuron_types=("Simple",))}
    with pytest.raises(MalformedMessage, match="of an arena with other settings"):
        World.restore(replace(SETTINGS, **other), world.snapshot())
