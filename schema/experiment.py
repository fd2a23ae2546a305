"""The experiment document: everything that may change a birth.

A TOML file; every key has the thesis's value as its default, and a key that does
not exist is refused with the nearest name that does. What may not change a birth
(workers, folders, addresses) is a flag of the command, not a key.
"""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from difflib import get_close_matches
from functools import lru_cache
from importlib import resources
from math import isclose, isfinite, lcm, pi
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast, get_args

import msgspec
from msgspec import Meta, Struct

from schema.errors import ExperimentError
from schema.parts import BodySpace, Parameter, PartType
from schema.plugin import load

T = TypeVar("T")

Probability = Annotated[float, Meta(ge=0, le=1)]
Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Count = Annotated[int, Meta(ge=0)]
AtLeastOne = Annotated[int, Meta(ge=1)]


class _Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the sections: immutable, nothing unknown, keys by name."""


class Space(_Section, frozen=True):
    """What a robot may be: part types and limits (thesis tables 4.1, 5.1)."""

    part_types: tuple[str, ...] = (
        "schema.parts:CORE",
        "schema.parts:FIXED_BRICK",
        "schema.parts:ACTIVE_HINGE",
        "schema.parts:HINGE",
        "schema.parts:PARAMETRIC_BAR_JOINT",
        "schema.parts:TOUCH_SENSOR",
    )
    min_parts: AtLeastOne = 3
    max_parts: AtLeastOne = 30
    max_inputs: Count = 10
    max_outputs: AtLeastOne = 10
    max_hidden: Count = 10
    planar: bool = True


class Generation(_Section, frozen=True):
    """How a random robot is made (thesis section 4.4.2)."""

    parts_mean: float = 12.0
    parts_sd: NotNegative = 5.0
    p_connect_neurons: Probability = 0.1
    hidden_on: Literal["any", "wired"] = "any"
    max_tries: AtLeastOne = 100


class Variation(_Section, frozen=True):
    """How offspring differ (thesis section 4.4.6)."""

    p_delete_subtree: Probability = 0.05
    p_duplicate_subtree: Probability = 0.1
    p_swap_subtree: Probability = 0.05
    p_delete_hidden_neuron: Probability = 0.05
    p_remove_brain_connection: Probability = 0.05
    body_epsilon: Probability = 0.05
    brain_epsilon: Probability = 0.1
    add_parts: Literal["loop", "once"] = "loop"
    duplicable_size: Literal["mean", "sum"] = "mean"
    hidden_rounding: Literal["stochastic", "half-up"] = "stochastic"
    check_min_parts: bool = True


class Selection(_Section, frozen=True):
    """Who mates and who lives on (thesis section 5.3)."""

    population: AtLeastOne = 15
    children: AtLeastOne = 15
    window: AtLeastOne | None = None
    parents: Literal["tournament", "random", "none"] = "tournament"
    tournament_size: AtLeastOne = 4
    survivors: Literal["best", "random"] = "best"
    keep_parents: bool = True
    max_mating_attempts: AtLeastOne = 5

    @property
    def parents_needed(self) -> int:
        """How many must be there to choose two parents from; 0 if none is chosen."""
        needs = {"tournament": self.tournament_size + 1, "random": 2, "none": 0}
        return needs[self.parents]


class Vetting(_Section, frozen=True):
    """Which bodies can be built: ``overlap`` allows touching, ``contact`` not."""

    mode: Literal["overlap", "contact"] = "overlap"
    tolerance_m: NotNegative = 1e-6


class Simulation(_Section, frozen=True):
    """The simulated world and its clocks, in physics steps.

    ``armature`` and, at driven joints, ``servo_armature`` [kg m2], ``damping`` and
    ``servo_stiffness`` [N m s/rad] and ``contact_time_s`` are what MuJoCo needs
    beyond the original's numbers; their effect is measured in docs/physics.md. A
    servo chatters above a stiffness of 2 servo_armature / timestep_s.
    """

    timestep_s: Positive = 0.005
    brain_steps: AtLeastOne = 25
    pose_steps: AtLeastOne = 40
    window_steps: AtLeastOne = 2400
    warmup_steps: Count = 0
    gravity: NotNegative = 9.81
    friction: NotNegative = 1.0
    armature: NotNegative = 1e-4
    damping: NotNegative = 1e-4
    servo_armature: NotNegative = 5e-3
    servo_stiffness: Positive = 1.0
    contact_time_s: Positive = 0.01
    drop_m: NotNegative = 0.0


class Fitness(_Section, frozen=True):
    """What is maximised: a function ``module:attribute`` and its weights."""

    function: str = "worker.fitness:thesis"
    path_weight: float = 1.0
    straight_weight: float = 5.0
    limit: Positive = 1.0


class Arena(_Section, frozen=True):
    """An on-line world: robots are born, judged all the time and die in it.

    Times are simulated seconds. Source: Hupkes 2016, section 5.3.3, and the code's
    intervals (facts of the original, section 5.2).
    """

    founder_interval_s: Positive = 1.0
    birth_interval_s: Positive = 15.0
    cull_interval_s: Positive = 30.0
    sample_interval_s: Positive = 5.0
    snapshot_interval_s: Positive = 100.0
    population_limit: AtLeastOne = 30
    population_floor: AtLeastOne = 8
    survive_share_of_mean: NotNegative = 0.7
    full_cull_share: Probability = 0.7
    birth_radius_m: NotNegative = 2.0
    birth_distance_m: NotNegative = 0.25
    birth_place_tries: AtLeastOne = 5
    drop_m: NotNegative = 0.25
    wall_diameter_m: NotNegative = 0.0
    wall_segments: Annotated[int, Meta(ge=3)] = 12
    wall_height_m: Positive = 1.0
    wall_thickness_m: Positive = 0.05
    light: tuple[float, float, float] | None = None
    record_touches: bool = False
    proximity_steps: AtLeastOne = 8
    merge_distance_m: NotNegative = 0.02
    split_distance_m: NotNegative = 0.06


class Experiment(_Section, frozen=True):
    """One experiment; ``births`` counts the initial population."""

    name: str
    births: AtLeastOne = 3000
    space: Space = Space()
    generation: Generation = Generation()
    variation: Variation = Variation()
    selection: Selection = Selection()
    vetting: Vetting = Vetting()
    simulation: Simulation = Simulation()
    fitness: Fitness = Fitness()
    arena: Arena | None = None

    @property
    def window(self) -> int:
        """Births in flight at once: a whole brood unless the document says less."""
        return self.selection.window or self.selection.children


class VettingSettings(_Section, frozen=True):
    """What an analyzer's answer depends on, beside the robot."""

    space: Space
    vetting: Vetting


