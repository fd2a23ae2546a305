"""Settings in requests: the sections of an experiment that an answer depends on."""

from collections.abc import Callable, Iterator
from functools import cached_property, lru_cache, partial
from typing import TypeVar

import msgspec
from msgspec.structs import replace

from schema.errors import ExperimentError, check_most
from schema.experiment.changes import (
    OF_RULES,
    SettingChange,
    change_problems,
    settings_at,
)
from schema.experiment.document import (
    NETWORK,
    ArenaWorld,
    BrainSection,
    Experiment,
    Fitness,
    Measures,
    Simulation,
    Space,
    body_space,
    light_of,
)
from schema.experiment.environment import FLAT, Environment, ground_problems
from schema.experiment.identity import Origin
from schema.experiment.robust import Calibration, Robust, range_problems
from schema.experiment.section import Count, Section, multiple_problems
from schema.limits import MOST_SETTINGS_BYTES
from schema.parts import Sensor, Vector
from schema.plugins.load import load_function, load_object, unknown
from schema.plugins.parameters import known_keys, parameters_type, read_parameters
from schema.robot.trace import channels_of

T = TypeVar("T")

FITNESS = {
    "locomotion": "worker.fitness:thesis",
    "directed-locomotion": "worker.tasks:directed_locomotion",
    "target": "worker.tasks:target",
    "light": "worker.tasks:light",
    "turning": "worker.tasks:turning",
    "balance": "worker.tasks:balance",
}
"""Fitness functions that come with the toolkit, by short name."""
_OFF_LINE = {
    "simulation.evaluation_s": "arenas evaluate all the time",
    "simulation.start_deg": "robots of an arena are born upright, with a drawn heading",
    "environment.push_impulse": "arenas have no pushes",
    "selection.culling": "[arena] has these keys",
    "selection.reevaluation": "arenas re-evaluate all the time",
    "robust": "robots of an arena live once; they can have the noise of [simulation]",
    "calibration": "robots of an arena have ideal sensors and motors",
}
"""Keys that arenas do not have, and why."""


class Ablation(Section, frozen=True):
    """Inputs of a brain that are held, and motors that are dead, in one evaluation.

    It is a part of requests, not of an experiment: its numbers are those of one robot.

    Attributes:
        inputs: (number of the input, value) of each held input. The brain receives the
            value at every tick, without noise; with None the mean of what it receives
            at the ticks of the same evaluation without the ablation.
        motors: numbers of the dead motors. A dead motor gets the neutral output 0.5 at
            every tick: the middle of its joint's range, or velocity 0. The brain runs
            on.
    """

    inputs: tuple[tuple[Count, float | None], ...] = ()
    motors: tuple[Count, ...] = ()

    @property
    def has_means(self) -> bool:
        """Whether some inputs are held at their mean."""
        return any(value is None for _, value in self.inputs)


class EvaluationSettings(Section, frozen=True, dict=True, cache_hash=True):
    """Settings of an evaluation request.

    An experiment has all but ``ablation`` and ``record``: channels of the trace beside
    those that its functions declare. The hash is computed once, so that workers can
    look up what they made of settings.
    """

    space: Space
    simulation: Simulation
    fitness: Fitness
    environment: Environment = FLAT
    measures: Measures = Measures()
    brain: BrainSection = NETWORK
    robust: Robust | None = None
    calibration: tuple[Calibration, ...] = ()
    ablation: Ablation | None = None
    record: tuple[str, ...] = ()
    changes: tuple[SettingChange, ...] = ()

    @cached_property
    def light(self) -> Vector | None:
        """Position of the light [m]; None is no light."""
        return self.environment.light


class ArenaSettings(Section, frozen=True, dict=True, cache_hash=True):
    """Settings of a request to advance an arena; hashed once, as those above."""

    space: Space
    simulation: Simulation
    fitness: Fitness
    arena: ArenaWorld
    environment: Environment = FLAT
    origin: Origin = Origin()
    measures: Measures = Measures()
    brain: BrainSection = NETWORK
    changes: tuple[SettingChange, ...] = ()

    @cached_property
    def light(self) -> Vector | None:
        """Position of the light [m]; None is no light."""
        return light_of(self.environment, self.arena)


