from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Layer(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    LAYER_UNSPECIFIED: _ClassVar[Layer]
    LAYER_INPUT: _ClassVar[Layer]
    LAYER_OUTPUT: _ClassVar[Layer]
    LAYER_HIDDEN: _ClassVar[Layer]
LAYER_UNSPECIFIED: Layer
LAYER_INPUT: Layer
LAYER_OUTPUT: Layer
LAYER_HIDDEN: Layer

class Part(_message.Message):
    __slots__ = ("kind", "parent", "parent_slot", "slot", "orientation", "parameters", "gene")
    KIND_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    PARENT_SLOT_FIELD_NUMBER: _ClassVar[int]
    SLOT_FIELD_NUMBER: _ClassVar[int]
    ORIENTATION_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    GENE_FIELD_NUMBER: _ClassVar[int]
    kind: str
    parent: int
    parent_slot: int
    slot: int
    orientation: int
    parameters: _containers.RepeatedScalarFieldContainer[float]
    gene: int
    def __init__(self, kind: _Optional[str] = ..., parent: _Optional[int] = ..., parent_slot: _Optional[int] = ..., slot: _Optional[int] = ..., orientation: _Optional[int] = ..., parameters: _Optional[_Iterable[float]] = ..., gene: _Optional[int] = ...) -> None: ...

class Neuron(_message.Message):
    __slots__ = ("layer", "kind", "part", "parameters")
    LAYER_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    PART_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    layer: Layer
    kind: str
    part: int
    parameters: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, layer: _Optional[_Union[Layer, str]] = ..., kind: _Optional[str] = ..., part: _Optional[int] = ..., parameters: _Optional[_Iterable[float]] = ...) -> None: ...

class Connection(_message.Message):
    __slots__ = ("source", "target", "weight")
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    source: int
    target: int
    weight: float
    def __init__(self, source: _Optional[int] = ..., target: _Optional[int] = ..., weight: _Optional[float] = ...) -> None: ...

class Robot(_message.Message):
    __slots__ = ("parts", "neurons", "connections")
    PARTS_FIELD_NUMBER: _ClassVar[int]
    NEURONS_FIELD_NUMBER: _ClassVar[int]
    CONNECTIONS_FIELD_NUMBER: _ClassVar[int]
    parts: _containers.RepeatedCompositeFieldContainer[Part]
    neurons: _containers.RepeatedCompositeFieldContainer[Neuron]
    connections: _containers.RepeatedCompositeFieldContainer[Connection]
    def __init__(self, parts: _Optional[_Iterable[_Union[Part, _Mapping]]] = ..., neurons: _Optional[_Iterable[_Union[Neuron, _Mapping]]] = ..., connections: _Optional[_Iterable[_Union[Connection, _Mapping]]] = ...) -> None: ...

class NeuronGene(_message.Message):
    __slots__ = ("kind", "parameters")
    KIND_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    kind: str
    parameters: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, kind: _Optional[str] = ..., parameters: _Optional[_Iterable[float]] = ...) -> None: ...

class ConnectionGene(_message.Message):
    __slots__ = ("source_layer", "source_offset", "path", "target_layer", "target_offset", "weight")
    SOURCE_LAYER_FIELD_NUMBER: _ClassVar[int]
    SOURCE_OFFSET_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    TARGET_LAYER_FIELD_NUMBER: _ClassVar[int]
    TARGET_OFFSET_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    source_layer: Layer
    source_offset: int
    path: _containers.RepeatedScalarFieldContainer[int]
    target_layer: Layer
    target_offset: int
    weight: float
    def __init__(self, source_layer: _Optional[_Union[Layer, str]] = ..., source_offset: _Optional[int] = ..., path: _Optional[_Iterable[int]] = ..., target_layer: _Optional[_Union[Layer, str]] = ..., target_offset: _Optional[int] = ..., weight: _Optional[float] = ...) -> None: ...

