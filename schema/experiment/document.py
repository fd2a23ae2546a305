"""The experiment document: all settings that can change a birth.

It is a TOML file. Each key has the thesis's value as its default. An unknown key is
refused with the nearest known one. Settings that cannot change a birth (workers,
folders, addresses) are flags of the commands, not keys.
"""

from dataclasses import replace
from functools import cached_property, lru_cache
from math import pi
from typing import Annotated, Literal

from msgspec import Meta, field, structs, to_builtins

from schema.errors import ExperimentError
from schema.experiment.changes import SettingChange
from schema.experiment.environment import FLAT, Environment
from schema.experiment.grid import Grid
from schema.experiment.learning import Learning
from schema.experiment.migration import Migration
from schema.experiment.robust import Calibration, NoiseLevel, Robust
from schema.experiment.section import (
    Angle,
    AtLeastOne,
    Extent,
    Index,
    Length,
    Limit,
    NotNegative,
    Number,
    Parameters,
    Place,
    PluginSection,
    Positive,
    Probability,
    Section,
    Size,
)
from schema.experiment.sweep import Sweep
from schema.limits import (
    MOST_GEOMS,
    MOST_ISLAND_TABLES,
    MOST_ISLANDS,
    MOST_MEASURES,
    MOST_NEURONS,
    MOST_PARTS,
)
from schema.parts import BodySpace, Parameter, PartType, Vector
from schema.plugins.load import load_object
from schema.plugins.part_checks import check_part_type
from schema.plugins.source import paths_named

Neurons = Annotated[int, Meta(ge=0, le=MOST_NEURONS)]
Evaluated = Annotated[float, Meta(gt=0, le=1e6)]
REVOLVE_ANGLE = "revolve-angle"
"""Name of the encoding of the thesis."""


class Space(Section, frozen=True):
    """Part types and limits of robots (thesis tables 4.1, 5.1).

    Attributes:
        part_types: ``module:attribute`` of each; exactly one is a core.
        min_parts: least number of parts, core included.
        max_parts: greatest number of parts, core included.
        max_inputs: greatest number of input neurons.
        max_outputs: greatest number of output neurons, one for each motor.
        max_hidden: greatest number of hidden neurons.
        planar: keep all parts in the plane of the core. Other bodies may be tall, and a
            fall at the start counts as motion unless ``simulation.warmup_steps`` has
            passed.
        neuron_types: types of output and hidden neurons: short names of built-in
            types, or ``module:attribute``; each is equally likely.
    """

    part_types: tuple[str, ...] = (
        "schema.parts:CORE",
        "schema.parts:FIXED_BRICK",
        "schema.parts:ACTIVE_HINGE",
        "schema.parts:HINGE",
        "schema.parts:PARAMETRIC_BAR_JOINT",
        "schema.parts:TOUCH_SENSOR",
    )
    min_parts: Annotated[int, Meta(ge=1, le=MOST_PARTS)] = 3
    max_parts: Size = 30
    max_inputs: Neurons = 10
    max_outputs: Annotated[int, Meta(ge=1, le=MOST_NEURONS)] = 10
    max_hidden: Neurons = 10
    planar: bool = True
    neuron_types: tuple[str, ...] = ("Simple", "Sigmoid", "Oscillator")


class BrainSection(PluginSection, frozen=True):
    """The type of all brains of an experiment.

    Attributes:
        type: short name of a built-in type, or ``module:attribute``: ``network`` is
            the thesis's recurrent network of ``space.neuron_types``, ``cpg`` couples
            an oscillator for each motor, ``modular`` has a small network of common
            weights for each part.
        parameters: parameters of the type.
    """

    type: str = "network"
    parameters: Parameters = field(default_factory=dict)


NETWORK = BrainSection()
"""The thesis's brains."""


class Generation(Section, frozen=True):
    """Generation of random robots (thesis section 4.4.2).

    Attributes:
        parts_mean: mean of the number of parts, which has a normal distribution; a
            number beyond ``min_parts`` or ``max_parts`` of ``[space]`` becomes that
            limit.
        parts_sd: standard deviation of the number of parts.
        p_connect_neurons: probability of each possible connection.
        max_tries: attempts per robot; after these the run stops with an error.
    """

    parts_mean: Number = 12.0
    parts_sd: NotNegative = 5.0
    p_connect_neurons: Probability = 0.1
    max_tries: AtLeastOne = 100


