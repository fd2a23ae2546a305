"""Protocols of plug-ins: what each kind gets and returns."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np
from msgspec import Struct

from schema.parts import Parameter, PartType, Vector
from schema.robot.brain import Brain, Layer, NeuronKinds, Widths
from schema.robot.genome import ConnectionGene, NeuronGene
from schema.robot.ids import BirthId
from schema.robot.neurons import Tick
from schema.robot.robot import Robot
from schema.robot.trace import Floats, Trace
from schema.robot.trees import Integers

T = TypeVar("T")

Genome = TypeVar("Genome")
"""Type of the genomes of an encoding: immutable, compared by value."""
Made_co = TypeVar("Made_co", covariant=True)


class Encoding(Protocol[Genome]):
    """Encoding of robots in genomes, ``encoding.type``; runs in analyzers.

    The experiment names a class. It is called once for each island, as
    ``Class(experiment, types, parameters)``: the settings of the island, whose
    limits of robots are ``experiment.space``; the part types by name; and the
    parameters: an instance of the msgspec Struct that the class has as its attribute
    ``Parameters``, read from the table ``[encoding.parameters]``; None without it.

    All methods are pure functions of the object and their arguments: no clock, file
    or global random state, and nothing is kept from one call to the next. ``rng`` is
    a ``numpy.random.Generator`` (PCG64) that belongs to this attempt at this birth
    alone, ``SeedSequence(seed, spawn_key=(run, island, birth, attempt, purpose))``;
    `crossover` and `mutate` of one attempt get the same one, in this order. Draw from
    nothing else: then births do not depend on the number of workers.

    The run ends with one line if a method raises. A robot that breaks a limit of
    ``[space]`` counts as a failed attempt at its birth.
    """

    def random(self, rng: np.random.Generator, birth: BirthId) -> Genome:
        """Return the genome of a random robot.

        Identities of its genes may derive from the birth's id.
        """

    def develop(self, genome: Genome) -> Robot:
        """Return the robot that a genome describes.

        The robot is well formed (``check_robot``) and within the limits of
        ``[space]``: numbers of parts, inputs, outputs and hidden neurons; planar if
        the experiment says so. Whether its parts intersect, and whether it has a
        motor, is checked later.
        """

    def crossover(
        self, first: Genome, second: Genome, rng: np.random.Generator
    ) -> Genome | None:
        """Return a genome made of two parents', or None if they cannot mate.

        ``second`` is the parent that was selected second.
        """

    def mutate(
        self, genome: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return a mutated genome, or None if no robot may develop from it.

        ``genome`` is what `crossover` returned, ``rng`` as it left it; identities of
        new genes may derive from the child's id.
        """

    def to_bytes(self, genome: Genome) -> bytes:
        """Return a genome as bytes, for tables and the journal; at most 1 MiB."""

    def from_bytes(self, data: bytes) -> Genome:
        """Return the genome that `to_bytes` wrote.

        Raises:
            ValueError: other bytes.
        """