class Node(_message.Message):
    __slots__ = ("part", "outputs", "hidden", "connections")
    PART_FIELD_NUMBER: _ClassVar[int]
    OUTPUTS_FIELD_NUMBER: _ClassVar[int]
    HIDDEN_FIELD_NUMBER: _ClassVar[int]
    CONNECTIONS_FIELD_NUMBER: _ClassVar[int]
    part: Part
    outputs: _containers.RepeatedCompositeFieldContainer[NeuronGene]
    hidden: _containers.RepeatedCompositeFieldContainer[NeuronGene]
    connections: _containers.RepeatedCompositeFieldContainer[ConnectionGene]
    def __init__(self, part: _Optional[_Union[Part, _Mapping]] = ..., outputs: _Optional[_Iterable[_Union[NeuronGene, _Mapping]]] = ..., hidden: _Optional[_Iterable[_Union[NeuronGene, _Mapping]]] = ..., connections: _Optional[_Iterable[_Union[ConnectionGene, _Mapping]]] = ...) -> None: ...

class Genome(_message.Message):
    __slots__ = ("nodes",)
    NODES_FIELD_NUMBER: _ClassVar[int]
    nodes: _containers.RepeatedCompositeFieldContainer[Node]
    def __init__(self, nodes: _Optional[_Iterable[_Union[Node, _Mapping]]] = ...) -> None: ...

class Identity(_message.Message):
    __slots__ = ("seed", "run", "island", "birth", "trial")
    SEED_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    ISLAND_FIELD_NUMBER: _ClassVar[int]
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    TRIAL_FIELD_NUMBER: _ClassVar[int]
    seed: int
    run: int
    island: int
    birth: BirthName
    trial: int
    def __init__(self, seed: _Optional[int] = ..., run: _Optional[int] = ..., island: _Optional[int] = ..., birth: _Optional[_Union[BirthName, _Mapping]] = ..., trial: _Optional[int] = ...) -> None: ...

class Call(_message.Message):
    __slots__ = ("argument",)
    ARGUMENT_FIELD_NUMBER: _ClassVar[int]
    argument: bytes
    def __init__(self, argument: _Optional[bytes] = ...) -> None: ...

class Request(_message.Message):
    __slots__ = ("run", "epoch", "number", "settings", "robot", "steps", "plugins", "identity", "call")
    RUN_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    SETTINGS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    PLUGINS_FIELD_NUMBER: _ClassVar[int]
    IDENTITY_FIELD_NUMBER: _ClassVar[int]
    CALL_FIELD_NUMBER: _ClassVar[int]
    run: str
    epoch: int
    number: int
    settings: bytes
    robot: bytes
    steps: int
    plugins: str
    identity: Identity
    call: Call
    def __init__(self, run: _Optional[str] = ..., epoch: _Optional[int] = ..., number: _Optional[int] = ..., settings: _Optional[bytes] = ..., robot: _Optional[bytes] = ..., steps: _Optional[int] = ..., plugins: _Optional[str] = ..., identity: _Optional[_Union[Identity, _Mapping]] = ..., call: _Optional[_Union[Call, _Mapping]] = ...) -> None: ...

class Vector(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Intersection(_message.Message):
    __slots__ = ("first", "second")
    FIRST_FIELD_NUMBER: _ClassVar[int]
    SECOND_FIELD_NUMBER: _ClassVar[int]
    first: int
    second: int
    def __init__(self, first: _Optional[int] = ..., second: _Optional[int] = ...) -> None: ...

class Report(_message.Message):
    __slots__ = ("is_viable", "reason", "intersections", "lower", "upper", "mass", "motors")
    IS_VIABLE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    INTERSECTIONS_FIELD_NUMBER: _ClassVar[int]
    LOWER_FIELD_NUMBER: _ClassVar[int]
    UPPER_FIELD_NUMBER: _ClassVar[int]
    MASS_FIELD_NUMBER: _ClassVar[int]
    MOTORS_FIELD_NUMBER: _ClassVar[int]
    is_viable: bool
    reason: str
    intersections: _containers.RepeatedCompositeFieldContainer[Intersection]
    lower: Vector
    upper: Vector
    mass: float
    motors: int
    def __init__(self, is_viable: _Optional[bool] = ..., reason: _Optional[str] = ..., intersections: _Optional[_Iterable[_Union[Intersection, _Mapping]]] = ..., lower: _Optional[_Union[Vector, _Mapping]] = ..., upper: _Optional[_Union[Vector, _Mapping]] = ..., mass: _Optional[float] = ..., motors: _Optional[int] = ...) -> None: ...

class Evaluation(_message.Message):
    __slots__ = ("fitness", "path_velocity", "straight_velocity", "simulated_s", "measures")
    FITNESS_FIELD_NUMBER: _ClassVar[int]
    PATH_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    STRAIGHT_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    SIMULATED_S_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    fitness: float
    path_velocity: float
    straight_velocity: float
    simulated_s: float
    measures: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, fitness: _Optional[float] = ..., path_velocity: _Optional[float] = ..., straight_velocity: _Optional[float] = ..., simulated_s: _Optional[float] = ..., measures: _Optional[_Iterable[float]] = ...) -> None: ...