class EvaluationSettings(_Section, frozen=True):
    """What a worker's answer depends on, beside the robot."""

    space: Space
    simulation: Simulation
    fitness: Fitness


class ArenaSettings(_Section, frozen=True):
    """What an arena's advances depend on, beside its state and its changes."""

    space: Space
    simulation: Simulation
    fitness: Fitness
    arena: Arena


def vetting_settings(experiment: Experiment) -> bytes:
    """Return the JSON that goes with every vetting request."""
    return msgspec.json.encode(
        VettingSettings(space=experiment.space, vetting=experiment.vetting)
    )


def evaluation_settings(experiment: Experiment) -> bytes:
    """Return the JSON that goes with every evaluation request."""
    return msgspec.json.encode(
        EvaluationSettings(
            space=experiment.space,
            simulation=experiment.simulation,
            fitness=experiment.fitness,
        )
    )


def arena_settings(experiment: Experiment) -> bytes:
    """Return the JSON that goes with every request about the experiment's arena.

    Raises:
        ExperimentError: an off-line experiment.
    """
    if experiment.arena is None:
        raise ExperimentError(f"{experiment.name}: has no arena")
    return msgspec.json.encode(
        ArenaSettings(
            space=experiment.space,
            simulation=experiment.simulation,
            fitness=experiment.fitness,
            arena=experiment.arena,
        )
    )


