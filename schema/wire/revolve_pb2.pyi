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