def breeding_settings(experiment: Experiment) -> bytes:
    """Return the JSON that every breeding request of an island holds.

    It is the whole experiment, as an own encoding may read all of it.
    """
    return msgspec.json.encode(experiment)


def breeding_plugins(experiment: Experiment) -> bytes:
    """Return JSON that names the plug-ins which a breeding request needs."""
    sections = experiment.encoding, experiment.brain, experiment.space
    return msgspec.json.encode(sections)


def evaluation_settings_of(
    experiment: Experiment, point: float = 0.0
) -> EvaluationSettings:
    """Return the evaluation settings of an experiment at a point of its changes.

    A robot of an arena that is evaluated alone has the arena's light.
    """
    return settings_at(_changing_settings(experiment), point)


def _changing_settings(experiment: Experiment) -> EvaluationSettings:
    settings = _sections(experiment, EvaluationSettings)
    arena = experiment.arena
    light = light_of(experiment.environment, arena)
    if light is None and arena is not None and arena.patch_light_m:
        light = 0.0, 0.0, arena.patch_light_m
    return replace(settings, environment=replace(settings.environment, light=light))


def evaluation_settings(experiment: Experiment) -> bytes:
    """Return the JSON that every evaluation request of an experiment holds."""
    return msgspec.json.encode(_changing_settings(experiment))


def arena_settings_of(experiment: Experiment) -> ArenaSettings:
    """Return the settings, without an origin, of the arena that an experiment has."""
    if experiment.arena is None:
        raise ExperimentError(f"{experiment.name}: has no [arena]")
    return _sections(experiment, ArenaSettings)


def arena_settings(experiment: Experiment, origin: Origin) -> bytes:
    """Return the JSON that every request to advance an arena holds."""
    return msgspec.json.encode(replace(arena_settings_of(experiment), origin=origin))


def _sections(experiment: Experiment, kind: type[T]) -> T:
    """Return settings with the sections of the same names of an experiment.

    The rules of an arena, and their changes, are none of a worker's business.
    """
    changes = (each for each in experiment.changes if OF_RULES not in each.setting)
    experiment = replace(experiment, changes=tuple(changes))
    return msgspec.convert(experiment, kind, from_attributes=True)


def _from_json(kind: type[T], data: bytes) -> T:
    """Return settings; what an experiment may not have is refused here, too.

    Keys that no longer exist, as in robot files of earlier versions, are left out.
    """
    where = "settings of a request"
    check_most(len(data), MOST_SETTINGS_BYTES, "bytes", where, ExperimentError)
    try:
        known = known_keys(msgspec.json.decode(data), kind)
        settings = msgspec.convert(known, kind)
    except (ValueError, RecursionError) as error:  # of msgspec, or not UTF-8
        raise ExperimentError(f"{where}: {error}") from None
    if problem := next(_problems(settings), ""):
        raise ExperimentError(f"{where}: {problem}")
    return settings


def _problems(settings: object) -> Iterator[str]:
    yield from ground_problems(getattr(settings, "environment", FLAT))
    if isinstance(settings, ArenaSettings):
        yield from arena_problems(settings)
    if isinstance(settings, ArenaSettings | EvaluationSettings):
        yield from change_problems(settings)
    if isinstance(settings, EvaluationSettings):
        clock = settings.simulation
        key, unit = "simulation.window_steps", "simulation.pose_steps"
        yield from multiple_problems(key, clock.window_steps, clock.pose_steps, unit)
        yield from range_problems(settings.robust)


def arena_problems(settings: Experiment | ArenaSettings) -> Iterator[str]:
    """Yield which keys of an arena are for off-line islands."""
    for key, why in _OFF_LINE.items():
        section, _, name = key.rpartition(".")
        holder = getattr(settings, section, None) if section else settings
        value = getattr(holder, name, None)
        if any(value) if isinstance(value, tuple) else value:
            yield f"{key}: is for off-line islands, as {why}; remove it"