class Variation(Section, frozen=True):
    """Mutation of offspring (thesis section 4.4.6).

    As many parts are added as deletion removes, less those that duplication adds, on
    average.

    Attributes:
        p_delete_subtree: probability that a part and all below it are removed.
        p_duplicate_subtree: probability that a part and all below it are copied to a
            free slot.
        p_swap_subtree: probability that two parts change places, with all below them.
        p_delete_hidden_neuron: probability that a hidden neuron is removed; as many
            are added, on average.
        p_remove_brain_connection: probability that a connection is removed; as many
            are added, on average.
        body_epsilon: step size of the parameters of parts, as a share of the way to a
            random value.
        brain_epsilon: step size of the parameters of neurons, of ``cpg`` and
            ``modular`` brains also of weights, as a share of the way to a random value.
    """

    p_delete_subtree: Probability = 0.05
    p_duplicate_subtree: Probability = 0.1
    p_swap_subtree: Probability = 0.05
    p_delete_hidden_neuron: Probability = 0.05
    p_remove_brain_connection: Probability = 0.05
    body_epsilon: Probability = 0.05
    brain_epsilon: Probability = 0.1


class EncodingSection(PluginSection, frozen=True):
    """How genomes describe robots.

    Attributes:
        type: ``revolve-angle`` (thesis), ``cppn`` or ``module:attribute``.
        parameters: parameters of the encoding.
    """

    type: str = REVOLVE_ANGLE
    parameters: Parameters = field(default_factory=dict)


class Culling(Section, frozen=True):
    """Off-line survivor selection by the rule of an arena; the population varies.

    Robots below a share of the mean fitness are removed every ``interval`` births
    and whenever the population is full. If a full population has none of them, a
    share of it is removed. Source: Hupkes 2016, sections 5.3.3 and 8.2.

    Attributes:
        interval: births between removals, counted from the last founder; the default
            corresponds to ``arena.cull_interval_s``.
        population_limit: size of a full population.
        population_floor: number of robots that are always kept, the fittest.
        survive_share_of_mean: robots below it are removed; see ``arena``.
        full_cull_share: share of ``population_limit`` to remove.
    """

    interval: AtLeastOne = 2
    population_limit: AtLeastOne = 30
    population_floor: AtLeastOne = 8
    survive_share_of_mean: NotNegative = 0.7
    full_cull_share: Probability = 0.7


class Reevaluation(Section, frozen=True):
    """Re-evaluation of living robots.

    Robots whose last evaluation is the oldest come first; of equals, the older robot.
    Source: Hupkes 2016, section 8.2.

    Attributes:
        interval: births between re-evaluations, counted from the last founder.
        share: share of the population to re-evaluate, at least one robot.
        fitness: ``replace`` the old fitness, or take the ``mean`` of all evaluations.
    """

    interval: AtLeastOne = 15
    share: Annotated[float, Meta(gt=0, le=1)] = 0.2
    fitness: Literal["replace", "mean"] = "replace"


_OF_BOTH = ("novelty", "nsga2", "age-layered")
PARENTS = ("tournament", "random", "none", "curiosity", *_OF_BOTH)
SURVIVORS = ("best", "random", "map-elites", "dominated-novelty", *_OF_BOTH)
"""Names of the built-in rules of selection."""
FOUNDERS = ("last", "best", "archive")
"""Names of the populations of another run that may be founders."""
UNNAMED = ".founder.pb"
"""Ending of temporary files of given robots, whose paths say nothing."""