class Answer(_message.Message):
    __slots__ = ("epoch", "number", "wall_s", "report", "evaluation", "failure", "value")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    WALL_S_FIELD_NUMBER: _ClassVar[int]
    REPORT_FIELD_NUMBER: _ClassVar[int]
    EVALUATION_FIELD_NUMBER: _ClassVar[int]
    FAILURE_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    number: int
    wall_s: float
    report: Report
    evaluation: Evaluation
    failure: str
    value: bytes
    def __init__(self, epoch: _Optional[int] = ..., number: _Optional[int] = ..., wall_s: _Optional[float] = ..., report: _Optional[_Union[Report, _Mapping]] = ..., evaluation: _Optional[_Union[Evaluation, _Mapping]] = ..., failure: _Optional[str] = ..., value: _Optional[bytes] = ...) -> None: ...

class Death(_message.Message):
    __slots__ = ("agent", "run", "epoch", "number", "cause", "request")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    RUN_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    agent: str
    run: str
    epoch: int
    number: int
    cause: str
    request: bytes
    def __init__(self, agent: _Optional[str] = ..., run: _Optional[str] = ..., epoch: _Optional[int] = ..., number: _Optional[int] = ..., cause: _Optional[str] = ..., request: _Optional[bytes] = ...) -> None: ...

class AgentInfo(_message.Message):
    __slots__ = ("agent", "kind", "slots", "platform", "version", "deaths", "shards", "cores", "quiet_s")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SLOTS_FIELD_NUMBER: _ClassVar[int]
    PLATFORM_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    DEATHS_FIELD_NUMBER: _ClassVar[int]
    SHARDS_FIELD_NUMBER: _ClassVar[int]
    CORES_FIELD_NUMBER: _ClassVar[int]
    QUIET_S_FIELD_NUMBER: _ClassVar[int]
    agent: str
    kind: str
    slots: int
    platform: str
    version: str
    deaths: _containers.RepeatedCompositeFieldContainer[Death]
    shards: int
    cores: int
    quiet_s: float
    def __init__(self, agent: _Optional[str] = ..., kind: _Optional[str] = ..., slots: _Optional[int] = ..., platform: _Optional[str] = ..., version: _Optional[str] = ..., deaths: _Optional[_Iterable[_Union[Death, _Mapping]]] = ..., shards: _Optional[int] = ..., cores: _Optional[int] = ..., quiet_s: _Optional[float] = ...) -> None: ...

class Provenance(_message.Message):
    __slots__ = ("agent", "platform", "wall_s")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    PLATFORM_FIELD_NUMBER: _ClassVar[int]
    WALL_S_FIELD_NUMBER: _ClassVar[int]
    agent: str
    platform: str
    wall_s: float
    def __init__(self, agent: _Optional[str] = ..., platform: _Optional[str] = ..., wall_s: _Optional[float] = ...) -> None: ...

class BirthName(_message.Message):
    __slots__ = ("island", "number")
    ISLAND_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    island: int
    number: int
    def __init__(self, island: _Optional[int] = ..., number: _Optional[int] = ...) -> None: ...

class Insertion(_message.Message):
    __slots__ = ("birth", "robot", "x", "y", "heading")
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    birth: BirthName
    robot: Robot
    x: float
    y: float
    heading: float
    def __init__(self, birth: _Optional[_Union[BirthName, _Mapping]] = ..., robot: _Optional[_Union[Robot, _Mapping]] = ..., x: _Optional[float] = ..., y: _Optional[float] = ..., heading: _Optional[float] = ...) -> None: ...

class BrainChange(_message.Message):
    __slots__ = ("birth", "neurons", "connections", "restarts_window")
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    NEURONS_FIELD_NUMBER: _ClassVar[int]
    CONNECTIONS_FIELD_NUMBER: _ClassVar[int]
    RESTARTS_WINDOW_FIELD_NUMBER: _ClassVar[int]
    birth: BirthName
    neurons: _containers.RepeatedCompositeFieldContainer[Neuron]
    connections: _containers.RepeatedCompositeFieldContainer[Connection]
    restarts_window: bool
    def __init__(self, birth: _Optional[_Union[BirthName, _Mapping]] = ..., neurons: _Optional[_Iterable[_Union[Neuron, _Mapping]]] = ..., connections: _Optional[_Iterable[_Union[Connection, _Mapping]]] = ..., restarts_window: _Optional[bool] = ...) -> None: ...

