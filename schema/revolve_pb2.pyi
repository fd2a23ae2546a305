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

class Request(_message.Message):
    __slots__ = ("run", "epoch", "number", "settings", "robot")
    RUN_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    SETTINGS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    run: str
    epoch: int
    number: int
    settings: bytes
    robot: bytes
    def __init__(self, run: _Optional[str] = ..., epoch: _Optional[int] = ..., number: _Optional[int] = ..., settings: _Optional[bytes] = ..., robot: _Optional[bytes] = ...) -> None: ...

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
    __slots__ = ("fitness", "path_velocity", "straight_velocity", "simulated_s")
    FITNESS_FIELD_NUMBER: _ClassVar[int]
    PATH_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    STRAIGHT_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    SIMULATED_S_FIELD_NUMBER: _ClassVar[int]
    fitness: float
    path_velocity: float
    straight_velocity: float
    simulated_s: float
    def __init__(self, fitness: _Optional[float] = ..., path_velocity: _Optional[float] = ..., straight_velocity: _Optional[float] = ..., simulated_s: _Optional[float] = ...) -> None: ...

class Answer(_message.Message):
    __slots__ = ("epoch", "number", "wall_s", "report", "evaluation", "failure")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    WALL_S_FIELD_NUMBER: _ClassVar[int]
    REPORT_FIELD_NUMBER: _ClassVar[int]
    EVALUATION_FIELD_NUMBER: _ClassVar[int]
    FAILURE_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    number: int
    wall_s: float
    report: Report
    evaluation: Evaluation
    failure: str
    def __init__(self, epoch: _Optional[int] = ..., number: _Optional[int] = ..., wall_s: _Optional[float] = ..., report: _Optional[_Union[Report, _Mapping]] = ..., evaluation: _Optional[_Union[Evaluation, _Mapping]] = ..., failure: _Optional[str] = ...) -> None: ...

class AgentInfo(_message.Message):
    __slots__ = ("agent", "kind", "slots", "platform", "version")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SLOTS_FIELD_NUMBER: _ClassVar[int]
    PLATFORM_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    agent: str
    kind: str
    slots: int
    platform: str
    version: str
    def __init__(self, agent: _Optional[str] = ..., kind: _Optional[str] = ..., slots: _Optional[int] = ..., platform: _Optional[str] = ..., version: _Optional[str] = ...) -> None: ...

class Provenance(_message.Message):
    __slots__ = ("agent", "platform", "wall_s")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    PLATFORM_FIELD_NUMBER: _ClassVar[int]
    WALL_S_FIELD_NUMBER: _ClassVar[int]
    agent: str
    platform: str
    wall_s: float
    def __init__(self, agent: _Optional[str] = ..., platform: _Optional[str] = ..., wall_s: _Optional[float] = ...) -> None: ...

class Entry(_message.Message):
    __slots__ = ("island", "birth", "attempt", "provenance", "vetted", "vetting_failed", "evaluated", "evaluation_failed")
    ISLAND_FIELD_NUMBER: _ClassVar[int]
    BIRTH_FIELD_NUMBER: _ClassVar[int]
    ATTEMPT_FIELD_NUMBER: _ClassVar[int]
    PROVENANCE_FIELD_NUMBER: _ClassVar[int]
    VETTED_FIELD_NUMBER: _ClassVar[int]
    VETTING_FAILED_FIELD_NUMBER: _ClassVar[int]
    EVALUATED_FIELD_NUMBER: _ClassVar[int]
    EVALUATION_FAILED_FIELD_NUMBER: _ClassVar[int]
    island: int
    birth: int
    attempt: int
    provenance: Provenance
    vetted: Report
    vetting_failed: str
    evaluated: Evaluation
    evaluation_failed: str
    def __init__(self, island: _Optional[int] = ..., birth: _Optional[int] = ..., attempt: _Optional[int] = ..., provenance: _Optional[_Union[Provenance, _Mapping]] = ..., vetted: _Optional[_Union[Report, _Mapping]] = ..., vetting_failed: _Optional[str] = ..., evaluated: _Optional[_Union[Evaluation, _Mapping]] = ..., evaluation_failed: _Optional[str] = ...) -> None: ...