class SelectionSection(PluginSection, frozen=True):
    """Parent and survivor selection (thesis section 5.3).

    Attributes:
        population: number of individuals; with ``culling``, or survivors whose number
            varies, number of founders.
        children: births per generation.
        window: births in flight at once; ``children`` if not given.
        parents: selection of parents: ``tournament`` of fitness, ``random``, ``none``,
            which makes each child a random robot; tournaments of ``curiosity``,
            ``novelty``, ``nsga2`` or ``age-layered``; or ``module:attribute``.
        parents_parameters: parameters of the selection of parents.
        tournament_size: individuals per tournament.
        survivors: the ``best`` or ``random`` ones survive, those that ``map-elites``,
            ``dominated-novelty``, ``novelty``, ``nsga2`` or ``age-layered`` keep, or
            ``module:attribute``.
        survivors_parameters: parameters of the selection of survivors.
        keep_parents: parents compete with their children for survival.
        max_mating_attempts: attempts per birth before two new parents are chosen.
        culling: makes the population vary in size.
        reevaluation: re-evaluates living robots.
    """

    population: Size = 15
    children: Size = 15
    window: Size | None = None
    parents: str = "tournament"
    parents_parameters: Parameters = field(default_factory=dict)
    tournament_size: AtLeastOne = 4
    survivors: str = "best"
    survivors_parameters: Parameters = field(default_factory=dict)
    keep_parents: bool = True
    max_mating_attempts: AtLeastOne = 5
    culling: Culling | None = None
    reevaluation: Reevaluation | None = None

    @property
    def parents_needed(self) -> int:
        """Least population to choose two parents from; 0 if none are chosen."""
        if ":" in self.parents:
            return 2
        return {"random": 2, "none": 0}.get(self.parents, self.tournament_size + 1)


class FounderGenome(Section, frozen=True):
    """Content of a given founder, whatever path it came from.

    Attributes:
        digest: SHA-256 of the bytes of its genome, in hexadecimal.
        island: island of its birth in another run; None: of a file.
        birth: number of that birth.
    """

    digest: Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
    island: Index | None = None
    birth: Index | None = None


class Founders(Section, frozen=True):
    """Initial population from robot files or from another run, instead of random.

    Attributes:
        files: robot files, relative to the document; their encoding must be able to
            make genomes of robots.
        run: folder of a run, relative to the document; not together with ``files``.
        island: of that run; all islands if not given. Numbers of births are those of
            island 0 then.
        population: the fittest of the ``last`` population, of its ``archive``, or the
            ``best`` ever, up to ``selection.population``; or numbers of births.
        repeat: fill up by copies of these in order; otherwise by random robots.
        genomes: what these keys led to; ``revolve run`` sets it in their place.
    """

    files: tuple[str, ...] = ()
    run: str | None = None
    island: Index | None = None
    population: str | tuple[Index, ...] = "last"
    repeat: bool = False
    genomes: tuple[FounderGenome, ...] = ()


class Vetting(Section, frozen=True):
    """Checks of bodies before they are simulated.

    Attributes:
        mode: refuse parts that ``overlap``, or also parts in ``contact``.
        tolerance_m: least depth of an overlap, or greatest gap of a contact [m].
    """

    mode: Literal["overlap", "contact"] = "overlap"
    tolerance_m: Length = 1e-6