class Changes(_message.Message):
    __slots__ = ("removals", "insertions", "brains")
    REMOVALS_FIELD_NUMBER: _ClassVar[int]
    INSERTIONS_FIELD_NUMBER: _ClassVar[int]
    BRAINS_FIELD_NUMBER: _ClassVar[int]
    removals: _containers.RepeatedCompositeFieldContainer[BirthName]
    insertions: _containers.RepeatedCompositeFieldContainer[Insertion]
    brains: _containers.RepeatedCompositeFieldContainer[BrainChange]
    def __init__(self, removals: _Optional[_Iterable[_Union[BirthName, _Mapping]]] = ..., insertions: _Optional[_Iterable[_Union[Insertion, _Mapping]]] = ..., brains: _Optional[_Iterable[_Union[BrainChange, _Mapping]]] = ...) -> None: ...

class Judgement(_message.Message):
    __slots__ = ("birth", "age_s", "path_velocity", "straight_velocity", "fitness", "is_mature", "place", "measures")
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    AGE_S_FIELD_NUMBER: _ClassVar[int]
    PATH_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    STRAIGHT_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    FITNESS_FIELD_NUMBER: _ClassVar[int]
    IS_MATURE_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    birth: BirthName
    age_s: float
    path_velocity: float
    straight_velocity: float
    fitness: float
    is_mature: bool
    place: Vector
    measures: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, birth: _Optional[_Union[BirthName, _Mapping]] = ..., age_s: _Optional[float] = ..., path_velocity: _Optional[float] = ..., straight_velocity: _Optional[float] = ..., fitness: _Optional[float] = ..., is_mature: _Optional[bool] = ..., place: _Optional[_Union[Vector, _Mapping]] = ..., measures: _Optional[_Iterable[float]] = ...) -> None: ...

class Casualty(_message.Message):
    __slots__ = ("birth", "step", "reason", "place")
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    birth: BirthName
    step: int
    reason: str
    place: Vector
    def __init__(self, birth: _Optional[_Union[BirthName, _Mapping]] = ..., step: _Optional[int] = ..., reason: _Optional[str] = ..., place: _Optional[_Union[Vector, _Mapping]] = ...) -> None: ...

class Touch(_message.Message):
    __slots__ = ("first", "second", "duration_s")
    FIRST_FIELD_NUMBER: _ClassVar[int]
    SECOND_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    first: BirthName
    second: BirthName
    duration_s: float
    def __init__(self, first: _Optional[_Union[BirthName, _Mapping]] = ..., second: _Optional[_Union[BirthName, _Mapping]] = ..., duration_s: _Optional[float] = ...) -> None: ...

class Advance(_message.Message):
    __slots__ = ("step", "digest", "judgements", "casualties", "touches", "poses")
    STEP_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    JUDGEMENTS_FIELD_NUMBER: _ClassVar[int]
    CASUALTIES_FIELD_NUMBER: _ClassVar[int]
    TOUCHES_FIELD_NUMBER: _ClassVar[int]
    POSES_FIELD_NUMBER: _ClassVar[int]
    step: int
    digest: bytes
    judgements: _containers.RepeatedCompositeFieldContainer[Judgement]
    casualties: _containers.RepeatedCompositeFieldContainer[Casualty]
    touches: _containers.RepeatedCompositeFieldContainer[Touch]
    poses: bytes
    def __init__(self, step: _Optional[int] = ..., digest: _Optional[bytes] = ..., judgements: _Optional[_Iterable[_Union[Judgement, _Mapping]]] = ..., casualties: _Optional[_Iterable[_Union[Casualty, _Mapping]]] = ..., touches: _Optional[_Iterable[_Union[Touch, _Mapping]]] = ..., poses: _Optional[bytes] = ...) -> None: ...

class PastAdvance(_message.Message):
    __slots__ = ("changes", "until", "digest")
    CHANGES_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    changes: Changes
    until: int
    digest: bytes
    def __init__(self, changes: _Optional[_Union[Changes, _Mapping]] = ..., until: _Optional[int] = ..., digest: _Optional[bytes] = ...) -> None: ...