@lru_cache(maxsize=64)
def read_arena_settings(settings: bytes) -> ArenaSettings:
    """Return the settings of a request to advance an arena.

    Raises:
        ExperimentError: not such settings.
    """
    return _from_json(settings, ArenaSettings)


@lru_cache(maxsize=64)
def read_vetting_settings(settings: bytes) -> VettingSettings:
    """Return the settings of a vetting request.

    Raises:
        ExperimentError: not such settings.
    """
    return _from_json(settings, VettingSettings)


@lru_cache(maxsize=64)
def read_evaluation_settings(settings: bytes) -> EvaluationSettings:
    """Return the settings of an evaluation request.

    Raises:
        ExperimentError: not such settings.
    """
    return _from_json(settings, EvaluationSettings)


def _from_json(settings: bytes, kind: type[T]) -> T:
    try:
        return msgspec.json.decode(settings, type=kind)
    except msgspec.MsgspecError as error:
        raise ExperimentError(f"settings of a request: {error}") from None


@lru_cache(maxsize=64)
def body_space(space: Space) -> BodySpace:
    """Return the part types that a document names, by name, in its order.

    Raises:
        UnknownPlugin: a name that nothing answers to.
        ExperimentError: not a part type, two of one name, or not exactly one core.
    """
    types: dict[str, PartType] = {}
    for path in space.part_types:
        kind = load(path, "space.part_types")
        if not isinstance(kind, PartType):
            raise ExperimentError(f"space.part_types: {path!r} is not a PartType")
        if kind.name in types:
            raise ExperimentError(f"space.part_types: two types named {kind.name!r}")
        types[kind.name] = kind if space.planar else _freed(kind)
    cores = [name for name, kind in types.items() if kind.is_root]
    if len(cores) != 1:
        raise ExperimentError(
            f"space.part_types: needs exactly one core, got {len(cores)} {cores}"
        )
    return types


def _freed(kind: PartType) -> PartType:
    """Return a bar that may also twist: only planar bodies hold beta at 0."""
    return replace(
        kind,
        own_parameters=tuple(
            Parameter("beta", 0.0, pi, 0.0) if parameter.name == "beta" else parameter
            for parameter in kind.own_parameters
        ),
    )


def read_experiment(source: str) -> Experiment:
    """Return a shipped experiment by its name, or one from a TOML file.

    Args:
        source: ``scenario1``, or a path that ends in ``.toml``.

    Raises:
        ExperimentError: no such experiment or file, or a document that is not one.
    """
    if source.endswith(".toml"):
        try:
            text = Path(source).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ExperimentError(f"{source}: cannot be read: {error}") from None
        return parse_experiment(text, source)
    shipped = shipped_experiments()
    if source not in shipped:
        near = nearest(source, shipped)
        raise ExperimentError(
            f"{source}: no such experiment{near}; "
            f"shipped are {', '.join(shipped)}, or give a path to a .toml file"
        )
    folder = resources.files("coordinator") / "experiments"
    text = (folder / f"{source}.toml").read_text(encoding="utf-8")
    return parse_experiment(text, f"{source}.toml")