def split_problems(settings: ArenaSettings) -> Iterator[str]:
    """Yield why an arena cannot be simulated in parts, by several processes.

    Robots that may touch are in one part, so contacts, touch sensors and work are
    exact. What sees robots from afar is not: it would miss those of other parts.
    """
    for kind in body_space(settings.space).values():
        for sensor in kind.sensors:
            if not isinstance(sensor, Sensor):
                yield f"{kind.name}: own sensors may look at other robots"
            elif sensor.kind == "light":
                yield f"{kind.name}: other robots hide the light from its sensor"
    functions = [fitness_function(settings.fitness)]
    for path in settings.measures.names:
        functions += [load_object(path, "measures.names", {})] if ":" in path else []
    if "neighbours" in channels_of(functions):
        yield "fitness or a measure needs trace.neighbours, a count of other robots"


read_breeding_settings = lru_cache(maxsize=64)(partial(_from_json, Experiment))
read_evaluation_settings = lru_cache(maxsize=64)(
    partial(_from_json, EvaluationSettings)
)
read_arena_settings = lru_cache(maxsize=64)(partial(_from_json, ArenaSettings))
"""Return the settings of a request, or of a robot file, from their JSON.

Other bytes raise ``ExperimentError``.
"""


def lasting(settings: EvaluationSettings, steps: int) -> EvaluationSettings:
    """Return settings with another total length of an evaluation.

    The window keeps its length and ends the evaluation; the rest is warm-up. 0 steps
    change nothing.

    Raises:
        ExperimentError: fewer steps than the window has.
    """
    if not steps:
        return settings
    clock = settings.simulation
    if steps < clock.window_steps:
        rule = f"must take >= simulation.window_steps = {clock.window_steps} steps"
        raise ExperimentError(f"an evaluation {rule}, got {steps}")
    warmup = steps - clock.window_steps
    return replace(settings, simulation=replace(clock, warmup_steps=warmup))


LATER_WINDOW = "later window"
"""Group of the changes that evaluate a robot in a later window."""
LATER_WINDOWS = 4
"""Windows after an evaluation in which its robot is evaluated again."""


def later_windows(settings: EvaluationSettings) -> tuple[EvaluationSettings, ...]:
    """Return settings of evaluations whose windows follow one after the other.

    The first follows the window of the evaluation, without ``[robust]``. In each the
    robot starts as before, and what precedes the window is warm-up.
    """
    clock = settings.simulation
    return tuple(
        lasting(
            replace(settings, robust=None),
            clock.evaluation_steps + number * clock.window_steps,
        )
        for number in range(1, LATER_WINDOWS + 1)
    )


@lru_cache(maxsize=64)
def fitness_function(fitness: Fitness) -> Callable[..., float]:
    """Return the fitness function that an experiment names.

    Raises:
        ExperimentError: no such function of a trace and its parameters.
    """
    where = "fitness.function"
    path = fitness.function
    if ":" not in path and path not in FITNESS:
        raise unknown(path, where, FITNESS)
    return load_function(FITNESS.get(path, path), where, 2, "trace, parameters")


@lru_cache(maxsize=64)
def fitness_argument(
    function: Callable[..., float], fitness: Fitness
) -> Fitness | msgspec.Struct:
    """Return the second argument of a fitness function.

    A function that annotates it with a Struct of its own gets the table
    ``fitness.parameters``; any other function gets the section.

    Raises:
        ExperimentError: parameters that the Struct refuses, or without a Struct.
    """
    where = "fitness.parameters"
    kind = parameters_type(function, "fitness.function")
    if kind is not None and not issubclass(kind, Fitness):
        return read_parameters(fitness.parameters, kind, where)
    if fitness.parameters:
        then = "it must annotate its second argument with a msgspec Struct"
        if fitness.function in (*FITNESS, *FITNESS.values()):
            then = "its keys are those of [fitness]"
        raise ExperimentError(
            f"{where}: {fitness.function} has no parameters of its own; {then}"
        )
    return fitness


def ablation_problems(ablation: Ablation, inputs: int, motors: int) -> Iterator[str]:
    """Yield which inputs and motors of an ablation a robot with so many lacks."""
    held = [number for number, _ in ablation.inputs]
    for what, numbers, count in (
        ("inputs", held, inputs),
        ("motors", ablation.motors, motors),
    ):
        for number in numbers:
            if number >= count:
                yield f"ablation.{what}: the robot has {count}, got number {number}"
