"""Robots and genomes in Protobuf: round trips, earlier files, and arbitrary bytes."""

import math
from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from schema.errors import InvalidRobot, MalformedMessage
from schema.limits import MOST_CONNECTIONS, MOST_NEURONS, MOST_PARTS, ROBOT_BYTES
from schema.parts import BUILT_IN
from schema.robot.genome import Genome, Node, develop
from schema.robot.inverse_development import genome_of
from schema.robot.robot import Robot, check_robot
from schema.wire import revolve_pb2 as pb
from schema.wire.genome_bytes import encode_genome
from schema.wire.protobuf import decode_genome, decode_robot, encode_robot
from tests.coordinator.sent_requests import ROBOT

EMPTY = b"\x0a\x00"
"""Field 1, an empty message."""
CORE = pb.Robot(
    parts=[pb.Part(kind="Core", parent=-1, parent_slot=-1, slot=-1)]
).SerializeToString()
GREY = (0.5, 0.5, 0.5)
GENOME_OF_0_1 = bytes.fromhex(
    "0a560a260a04436f72651001180120013218000000000000e03f000000000000e03f000000000000e0"
    "3f1a1a0a0653696d706c651210000000000000d03f000000000000e03f221008011a01002002310000"
    "00000000e83f0a450a270a0b41637469766548696e67653218000000000000e03f000000000000e03f"
    "000000000000e03f121a0a0653696d706c651210000000000000d03f000000000000e03f"
)
ROBOT_OF_0_1 = bytes.fromhex(
    "0a260a04436f72651001180120013218000000000000e03f000000000000e03f000000000000e03f0a"
    "270a0b41637469766548696e67653218000000000000e03f000000000000e03f000000000000e03f12"
    "0908011205496e707574120908011205496e707574120908011205496e707574120908011205496e70"
    "7574120908011205496e707574120908011205496e707574121e0802120653696d706c651801221000"
    "0000000000d03f000000000000e03f121c0803120653696d706c652210000000000000d03f00000000"
    "0000e03f1a0b100619000000000000e83f"
)


@given(data=st.data())
def test_robot_round_trip(robots: SearchStrategy[Robot], data: DataObject) -> None:
    robot = data.draw(robots)
    encoded = encode_robot(robot)
    # Unlike equality, the text tells -0.0 from 0.0.
    assert repr(decode_robot(encoded)) == repr(robot)
    assert encode_robot(decode_robot(encoded)) == encoded


@given(data=st.data())
def test_genome_round_trip(genomes: SearchStrategy[Genome], data: DataObject) -> None:
    genome = data.draw(genomes)
    encoded = encode_genome(genome)
    assert repr(decode_genome(encoded)) == repr(genome)
    assert encode_genome(decode_genome(encoded)) == encoded
    message = pb.Genome.FromString(encoded)
    assert message.SerializeToString(deterministic=True) == encoded


def test_bytes_are_those_of_earlier_versions() -> None:
    """Digests of robots and genomes, and tables of finished runs, hold them."""
    assert encode_robot(ROBOT) == ROBOT_OF_0_1
    assert encode_genome(genome_of(ROBOT)) == GENOME_OF_0_1
    assert decode_robot(ROBOT_OF_0_1) == ROBOT
    assert decode_genome(GENOME_OF_0_1) == genome_of(ROBOT)
    # Field 99, a number, of a version to come.
    assert decode_robot(ROBOT_OF_0_1 + b"\x98\x06\x01") == ROBOT


@given(data=st.data())
def test_damaged_bytes_decode_or_are_malformed(
    genomes: SearchStrategy[Genome], data: DataObject
) -> None:
    genome = data.draw(genomes)
    sound = (encode_genome(genome), encode_robot(develop(genome, BUILT_IN)))
    encoded = data.draw(st.sampled_from(sound))
    place = data.draw(st.integers(0, len(encoded) - 1))
    byte = bytes([data.draw(st.integers(0, 255))])
    cut = data.draw(st.sampled_from([place + 1, len(encoded)]))
    damaged = encoded[:place] + byte + encoded[place + 1 : cut]
    with suppress(MalformedMessage):
        robot = decode_robot(damaged)
        assert decode_robot(encode_robot(robot)) == robot
    with suppress(MalformedMessage):
        other = decode_genome(damaged)
        assert decode_genome(encode_genome(other)) == other


@pytest.mark.parametrize(
    ("decode", "bomb"),
    [
        (decode_robot, EMPTY * (MOST_PARTS + 1)),
        (decode_genome, EMPTY * (MOST_PARTS + 1)),
        (decode_robot, CORE + b"\x12\x00" * (MOST_NEURONS + 1)),
        (decode_robot, CORE + b"\x1a\x00" * (MOST_CONNECTIONS + 1)),
        (decode_robot, bytes(ROBOT_BYTES + 1)),
        (decode_genome, bytes(ROBOT_BYTES + 1)),
    ],
)
def test_bombs_are_too_large(decode: Callable[[bytes], object], bomb: bytes) -> None:
    with pytest.raises(MalformedMessage) as raised:
        decode(bomb)
    assert raised.value.kind == "too large"


@pytest.mark.parametrize(
    ("field", "value", "why"),
    [
        ("parts", {"kind": "FixedBrick", "parent": 4}, r"body.parts\[1\].parent"),
        ("neurons", {"kind": "Simple", "parameters": (0, 1)}, "layer: must be one of"),
    ],
)
def test_robots_that_break_a_rule_are_malformed(
    field: str, value: dict[str, object], why: str
) -> None:
    message = pb.Robot.FromString(CORE)
    getattr(message, field).add(**value)
    with pytest.raises(MalformedMessage, match=why):
        decode_robot(message.SerializeToString())


def test_empty_bytes_are_not_a_robot() -> None:
    for decode in (decode_robot, decode_genome):
        with pytest.raises(MalformedMessage, match="at least the core"):
            decode(b"")


def test_parameters_of_a_neuron_gene_are_finite() -> None:
    message = pb.Genome.FromString(GENOME_OF_0_1)
    message.nodes[0].hidden.add(kind="Simple", parameters=(0.0, math.nan))
    with pytest.raises(MalformedMessage, match=r"neuron\.parameters: must be finite"):
        decode_genome(message.SerializeToString())


def test_neuron_types_are_checked_after_decoding(node: Callable[..., Node]) -> None:
    """They may be those of a plug-in."""
    message = pb.Genome.FromString(encode_genome(node("Core")))
    message.nodes[0].hidden.add(kind="Cosine", parameters=(0.0,))
    robot = develop(decode_genome(message.SerializeToString()), BUILT_IN)
    assert decode_robot(encode_robot(robot)) == robot
    with pytest.raises(InvalidRobot, match=r"must be one of Simple, .* got 'Cosine'"):
        check_robot(robot, BUILT_IN)