class Simulation(Section, frozen=True, dict=True):
    """Physics, noise, and clocks in physics steps.

    MuJoCo needs ``armature``, ``damping``, ``servo_armature``, ``servo_stiffness``
    and ``contact_time_s`` beyond the numbers of the thesis; docs/physics.md has their
    measured effect. Noise is drawn from normal distributions at every brain tick.

    Attributes:
        timestep_s: physics step [s].
        brain_steps: steps between brain ticks.
        pose_steps: steps between recorded poses.
        window_steps: steps of the fitness window.
        warmup_steps: steps before the window.
        gravity: acceleration of gravity [m/s2].
        friction: sliding friction coefficient of all contacts.
        armature: rotor inertia of passive joints [kg m2].
        damping: viscous damping of all joints [N m s/rad].
        servo_armature: rotor inertia of driven joints [kg m2].
        servo_stiffness: torque per error of angular velocity [N m s/rad]; a servo
            chatters above 2 servo_armature / timestep_s.
        contact_time_s: time constant of contacts [s].
        drop_m: height above the ground at the start [m].
        start_deg: attitude of the core at the start, off-line: roll, pitch and yaw
            about the world's x, y and z, in this order [degrees].
        mass_factor: factor of all masses of robots.
        torque_factor: factor of the greatest torque of all motors.
        evaluation_s: shortest and longest evaluation [s], warm-up included, off-line;
            each evaluation draws its own, and the window is its last part.
        sensor_noise: standard deviation of each reading [unit of the reading]: m/s2 and
            rad/s of an imu, 0 to 1 of touch and light.
        actuator_noise: standard deviation of each output before it is clipped to
            [0, 1], the range of its joint; the network's state has no noise.
    """

    timestep_s: Annotated[float, Meta(ge=1e-6, le=10)] = 0.005
    brain_steps: AtLeastOne = 25
    pose_steps: AtLeastOne = 40
    window_steps: AtLeastOne = 2400
    warmup_steps: Annotated[int, Meta(ge=0, le=10**9)] = 0
    gravity: NotNegative = 9.81
    friction: NotNegative = 1.0
    armature: NotNegative = 1e-4
    damping: NotNegative = 1e-4
    servo_armature: NotNegative = 5e-3
    servo_stiffness: Positive = 1.0
    contact_time_s: Positive = 0.01
    drop_m: Length = 0.0
    evaluation_s: tuple[Evaluated, Evaluated] | None = None
    sensor_noise: NoiseLevel = 0.0
    actuator_noise: NoiseLevel = 0.0
    start_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    mass_factor: Positive = 1.0
    torque_factor: Positive = 1.0

    @cached_property
    def tick_s(self) -> float:
        """Time between two brain ticks [s]."""
        return self.brain_steps * self.timestep_s

    @cached_property
    def evaluation_steps(self) -> int:
        """Physics steps of an evaluation, warm-up and window."""
        return self.warmup_steps + self.window_steps


class Fitness(PluginSection, frozen=True):
    """The function that evolution maximises.

    Attributes:
        function: short name of a built-in function, or ``module:attribute``;
            ``locomotion`` is another name of the default.
        path_weight: weight of the velocity along the path; only ``locomotion`` has it.
        straight_weight: weight of the velocity between the ends of the path; only
            ``locomotion`` has it.
        limit: greatest realistic fitness [m/s], above which it is 0; only
            ``locomotion`` has it.
        parameters: parameters of a function that has a Struct of its own.
    """

    function: str = "worker.fitness:thesis"
    path_weight: Number = 1.0
    straight_weight: Number = 5.0
    limit: Limit = 1.0
    parameters: Parameters = field(default_factory=dict)


class Measures(PluginSection, frozen=True, dict=True):
    """Numbers of a robot's life that are recorded beside its fitness.

    Attributes:
        names: short names of built-in measures, or ``module:attribute``.
        parameters: a table for each measure that has parameters, by short name or
            attribute.
    """

    names: Annotated[tuple[str, ...], Meta(max_length=MOST_MEASURES)] = ()
    parameters: dict[str, Parameters] = field(default_factory=dict)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of the measures in tables: short names and attributes."""
        return tuple(name.rpartition(":")[2] for name in self.names)


class ArenaWorld(PluginSection, frozen=True):
    """An on-line world: robots are born, evaluated all the time and die in it.

    Times are simulated. Source: Hupkes 2016, section 5.3.3, and the intervals of its
    code.

    Attributes:
        founder_interval_s: time between births of founders [s].
        birth_interval_s: time between later births [s].
        cull_interval_s: time between removals of weak robots [s].
        sample_interval_s: time between samples of fitness [s].
        snapshot_interval_s: time between saved states [s].
        population_limit: living robots at which births stop.
        population_floor: number of mature robots that removals always keep.
        survive_share_of_mean: mature robots below this share of their mean fitness
            are removed; the limit is as far below a negative mean as a positive one.
        full_cull_share: share of ``population_limit`` to remove if that many robots
            are mature and none is below the share of the mean.
        birth_radius_m: robots are born within this distance of the origin [m].
        birth_distance_m: least distance of a birth place from robots [m].
        birth_place_tries: places to try for that; the last one is used in any case.
        drop_m: height above the ground at birth [m].
        wall_diameter_m: diameter of the ring wall, more than twice the birth radius
            [m]; 0 is no wall.
        wall_segments: number of straight segments of the wall.
        wall_height_m: height of the wall [m].
        wall_thickness_m: thickness of the wall [m].
        light: as ``environment.light`` [m]; only one of the two is needed.
        patch_light_m: height of a light at the centre of each patch of the rules that
            is not empty [m]; 0: patches do not shine. A robot that is evaluated alone
            has one such light, at the origin.
        record_touches: write the table ``touches``.
        proximity_steps: physics steps between checks of distances.
        merge_distance_m: robots that may come nearer than this before the next check
            share a model [m].
        split_distance_m: robots farther apart than this get separate models [m].
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
    birth_radius_m: Length = 2.0
    birth_distance_m: Length = 0.25
    birth_place_tries: Size = 5
    drop_m: Length = 0.25
    wall_diameter_m: Length = 0.0
    wall_segments: Annotated[int, Meta(ge=3, le=MOST_GEOMS)] = 12
    wall_height_m: Extent = 1.0
    wall_thickness_m: Extent = 0.05
    light: Place | None = None
    patch_light_m: Length = 0.0
    record_touches: bool = False
    proximity_steps: AtLeastOne = 8
    merge_distance_m: Length = 0.02
    split_distance_m: Length = 0.06