def shipped_experiments() -> list[str]:
    """Return the names of the experiments that come with the package."""
    folder = resources.files("coordinator") / "experiments"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def parse_experiment(text: str, where: str) -> Experiment:
    """Return the experiment of a TOML text.

    Args:
        text: the document.
        where: its name, for messages.

    Raises:
        ExperimentError: bad TOML, an unknown key (the nearest is named), a wrong
            type or a value outside its range, or values that exclude each other.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ExperimentError(f"{where}: not TOML: {error}") from None
    _refuse_unknown(document, Experiment, where, "")
    try:
        experiment = msgspec.convert(document, type=Experiment)
    except msgspec.ValidationError as error:
        raise ExperimentError(f"{where}: {_explain(error, document)}") from None
    check_experiment(experiment, where)
    return experiment


def experiment_text(experiment: Experiment) -> str:
    """Return an experiment as one line of JSON, every default written out."""
    return msgspec.json.encode(experiment).decode()


def experiment_from_text(text: str) -> Experiment:
    """Return the experiment that ``experiment_text`` wrote.

    Raises:
        ExperimentError: not such a text.
    """
    return _from_json(text.encode(), Experiment)


def nearest(word: str, words: Any) -> str:  # noqa: ANN401 - any iterable of str
    """Return ``; did you mean 'x'?`` for the nearest word, or nothing."""
    found = get_close_matches(word, list(words), n=1, cutoff=0.5)
    return f"; did you mean {found[0]!r}?" if found else ""


def _refuse_unknown(
    document: dict[str, Any], kind: type[Struct], where: str, prefix: str
) -> None:
    """Raise for a key that a section does not have, or a number that is none."""
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    for key, value in document.items():
        if key not in fields:
            raise ExperimentError(
                f"{where}: {prefix}{key}: no such key{nearest(key, fields)}; "
                f"allowed: {', '.join(fields)}"
            )
        for number in value if isinstance(value, list) else (value,):
            if isinstance(number, float) and not isfinite(number):
                raise ExperimentError(
                    f"{where}: {prefix}{key}: must be finite, got {number}"
                )
        inner = _section(fields[key].type)
        if inner is not None:
            if not isinstance(value, dict):
                raise ExperimentError(f"{where}: {prefix}{key}: must be a table")
            _refuse_unknown(value, inner, where, f"{prefix}{key}.")


def _section(kind: Any) -> type[Struct] | None:  # noqa: ANN401 - any annotation
    """Return the section that a key holds, be it optional; None if a plain value."""
    for each in (kind, *get_args(kind)):
        if isinstance(each, type) and issubclass(each, Struct):
            return each
    return None


def _explain(error: msgspec.ValidationError, document: dict[str, Any]) -> str:
    """Return msgspec's message as ``key: expected, got value``."""
    message, _, path = str(error).partition(" - at `$.")
    key = path.rstrip("`")
    value: Any = document
    for name in key.split(".") if key else ():
        name, _, index = name.partition("[")  # noqa: PLW2901 - one word, then its index
        value = value.get(name) if isinstance(value, dict) else None
        if index and isinstance(value, list):
            value = value[int(index.rstrip("]"))]
    return f"{key}: {message}, got {value!r}" if key else message


def check_experiment(experiment: Experiment, where: str) -> None:
    """Raise unless the sections of an experiment fit each other.

    Raises:
        ExperimentError: a restriction that no robot can meet, a selection that
            cannot draw its parents, a window that ends between two samples, an
            arena too small or with clocks that do not meet, a plug-in that does
            not exist.
    """
    checks: list[Callable[[Experiment], str]] = [
        _limits_problem,
        _selection_problem,
        _clock_problem,
        _arena_problem,
        _arena_clock_problem,
    ]
    for check in checks:
        if problem := check(experiment):
            raise ExperimentError(f"{where}: {problem}")
    types = body_space(experiment.space)
    core = next(kind for kind in types.values() if kind.is_root)
    if core.inputs > experiment.space.max_inputs:
        raise ExperimentError(
            f"{where}: space.max_inputs: must be >= {core.inputs}, the inputs of "
            f"{core.name}, got {experiment.space.max_inputs}"
        )
    if not any(kind.outputs for kind in types.values()):
        raise ExperimentError(f"{where}: space.part_types: none of them has a motor")


def _limits_problem(experiment: Experiment) -> str:
    space = experiment.space
    if space.min_parts > space.max_parts:
        return (
            f"space.min_parts: must be <= space.max_parts = {space.max_parts}, "
            f"got {space.min_parts}"
        )
    return "" if space.max_parts > 1 else "space.max_parts: must be > 1, got 1"