class AdvanceRequest(_message.Message):
    __slots__ = ("run", "epoch", "number", "settings", "shard", "from_step", "from_digest", "changes", "until", "wants_snapshot", "snapshot", "history", "is_rebuild", "plugins", "is_drift", "living")
    RUN_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    SETTINGS_FIELD_NUMBER: _ClassVar[int]
    SHARD_FIELD_NUMBER: _ClassVar[int]
    FROM_STEP_FIELD_NUMBER: _ClassVar[int]
    FROM_DIGEST_FIELD_NUMBER: _ClassVar[int]
    CHANGES_FIELD_NUMBER: _ClassVar[int]
    UNTIL_FIELD_NUMBER: _ClassVar[int]
    WANTS_SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    IS_REBUILD_FIELD_NUMBER: _ClassVar[int]
    PLUGINS_FIELD_NUMBER: _ClassVar[int]
    IS_DRIFT_FIELD_NUMBER: _ClassVar[int]
    LIVING_FIELD_NUMBER: _ClassVar[int]
    run: str
    epoch: int
    number: int
    settings: bytes
    shard: int
    from_step: int
    from_digest: bytes
    changes: Changes
    until: int
    wants_snapshot: bool
    snapshot: bytes
    history: _containers.RepeatedCompositeFieldContainer[PastAdvance]
    is_rebuild: bool
    plugins: str
    is_drift: bool
    living: _containers.RepeatedCompositeFieldContainer[BirthName]
    def __init__(self, run: _Optional[str] = ..., epoch: _Optional[int] = ..., number: _Optional[int] = ..., settings: _Optional[bytes] = ..., shard: _Optional[int] = ..., from_step: _Optional[int] = ..., from_digest: _Optional[bytes] = ..., changes: _Optional[_Union[Changes, _Mapping]] = ..., until: _Optional[int] = ..., wants_snapshot: _Optional[bool] = ..., snapshot: _Optional[bytes] = ..., history: _Optional[_Iterable[_Union[PastAdvance, _Mapping]]] = ..., is_rebuild: _Optional[bool] = ..., plugins: _Optional[str] = ..., is_drift: _Optional[bool] = ..., living: _Optional[_Iterable[_Union[BirthName, _Mapping]]] = ...) -> None: ...

class AdvanceAnswer(_message.Message):
    __slots__ = ("epoch", "number", "wall_s", "advance", "needs_state", "snapshot")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    WALL_S_FIELD_NUMBER: _ClassVar[int]
    ADVANCE_FIELD_NUMBER: _ClassVar[int]
    NEEDS_STATE_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    number: int
    wall_s: float
    advance: Advance
    needs_state: bool
    snapshot: bytes
    def __init__(self, epoch: _Optional[int] = ..., number: _Optional[int] = ..., wall_s: _Optional[float] = ..., advance: _Optional[_Union[Advance, _Mapping]] = ..., needs_state: _Optional[bool] = ..., snapshot: _Optional[bytes] = ...) -> None: ...