class ArenaSection(ArenaWorld, frozen=True):
    """An arena, and the rules that decide who is born and who dies in it.

    Workers get what it inherits only.

    Attributes:
        rules: "thesis", "ecosystem", or ``module:Class`` of own rules. They decide at
            every multiple of ``birth_interval_s`` and ``cull_interval_s``. The limit,
            the floor and the shares above are those of "thesis"; with other rules the
            limit is the greatest number of living robots.
        parameters: of the rules.
        end_s: simulated time at which the run ends, whatever the number of births [s];
            0 is no such time.
    """

    rules: str = "thesis"
    parameters: Parameters = field(default_factory=dict)
    end_s: NotNegative = 0.0


class Islands(Section, frozen=True):
    """Islands with settings of their own.

    A section that is not given is as in the rest of the document. A section given here
    changes the keys that it names. After reading, it is complete.

    Attributes:
        count: number of such islands.
        births: number of births on each of these islands, the initial population
            included.
        generation: random robots of these islands.
        variation: mutation on these islands.
        selection: parent and survivor selection of these islands.
        simulation: physics, noise and clocks of these islands.
        environment: ground and scenery of these islands.
        fitness: fitness function of these islands.
        arena: these islands are arenas.
        migration: exchange of migrants from and to these islands.
        robust: evaluation of these islands' robots under drawn disturbances.
        learning: lifetime learning of these islands' newborns.
        founders: given founders of each of these islands.
        changes: of settings of these islands.
    """

    count: Annotated[int, Meta(ge=1, le=MOST_ISLANDS)] = 1
    births: AtLeastOne | None = None
    generation: Generation | None = None
    variation: Variation | None = None
    selection: SelectionSection | None = None
    simulation: Simulation | None = None
    environment: Environment | None = None
    fitness: Fitness | None = None
    arena: ArenaSection | None = None
    migration: Migration | None = None
    robust: Robust | None = None
    learning: Learning | None = None
    founders: Founders | None = None
    changes: tuple[SettingChange, ...] | None = None


