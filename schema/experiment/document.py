"""The experiment document: everything that may change a birth.

A TOML file; every key has the thesis's value as its default, and a key that does
not exist is refused with the nearest name that does. What may not change a birth
(workers, folders, addresses) is a flag of the command, not a key.
"""

from dataclasses import replace
from functools import cached_property, lru_cache
from math import pi
from typing import Annotated, Literal

from msgspec import Meta, structs

from schema.errors import ExperimentError
from schema.experiment.environment import FLAT, Environment
from schema.experiment.migration import Migration
from schema.experiment.plugin import load
from schema.experiment.section import (
    AtLeastOne,
    Count,
    NotNegative,
    Positive,
    Probability,
    Section,
)
from schema.parts import BodySpace, Parameter, PartType


class Space(Section, frozen=True):
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


class Generation(Section, frozen=True):
    """How a random robot is made (thesis section 4.4.2)."""

    parts_mean: float = 12.0
    parts_sd: NotNegative = 5.0
    p_connect_neurons: Probability = 0.1
    hidden_on: Literal["any", "wired"] = "any"
    max_tries: AtLeastOne = 100


class Variation(Section, frozen=True):
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


class Culling(Section, frozen=True):
    """The survivors' rule of an arena for an off-line population of varying size.

    Every ``interval`` births after the founders, and whenever ``population_limit``
    is reached, those go who are below a share of the mean fitness; in a full
    population without any such, a share of the limit. ``population_floor`` stay.
    Source: Hupkes 2016, sections 5.3.3 and 8.2; two births are what an arena's cull
    interval comes to.
    """

    interval: AtLeastOne = 2
    population_limit: AtLeastOne = 30
    population_floor: AtLeastOne = 8
    survive_share_of_mean: NotNegative = 0.7
    full_cull_share: Probability = 0.7


class Reevaluation(Section, frozen=True):
    """A share of the living is judged anew every ``interval`` births.

    Whose last judgement is the oldest comes first; of equals, the elder. The new
    fitness replaces the old one, or ``mean`` of all of them counts. Source: Hupkes
    2016, section 8.2.
    """

    interval: AtLeastOne = 15
    share: Annotated[float, Meta(gt=0, le=1)] = 0.2
    fitness: Literal["replace", "mean"] = "replace"


class Selection(Section, frozen=True, dict=True):
    """Who mates and who lives on (thesis section 5.3).

    With ``culling`` the population varies in size, and ``population`` is the number
    of founders; with ``reevaluation`` a fitness is not for life.
    """

    population: AtLeastOne = 15
    children: AtLeastOne = 15
    window: AtLeastOne | None = None
    parents: Literal["tournament", "random", "none"] = "tournament"
    tournament_size: AtLeastOne = 4
    survivors: Literal["best", "random"] = "best"
    keep_parents: bool = True
    max_mating_attempts: AtLeastOne = 5
    culling: Culling | None = None
    reevaluation: Reevaluation | None = None

    @cached_property
    def parents_needed(self) -> int:
        """How many must be there to choose two parents from; 0 if none is chosen."""
        needs = {"tournament": self.tournament_size + 1, "random": 2, "none": 0}
        return needs[self.parents]


class Vetting(Section, frozen=True):
    """Which bodies can be built: ``overlap`` allows touching, ``contact`` not."""

    mode: Literal["overlap", "contact"] = "overlap"
    tolerance_m: NotNegative = 1e-6


NoiseLevel = Annotated[float, Meta(ge=0, le=1e6)]
"""A standard deviation; no robot's arithmetic overflows within these bounds."""


class Simulation(Section, frozen=True):
    """The simulated world and its clocks, in physics steps.

    ``armature`` and, at driven joints, ``servo_armature`` [kg m2], ``damping`` and
    ``servo_stiffness`` [N m s/rad] and ``contact_time_s`` are what MuJoCo needs
    beyond the original's numbers; their effect is measured in docs/physics.md. A
    servo chatters above a stiffness of 2 servo_armature / timestep_s.

    Off-line, ``evaluation_s`` [s] has every evaluation last a time of its own, drawn
    uniformly between the two, warm-up included; the window is its last part.

    ``sensor_noise`` and ``actuator_noise`` are standard deviations of what is drawn
    anew, from a normal distribution, at every tick of the brain: for each reading,
    in the reading's own unit (m/s2 and rad/s of an imu, touch and light from 0 to
    1), and for each output before it is clipped to [0, 1], the range of its joint.
    The network's own memory is not touched. At 0 nothing is drawn.
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
    evaluation_s: tuple[Positive, Positive] | None = None
    sensor_noise: NoiseLevel = 0.0
    actuator_noise: NoiseLevel = 0.0


class Fitness(Section, frozen=True):
    """What is maximised: a function ``module:attribute`` and its weights."""

    function: str = "worker.fitness:thesis"
    path_weight: float = 1.0
    straight_weight: float = 5.0
    limit: Positive = 1.0


class Arena(Section, frozen=True):
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


class Islands(Section, frozen=True):
    """Some islands, and what is different on them; None is as in the document.

    A section that a document holds here changes its own keys only; read, it is
    whole.
    """

    count: AtLeastOne = 1
    births: AtLeastOne | None = None
    generation: Generation | None = None
    variation: Variation | None = None
    selection: Selection | None = None
    simulation: Simulation | None = None
    environment: Environment | None = None
    fitness: Fitness | None = None
    arena: Arena | None = None
    migration: Migration | None = None


class Experiment(Section, frozen=True, dict=True):
    """One experiment; ``births`` counts the initial population.

    Without ``islands`` it is one island. With them they are numbered from 0, in the
    order of the document, and ``births`` counts on each.
    """

    name: str
    births: AtLeastOne = 3000
    space: Space = Space()
    generation: Generation = Generation()
    variation: Variation = Variation()
    selection: Selection = Selection()
    vetting: Vetting = Vetting()
    simulation: Simulation = Simulation()
    environment: Environment = FLAT
    fitness: Fitness = Fitness()
    arena: Arena | None = None
    islands: tuple[Islands, ...] = ()
    migration: Migration | None = None

    @cached_property
    def window(self) -> int:
        """Births in flight at once: a whole brood unless the document says less."""
        return self.selection.window or self.selection.children


def island_count(experiment: Experiment) -> int:
    """Return how many islands an experiment has."""
    return sum(islands.count for islands in experiment.islands) or 1


@lru_cache(maxsize=1024)
def island_experiment(experiment: Experiment, number: int) -> Experiment:
    """Return what is done on one island, as an experiment of its own.

    Its ``migration`` is the island's; it names no ``islands``.

    Raises:
        ValueError: it has no island of that number.
    """
    count = island_count(experiment)
    if not 0 <= number < count:
        raise ValueError(f"island must be in 0..{count - 1}, got {number}")
    changes: dict[str, object] = {}
    for islands in experiment.islands:
        if number < islands.count:
            changes = structs.asdict(islands)
            break
        number -= islands.count
    changes.pop("count", None)
    changes = {name: value for name, value in changes.items() if value is not None}
    return structs.replace(experiment, islands=(), **changes)


def with_births(experiment: Experiment, births: int) -> Experiment:
    """Return an experiment that ends, on each of its islands, at ``births``."""
    islands = tuple(structs.replace(each, births=None) for each in experiment.islands)
    return structs.replace(experiment, births=births, islands=islands)


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


def steps_of(seconds: float, simulation: Simulation) -> int:
    """Return a time in physics steps, rounded."""
    return round(seconds / simulation.timestep_s)