class Nothing(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class InsertOrder(_message.Message):
    __slots__ = ("genome", "has_place", "x", "y", "prevents_extinction")
    GENOME_FIELD_NUMBER: _ClassVar[int]
    HAS_PLACE_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    PREVENTS_EXTINCTION_FIELD_NUMBER: _ClassVar[int]
    genome: bytes
    has_place: bool
    x: float
    y: float
    prevents_extinction: bool
    def __init__(self, genome: _Optional[bytes] = ..., has_place: _Optional[bool] = ..., x: _Optional[float] = ..., y: _Optional[float] = ..., prevents_extinction: _Optional[bool] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("command_id", "step", "pause", "resume", "insert", "remove", "replace_brain")
    COMMAND_ID_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    PAUSE_FIELD_NUMBER: _ClassVar[int]
    RESUME_FIELD_NUMBER: _ClassVar[int]
    INSERT_FIELD_NUMBER: _ClassVar[int]
    REMOVE_FIELD_NUMBER: _ClassVar[int]
    REPLACE_BRAIN_FIELD_NUMBER: _ClassVar[int]
    command_id: str
    step: int
    pause: Nothing
    resume: Nothing
    insert: InsertOrder
    remove: BirthName
    replace_brain: BrainChange
    def __init__(self, command_id: _Optional[str] = ..., step: _Optional[int] = ..., pause: _Optional[_Union[Nothing, _Mapping]] = ..., resume: _Optional[_Union[Nothing, _Mapping]] = ..., insert: _Optional[_Union[InsertOrder, _Mapping]] = ..., remove: _Optional[_Union[BirthName, _Mapping]] = ..., replace_brain: _Optional[_Union[BrainChange, _Mapping]] = ...) -> None: ...

class AdvanceEntry(_message.Message):
    __slots__ = ("number", "advance", "pose_rows")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    ADVANCE_FIELD_NUMBER: _ClassVar[int]
    POSE_ROWS_FIELD_NUMBER: _ClassVar[int]
    number: int
    advance: Advance
    pose_rows: int
    def __init__(self, number: _Optional[int] = ..., advance: _Optional[_Union[Advance, _Mapping]] = ..., pose_rows: _Optional[int] = ...) -> None: ...

class Entry(_message.Message):
    __slots__ = ("island", "birth", "attempt", "provenance", "vetted", "vetting_failed", "evaluated", "evaluation_failed", "advanced", "commanded", "audited", "asked", "trial", "requester")
    ISLAND_FIELD_NUMBER: _ClassVar[int]
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    ATTEMPT_FIELD_NUMBER: _ClassVar[int]
    PROVENANCE_FIELD_NUMBER: _ClassVar[int]
    VETTED_FIELD_NUMBER: _ClassVar[int]
    VETTING_FAILED_FIELD_NUMBER: _ClassVar[int]
    EVALUATED_FIELD_NUMBER: _ClassVar[int]
    EVALUATION_FAILED_FIELD_NUMBER: _ClassVar[int]
    ADVANCED_FIELD_NUMBER: _ClassVar[int]
    COMMANDED_FIELD_NUMBER: _ClassVar[int]
    AUDITED_FIELD_NUMBER: _ClassVar[int]
    ASKED_FIELD_NUMBER: _ClassVar[int]
    TRIAL_FIELD_NUMBER: _ClassVar[int]
    REQUESTER_FIELD_NUMBER: _ClassVar[int]
    island: int
    birth: int
    attempt: int
    provenance: Provenance
    vetted: Report
    vetting_failed: str
    evaluated: Evaluation
    evaluation_failed: str
    advanced: AdvanceEntry
    commanded: Command
    audited: AuditEntry
    asked: LearnerEntry
    trial: int
    requester: int
    def __init__(self, island: _Optional[int] = ..., birth: _Optional[int] = ..., attempt: _Optional[int] = ..., provenance: _Optional[_Union[Provenance, _Mapping]] = ..., vetted: _Optional[_Union[Report, _Mapping]] = ..., vetting_failed: _Optional[str] = ..., evaluated: _Optional[_Union[Evaluation, _Mapping]] = ..., evaluation_failed: _Optional[str] = ..., advanced: _Optional[_Union[AdvanceEntry, _Mapping]] = ..., commanded: _Optional[_Union[Command, _Mapping]] = ..., audited: _Optional[_Union[AuditEntry, _Mapping]] = ..., asked: _Optional[_Union[LearnerEntry, _Mapping]] = ..., trial: _Optional[int] = ..., requester: _Optional[int] = ...) -> None: ...

class AuditEntry(_message.Message):
    __slots__ = ("first", "second")
    FIRST_FIELD_NUMBER: _ClassVar[int]
    SECOND_FIELD_NUMBER: _ClassVar[int]
    first: Entry
    second: Entry
    def __init__(self, first: _Optional[_Union[Entry, _Mapping]] = ..., second: _Optional[_Union[Entry, _Mapping]] = ...) -> None: ...

class LearnerEntry(_message.Message):
    __slots__ = ("number", "points", "values")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    number: int
    points: int
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, number: _Optional[int] = ..., points: _Optional[int] = ..., values: _Optional[_Iterable[float]] = ...) -> None: ...

class Live(_message.Message):
    __slots__ = ("run", "shard", "advance")
    RUN_FIELD_NUMBER: _ClassVar[int]
    SHARD_FIELD_NUMBER: _ClassVar[int]
    ADVANCE_FIELD_NUMBER: _ClassVar[int]
    run: str
    shard: int
    advance: Advance
    def __init__(self, run: _Optional[str] = ..., shard: _Optional[int] = ..., advance: _Optional[_Union[Advance, _Mapping]] = ...) -> None: ...