@runtime_checkable
class OneStepMating(Protocol[Genome]):
    """Encoding that crosses and mutates in one step; the two methods are not called."""

    def mate(
        self, first: Genome, second: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return the genome of a child, or None; arguments as of the two methods."""


@runtime_checkable
class RobotEncoding(Protocol[Made_co]):
    """Encoding that can describe a given robot.

    Only with such an encoding can robot files be founders, or be inserted into an arena
    by an operator.
    """

    def from_robot(self, robot: Robot) -> Made_co:
        """Return a genome from which a robot develops.

        Raises:
            ValueError: the encoding cannot describe this robot.
        """


class SensorView(Protocol):
    """What a sensor of a plug-in sees at a tick: its part, and what is around it.

    The view is valid during ``read`` only. Names of boxes are those of the part's
    shape; cylinders count as boxes. An unknown name raises ``KeyError``.
    """

    @property
    def age_s(self) -> float:
        """Simulated time since the robot's birth [s]."""

    @property
    def joint_angle(self) -> float:
        """Angle [rad] or displacement [m] of the part's joint; 0 without a joint."""

    @property
    def joint_speed(self) -> float:
        """Velocity of the part's joint [rad/s] or [m/s]; 0 without a joint."""

    @property
    def light(self) -> Vector | None:
        """Position of the light, world frame [m]; None in a world without light."""

    @property
    def others(self) -> Floats:
        """Centres of the cores of all other robots, (N, 3), world frame [m].

        By birth; N = 0 off-line.
        """

    def position(self, box: str) -> Floats:
        """Return the centre of a box, (3,), world frame [m]."""

    def rotation(self, box: str) -> Floats:
        """Return the rotation from a box's frame to the world frame, (3, 3)."""

    def touches(self, box: str) -> bool:
        """Return whether a box was in contact in the last step.

        Contacts with its own rigid segment, or one that a joint connects to it, do
        not exist.
        """

    def distance(
        self, box: str, direction: Vector, reach: float, start: Vector = (0.0, 0.0, 0.0)
    ) -> float:
        """Return how far a ray gets [m].

        The ray passes through the rigid segment of the box and meets everything else:
        the ground, scenery, other robots, and other segments of its own robot.

        Args:
            box: that sends the ray.
            direction: of the ray, of length 1, in the frame of the box.
            reach: length of the ray [m].
            start: of the ray, in the frame of the box [m].

        Returns:
            Distance from ``start`` to what the ray meets first, or ``reach``.
        """


class SensorType(Protocol):
    """Sensor of a plug-in: an object in ``PartType.sensors``.

    It has no state: ``read`` is a pure function of the view. One object serves all
    parts of its type, of all robots, off-line and in arenas, and an arena that moves
    to another machine continues with equal readings. What ``read`` raises, a wrong
    number of values, or one that is not finite, ends the evaluation of the robot as
    failed, or its life in an arena; the reason names the sensor.
    """

    @property
    def inputs(self) -> int:
        """Number of network inputs, at least 1; always the same."""

    def read(self, view: SensorView, /) -> Sequence[float]:
        """Return the values of the inputs, finite, at every tick of the brain.

        Noise of the experiment is added afterwards.
        """


class NeuronType(Protocol):
    """Type of output and hidden neurons: ``space.neuron_types``; runs in workers.

    The experiment names an object, or a class that is instantiated without arguments.
    At each tick, ``step`` computes all neurons of this type of all robots together.
    Each neuron must be computed independently of the others, so that a robot moves
    equally alone and among others: use elementwise NumPy only.
    """

    @property
    def name(self) -> str:
        """Name in robot files and tables; unique in an experiment."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Evolving parameters of each neuron, at least in this range."""

    @property
    def states(self) -> int:
        """Number of state variables of a neuron, K >= 1; all start at 0."""

    def step(
        self, state: Floats, inputs: Floats, parameters: Floats, tick: Tick
    ) -> Floats:
        """Return the states of N neurons after a tick, and change no argument.

        Args:
            state: (K, N); the first row holds the outputs of the previous tick.
            inputs: (N,) weighted sums of the sensors and of the previous outputs.
            parameters: (P, N) in the order of ``parameters``.
            tick: ages of the robots and time since the previous tick.

        Returns:
            (K, N), finite; the first row holds the new outputs. Motors clip outputs
            to [0, 1]; all states are clipped to [-1e6, 1e6].
        """


class Draws(Protocol):
    """Random choices for a birth; the only allowed source of randomness."""

    @property
    def number(self) -> Callable[[], float]:
        """Function that returns the next number, uniform in [0, 1)."""

    def chance(self, probability: float) -> bool:
        """Return true with a probability; never for 0, always for 1."""

    def below(self, count: int) -> int:
        """Return an integer, uniform in 0..count - 1; count >= 1."""

    def pick(self, items: Sequence[T]) -> T:
        """Return one item, uniformly; there must be at least one."""

    def rounded(self, expected: float) -> int:
        """Return a neighbouring integer whose mean is ``expected``, >= 0."""

    def values(self, parameters: Sequence[Parameter]) -> tuple[float, ...]:
        """Return one value for each parameter, uniform in its range."""

    def nearby(
        self, parameters: Sequence[Parameter], values: Sequence[float], epsilon: float
    ) -> tuple[float, ...]:
        """Return values moved by the share ``epsilon`` of the way to random ones."""


class Branch(Protocol):
    """Part of a genome that is being made or varied.

    Attributes:
        outputs: one neuron for each motor of the part.
        hidden: hidden neurons of the part.
        connections: from neurons of this part; assign a new tuple to change them.
    """

    outputs: tuple[NeuronGene, ...]
    hidden: tuple[NeuronGene, ...]
    connections: tuple[ConnectionGene, ...]

    @property
    def kind(self) -> PartType:
        """Part type."""

    @property
    def parent(self) -> Self | None:
        """Parent; None for the core."""

    @property
    def children(self) -> Mapping[int, Self]:
        """Children by slot, ascending."""

    def neurons(self, *layers: Layer) -> list[tuple[Layer, int]]:
        """Return (layer, offset) of its own neurons, in the order of the layers."""

    def path_to(self, other: Self) -> tuple[int, ...]:
        """Return the path of a connection from this part to one of the same tree."""

    def along(self, path: tuple[int, ...]) -> Self | None:
        """Return the part at the end of a path; None if the path does not exist."""


class BrainRules(Struct, frozen=True):
    """Settings of an experiment that random and varied brains keep.

    Attributes:
        max_hidden: greatest number of hidden neurons of a robot.
        p_connect_neurons: probability of each possible connection.
        p_delete_hidden_neuron, p_remove_brain_connection: probabilities of mutation.
        epsilon: step size of parameters, as a share of the way to a random value.
    """

    max_hidden: int
    p_connect_neurons: float
    p_delete_hidden_neuron: float
    p_remove_brain_connection: float
    epsilon: float


class BrainGenes(Protocol):
    """Half of a brain type that runs in analyzers: how genes make brains.

    Every method changes ``outputs``, ``hidden`` and ``connections`` of branches in
    place and draws numbers only from ``draws``. Branches are depth first.
    """

    @property
    def neurons(self) -> NeuronKinds:
        """Types of output and hidden neurons by name, with their parameters."""

    def outputs(self, draws: Draws, part: PartType) -> tuple[NeuronGene, ...]:
        """Return the output neurons of a new part: exactly one for each motor."""

    def grow(
        self,
        draws: Draws,
        new: Sequence[Branch],
        branches: Sequence[Branch],
        rules: BrainRules,
    ) -> None:
        """Add hidden neurons and connections to new parts, which have outputs only.

        ``new`` are all parts of a random robot, or the part that mutation added;
        ``branches`` are all parts of the robot.
        """

    def prune(
        self, draws: Draws, branches: Sequence[Branch], rules: BrainRules
    ) -> object:
        """Mutate a child, first half: before the parameters of its parts vary.

        Crossover and mutation of the body may have left connections whose path or
        whose neurons do not exist; development ignores these.

        Returns:
            Anything that ``vary`` needs.
        """

    def vary(
        self,
        draws: Draws,
        branches: Sequence[Branch],
        rules: BrainRules,
        pruned: Any,  # noqa: ANN401 - whatever prune returned
    ) -> None:
        """Mutate a child, second half: before mutation adds parts."""


class Bank(Protocol):
    """Brains of R robots that are updated together; row r belongs to robot r."""

    @property
    def states(self) -> Floats:
        """(R, K) all that a brain keeps between ticks, 0 at birth.

        K depends on nothing but the experiment. The caller reads and writes rows, to
        save, move and restore robots.
        """

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        """Update all brains once.

        Args:
            readings: (R, I) sensor readings; unused inputs are 0.
            age_ticks: (R, 1) ticks since each robot's birth, or one number.

        Returns:
            (R, O) outputs, which motors clip to [0, 1]; may be a view that the next
            tick overwrites.
        """


class BrainControl(Protocol):
    """Half of a brain type that runs in workers: how brains tick."""

    @property
    def neurons(self) -> NeuronKinds:
        """Types of output and hidden neurons by name, with their parameters."""

    def pack(self, brain: Brain, width: Widths) -> Any:  # noqa: ANN401 - its own
        """Return a brain in the form that ``bank`` takes, as arrays for example.

        The brain is checked: of this type's neurons, within the greatest numbers of
        neurons.
        """

    def bank(self, packed: Sequence[Any], width: Widths, tick_s: float) -> Bank:
        """Return R >= 0 brains that are updated together, at rest.

        A robot must get the same outputs, to the last bit, alone and in any row of
        any batch: use arrays of fixed width, elementwise functions, and ``matmul``
        with one slice for each robot.

        ``packed`` has R results of ``pack``; ``tick_s`` is the time between two ticks
        [s].
        """


class BrainType(BrainGenes, BrainControl, Protocol):
    """Type of brain: ``brain.type``; one class with both halves.

    The class is instantiated in each process with the parameters ``brain.parameters``
    and the neuron types of the experiment: ``Type(parameters, neuron_types)``. Its
    attribute ``Parameters`` is the msgspec Struct of its parameters; without it the
    brain type has none.
    """


class Selectable(Protocol):
    """Individual of a population, as selection sees it; nothing of it can be changed.

    Two are equal if their births are. Further attributes are no part of this protocol.
    """

    @property
    def birth(self) -> BirthId:
        """Birth id: ``island`` of birth and ``number`` there; hashable, in order."""

    @property
    def parents(self) -> tuple[BirthId, ...]:
        """Birth ids of its parents, dead or alive; empty for a random robot."""

    @property
    def fitness(self) -> float:
        """Fitness, always maximised.

        Where its evaluation failed, it is 0, or the least of the population below 0.
        """

    @property
    def has_failed(self) -> bool:
        """Its evaluation failed."""

    @property
    def size(self) -> int:
        """Number of parts of its body."""

    @property
    def rank(self) -> int:
        """1 without parents, else 1 + the greatest rank of its parents."""

    @property
    def measures(self) -> Mapping[str, float]:
        """Measures of its evaluation by name; those that the experiment records."""

    @property
    def robot(self) -> Robot:
        """Its body and brain, developed when asked for; a learnt brain, if any."""

    def distances(self, others: Sequence[Self], /) -> Integers:
        """Return the tree edit distances of bodies, (N,); of the extra ``analysis``."""

    def ancestors(self, generations: int | None = None, /) -> frozenset[BirthId]:
        """Return the birth ids of its ancestors on the island, so far back or all."""


class ParentSelection(Protocol):
    """Selection of two parents, ``selection.parents``; runs in the coordinator.

    A pure function of its arguments: no clock, file or global random state, and nothing
    is kept from one call to the next. Draw from ``rng`` alone; then births do not
    depend on the number of workers.

    Own parameters: annotate the last argument with a msgspec ``Struct``; it is read
    from the table ``[selection.parents_parameters]``. Without such an annotation the
    argument is None and the table must be empty.
    """

    def __call__(
        self,
        population: Sequence[Selectable],
        rng: np.random.Generator,
        parameters: Any,  # noqa: ANN401 - the plug-in's own Struct, or None
        /,
    ) -> tuple[int, int]:
        """Return the places of two parents.

        Args:
            population: candidates in birth order, at least two; on-line, the robots
                whose fitness covers a whole window.
            rng: stream of this birth and attempt.
            parameters: its own.

        Returns:
            Two different places in ``population``, from 0; the child gets its root part
            from the first.
        """


class SurvivorSelection(Protocol):
    """Selection of the survivors of a brood, ``selection.survivors``; off-line only.

    A function that selects emigrants, ``migration.emigrants``, gets and returns the
    same: of the living (on-line, of the mature) those that migrate, in order of choice.

    It runs in the coordinator; else as ``ParentSelection``, with the table
    ``[selection.survivors_parameters]``. It is not called while the population is not
    larger than ``count``.
    """

    def __call__(
        self,
        population: Sequence[Selectable],
        count: int,
        rng: np.random.Generator,
        parameters: Any,  # noqa: ANN401 - the plug-in's own Struct, or None
        /,
    ) -> Sequence[int]:
        """Return the places of the survivors.

        Args:
            population: the parents, if ``selection.keep_parents``, then their children,
                each in birth order; more than ``count``.
            count: number of survivors, ``selection.population``.
            rng: stream of this brood.
            parameters: its own.

        Returns:
            ``count`` different places in ``population``, from 0, in any order.
        """


class StatefulSelection(Protocol):
    """Selection with a memory: of parents, survivors or emigrants, as a class.

    The class is called once for each island of each run, as ``Class(parameters)``: an
    instance of the msgspec Struct that it has as its attribute ``Parameters``, read
    from the same table as those of a function; None without it.

    All memory is in the object, and `update` alone changes it: the class and its module
    are shared by all islands and runs of a process. A run that is resumed makes a new
    object and calls both methods as before. The memory of an island stays there;
    migrants carry nothing of it.

    ``varies = True`` in a class for survivors makes ``count`` the least number of
    places, and `select` is called after each brood. A method ``archive(population)``
    may return individuals by the entries, texts, that they hold; it changes nothing.
    """

    def select(
        self, population: Sequence[Selectable], count: int, rng: np.random.Generator, /
    ) -> Sequence[int]:
        """Return ``count`` different places in the population, from 0; change nothing.

        Population and stream are those of a function. For parents ``count`` is 2, and
        the child gets its root part from the first.
        """

    def update(self, brood: Sequence[Selectable], /) -> None:
        """Change the memory.

        Off-line it is called after each brood, the founders included, when survivors
        have been selected; on-line at a decision, before its birth, with robots that
        are mature for the first time. A brood holds individuals born on the island, in
        birth order, each at one call only, with the fitness that it has then.
        """


class Learner(Protocol):
    """Learner of the brains of newborns, ``learning.learner``; runs in the coordinator.

    The experiment names a class. It is called once for each newborn, as
    ``Class(start, sigma, parameters)``: the parameters of the newborn's brain, or of
    the best sample of its parents and peers, (N,); the key ``learning.sigma``; and an
    instance of the msgspec Struct that the class has as its attribute ``Parameters``,
    read from the table ``[learning.parameters]``; None without it. All parameters are
    shares of their ranges, from 0 to 1.

    The run asks for points, evaluates all of them together, tells their fitness, and
    asks again until the budget is spent. Points are stored when they are asked for. A
    run that is resumed makes a new learner, tells it what was tried, and asks for the
    next points. `ask` therefore changes nothing in the learner, and draws from ``rng``
    alone.
    """

    def ask(self, rng: np.random.Generator, most: int, /) -> Sequence[Any] | Floats:
        """Return the next points to try together: (P, N), 1 <= P <= most, in [0, 1].

        ``rng`` is a stream of this request, of this newborn alone; ``most`` is what is
        left of the budget.
        """

    def tell(self, points: Floats, fitness: Floats, /) -> None:
        """Take the fitness of all points that were tried together.

        Args:
            points: (P, N) in the order of `ask`. At the first call the start comes
                first, which is always tried.
            fitness: (P,), higher is better; -inf for a failed trial.
        """


class FitnessFunction(Protocol):
    """Fitness function, ``fitness.function``; runs in the worker.

    A pure function of its arguments: the same number for the same trace, always
    finite, higher is better. It may raise: the evaluation is then a failed result.
    The second argument is an instance of the msgspec Struct with which it is
    annotated, read from the table ``[fitness.parameters]``; without such an
    annotation, the section ``[fitness]``. A function that reads more of the trace
    than the core's position declares the channels with ``revolve.needs``.
    """

    def __call__(self, trace: Trace, parameters: Any, /) -> float:  # noqa: ANN401
        """Return the fitness of a trace.

        The trace is that of the robot over its fitness window, with the declared
        channels; it must not be changed.
        """


class MeasureFunction(Protocol):
    """Measure, one of ``measures.names``; runs in the worker.

    As a fitness function, but it may have no second argument: then it has no
    parameters. Otherwise the argument is annotated with a msgspec Struct, which is
    read from the table ``[measures.parameters.<name>]``.
    """

    def __call__(self, trace: Trace, /, *parameters: Any) -> float:  # noqa: ANN401
        """Return the measure of a trace; arguments as of a fitness function."""