class Experiment(Section, frozen=True, dict=True, cache_hash=True):
    """An experiment.

    Attributes:
        name: names the run folder: no ``/``, no ``.`` at its beginning.
        births: number of births on each island, the initial population included.
        space: part types and limits of robots, on all islands.
        generation: random robots.
        variation: mutation of offspring.
        selection: parent and survivor selection.
        vetting: checks of bodies before they are simulated, on all islands.
        simulation: physics, noise and clocks.
        environment: ground and scenery.
        fitness: the function that evolution maximises.
        arena: makes the islands arenas, in which robots live together; without it
            robots are evaluated one by one.
        islands: islands with settings of their own, numbered from 0 in the order of the
            document; none is one island.
        migration: topology, and exchange of migrants between the islands.
        measures: numbers recorded beside the fitness, on all islands.
        encoding: how genomes describe robots, on all islands.
        brain: type of the robots' brains, on all islands.
        robust: evaluation under drawn disturbances, off-line; without it robots are
            evaluated once.
        calibration: measured sensors and motors of part types, off-line, on all
            islands; a document may give the path of a file with these tables,
            relative to itself.
        sweep: makes the document a campaign of experiments that differ in some
            settings.
        learning: lifetime learning; without it newborns are evaluated with the brain
            that they inherit.
        founders: given founders of each island; without them all are random.
        changes: of settings, during the run.
        grid: cells over measures, for rules of selection and figures, on all islands.
    """

    name: str
    births: AtLeastOne = 3000
    space: Space = Space()
    generation: Generation = Generation()
    variation: Variation = Variation()
    selection: SelectionSection = SelectionSection()
    vetting: Vetting = Vetting()
    simulation: Simulation = Simulation()
    environment: Environment = FLAT
    fitness: Fitness = Fitness()
    arena: ArenaSection | None = None
    islands: Annotated[tuple[Islands, ...], Meta(max_length=MOST_ISLAND_TABLES)] = ()
    migration: Migration | None = None
    measures: Measures = Measures()
    encoding: EncodingSection = EncodingSection()
    brain: BrainSection = NETWORK
    robust: Robust | None = None
    calibration: tuple[Calibration, ...] = ()
    sweep: Sweep | None = None
    learning: Learning | None = None
    founders: Founders | None = None
    changes: tuple[SettingChange, ...] = ()
    grid: Grid | None = None

    @cached_property
    def window(self) -> int:
        """Births in flight at once: a whole generation by default."""
        return self.selection.window or self.selection.children


def island_count(experiment: Experiment) -> int:
    """Return how many islands an experiment has."""
    return sum(islands.count for islands in experiment.islands) or 1


@lru_cache(maxsize=1024)
def island_experiment(experiment: Experiment, number: int) -> Experiment:
    """Return the settings of one island as an experiment without ``islands``.

    Raises:
        ValueError: the experiment has no island of that number.
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


def island_experiments(experiment: Experiment) -> tuple[Experiment, ...]:
    """Return the settings of all islands, by number; see ``island_experiment``."""
    numbers = range(island_count(experiment))
    return tuple(island_experiment(experiment, number) for number in numbers)


def light_of(environment: Environment, arena: ArenaWorld | None) -> Vector | None:
    """Return the position of the light of a world [m]; None is no light."""
    own = None if arena is None else arena.light
    return own or environment.light


def is_lit(environment: Environment, arena: ArenaWorld | None) -> bool:
    """Return whether a world has a light, or patches that may shine."""
    shines = arena is not None and arena.patch_light_m > 0
    return shines or light_of(environment, arena) is not None


def references(experiment: Experiment) -> list[str]:
    """Return the ``module:attribute`` of all plug-ins that a document names.

    Short names of built-in plug-ins are left out.
    """
    return paths_named(to_builtins(experiment))


@lru_cache(maxsize=64)
def body_space(space: Space) -> BodySpace:
    """Return the part types of a document by name, in its order.

    Raises:
        ExperimentError: a wrong type, two of one name, or not exactly one core.
    """
    types: dict[str, PartType] = {}
    for path in space.part_types:
        kind = load_object(path, "space.part_types", {}, kind=PartType)
        if kind.name in types:
            what = f"two part types are named {kind.name!r}"
            raise ExperimentError(f"space.part_types: {what}")
        types[kind.name] = kind if space.planar else _freed(kind)
        check_part_type(types[kind.name], "space.part_types")
    cores = [name for name, kind in types.items() if kind.is_root]
    if len(cores) != 1:
        got = f"{len(cores)} {cores}"
        raise ExperimentError(f"space.part_types: must contain one core, got {got}")
    return types


def _freed(kind: PartType) -> PartType:
    """Return a part type whose beta may vary; in planar bodies it is 0."""
    free = Parameter("beta", 0.0, pi, 0.0, unit="rad")
    own = (free if each.name == "beta" else each for each in kind.own_parameters)
    return replace(kind, own_parameters=tuple(own))


def steps_of(seconds: float, simulation: Simulation) -> int:
    """Return a duration [s] as a number of physics steps, rounded."""
    return round(seconds / simulation.timestep_s)