def _selection_problem(experiment: Experiment) -> str:
    selection = experiment.selection
    needed = selection.tournament_size + 1
    if selection.parents == "tournament" and selection.population < needed:
        return (
            f"selection.population: a tournament of {selection.tournament_size} for "
            f"two parents needs >= {needed}, got {selection.population}"
        )
    if selection.parents == "random" and selection.population < 2:  # noqa: PLR2004
        return "selection.population: two parents need >= 2, got 1"
    if not selection.keep_parents and selection.children < selection.population:
        return (
            "selection.children: must be >= selection.population = "
            f"{selection.population} where parents are not kept, "
            f"got {selection.children}"
        )
    if experiment.births < selection.population:
        return (
            f"births: must be >= selection.population = {selection.population}, "
            f"got {experiment.births}"
        )
    if experiment.window > selection.children:
        return (
            f"selection.window: must be <= selection.children = "
            f"{selection.children}, got {experiment.window}"
        )
    return ""


def _clock_problem(experiment: Experiment) -> str:
    clock = experiment.simulation
    if clock.window_steps % clock.pose_steps:
        return (
            "simulation.window_steps: must be a multiple of simulation.pose_steps = "
            f"{clock.pose_steps}, got {clock.window_steps}"
        )
    return ""


def steps_of(seconds: float, simulation: Simulation) -> int:
    """Return a time in physics steps, rounded."""
    return round(seconds / simulation.timestep_s)


def _arena_problem(experiment: Experiment) -> str:
    arena, selection = experiment.arena, experiment.selection
    if arena is None:
        return ""
    if selection.survivors != "best" or not selection.keep_parents:
        return (
            "selection: the survivors of an arena are those that are fit enough; "
            'survivors must be "best" and keep_parents true'
        )
    needed = selection.parents_needed
    if arena.population_floor < needed:
        return (
            f"arena.population_floor: must be >= {needed}, so that there are always "
            f"two parents to choose, got {arena.population_floor}"
        )
    lowest = max(arena.population_floor, selection.population)
    if arena.population_limit < lowest:
        return (
            "arena.population_limit: must be >= arena.population_floor and "
            f"selection.population, {lowest}, got {arena.population_limit}"
        )
    if arena.split_distance_m < arena.merge_distance_m:
        return (
            "arena.split_distance_m: must be >= arena.merge_distance_m = "
            f"{arena.merge_distance_m}, got {arena.split_distance_m}"
        )
    return ""


def _arena_clock_problem(experiment: Experiment) -> str:
    """Decisions fall on brain ticks and on poses; all else would be half a state."""
    arena, clock = experiment.arena, experiment.simulation
    if arena is None:
        return ""
    for name in ("founder", "birth", "cull", "sample", "snapshot"):
        seconds: float = getattr(arena, f"{name}_interval_s")
        steps = steps_of(seconds, clock)
        tick = lcm(clock.brain_steps, clock.pose_steps)
        is_whole = isclose(steps * clock.timestep_s, seconds, rel_tol=1e-9)
        if not (steps and is_whole) or steps % tick:
            return (
                f"arena.{name}_interval_s: must be a whole multiple of "
                f"{tick * clock.timestep_s:g} s, where simulation.brain_steps and "
                f"pose_steps meet, got {seconds:g}"
            )
    if clock.warmup_steps % clock.pose_steps:
        return (
            "simulation.warmup_steps: must be a multiple of simulation.pose_steps = "
            f"{clock.pose_steps}, got {clock.warmup_steps}"
        )
    return ""


def fitness_function(fitness: Fitness) -> Callable[..., float]:
    """Return the function that a document names.

    Raises:
        UnknownPlugin: a name that nothing answers to.
        ExperimentError: not a function.
    """
    function = load(fitness.function, "fitness.function")
    if not callable(function):
        raise ExperimentError(f"fitness.function: {fitness.function!r} is no function")
    return cast("Callable[..., float]", function)
