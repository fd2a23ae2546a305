"""Robots, genomes, requests, answers: round trips, and arbitrary bytes."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from schema.errors import InvalidRobot, MalformedMessage
from schema.experiment.identity import NO_IDENTITY, Identity, Origin
from schema.limits import LONGEST_REASON, printable
from schema.parts import BUILT_IN
from schema.robot.genome import Genome, Node, develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Report
from schema.robot.robot import Robot, check_robot
from schema.wire import revolve_pb2 as pb
from schema.wire.codec import (
    decode_answer,
    decode_body,
    decode_request,
    encode_answer,
    encode_body,
    encode_brain,
    encode_request,
)
from schema.wire.messages import Answer, Request, robot_to_message
from schema.wire.protobuf import (
    decode_genome,
    decode_robot,
    encode_genome,
    encode_robot,
)

NodeMaker = Callable[..., Node]
DECODERS: list[Callable[[bytes], object]] = [
    decode_robot,
    decode_body,
    decode_genome,
    decode_request,
    decode_answer,
]
U64 = st.integers(0, 2**64 - 1)
U32 = st.integers(0, 2**32 - 1)
IDENTITIES = st.just(NO_IDENTITY) | st.builds(
    Identity,
    st.builds(Origin, seed=U64, run=U32, island=U32),
    st.builds(BirthId, U32, U64),
    U32,
)
NUMBER = st.floats(allow_nan=False, allow_infinity=False)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
MEASURES = st.lists(NUMBER, max_size=4).map(tuple)
EVALUATIONS = st.builds(Evaluation, NUMBER, NUMBER, NUMBER, NUMBER, MEASURES)
PAIRS = st.lists(st.tuples(U32, U32), max_size=4).map(tuple)
REASON = st.text(max_size=2000).map(lambda text: printable(text, LONGEST_REASON))
REPORTS = st.builds(
    Report,
    st.just(value=False),
    REASON,
    PAIRS,
    VECTOR,
    VECTOR,
    NUMBER,
    U32,
) | st.builds(
    Report, st.just(value=True), st.just(""), PAIRS, VECTOR, VECTOR, NUMBER, U32
)
WALL = st.floats(0, 1e9)
ANSWERS = st.builds(Answer, U64, U64, WALL, REPORTS | EVALUATIONS | REASON.filter(bool))
REPORT = Report(
    is_viable=True,
    reason="",
    intersections=(),
    lower=(-1.0, -1.0, -1.0),
    upper=(1.0, 1.0, 1.0),
    mass=0.3,
    motors=1,
)


def exact(value: object) -> str:
    """Return a text that distinguishes -0.0 from 0.0."""
    return repr(value)


@given(data=st.data())
def test_robot_round_trip(robots: SearchStrategy[Robot], data: DataObject) -> None:
    robot = data.draw(robots)
    encoded = encode_robot(robot)
    assert exact(decode_robot(encoded)) == exact(robot)
    assert encode_robot(decode_robot(encoded)) == encoded


@given(data=st.data())
def test_bytes_of_body_and_brain_concatenate_to_a_robot(
    robots: SearchStrategy[Robot], data: DataObject
) -> None:
    robot = data.draw(robots)
    body, brain = encode_body(robot), encode_brain(robot)
    whole = robot_to_message(robot).SerializeToString(deterministic=True)
    assert body + brain == encode_robot(robot) == whole
    bare = Robot(robot.parts)
    assert exact(decode_body(whole)) == exact(decode_body(body)) == exact(bare)
    assert encode_robot(bare) == body


def test_decode_body_ignores_the_brain(node: NodeMaker) -> None:
    message = pb.Robot.FromString(encode_body(develop(node("Core"), BUILT_IN)))
    message.neurons.add(kind="no such kind", part=7)
    data = message.SerializeToString()
    with pytest.raises(MalformedMessage):
        decode_robot(data)
    assert [part.kind for part in decode_body(data).parts] == ["Core"]


@given(data=st.data())
def test_genome_round_trip(genomes: SearchStrategy[Genome], data: DataObject) -> None:
    genome = data.draw(genomes)
    encoded = encode_genome(genome)
    assert exact(decode_genome(encoded)) == exact(genome)
    assert encode_genome(decode_genome(encoded)) == encoded


@given(data=st.data())
def test_request_round_trip(robots: SearchStrategy[Robot], data: DataObject) -> None:
    robot = data.draw(robots)
    run, epoch, number = data.draw(st.tuples(st.text(), U64, U64))
    settings = data.draw(st.binary())
    identity = data.draw(IDENTITIES)
    encoded = encode_request(
        run=run,
        epoch=epoch,
        number=number,
        settings=settings,
        robot=encode_robot(robot),
        identity=identity,
    )
    assert decode_request(encoded) == Request(
        run, epoch, number, settings, robot, identity=identity
    )


@given(answer=ANSWERS)
def test_answer_round_trip(answer: Answer) -> None:
    assert exact(decode_answer(encode_answer(answer))) == exact(answer)


@given(data=st.binary(max_size=64))
def test_any_bytes_decode_or_are_malformed(data: bytes) -> None:
    for decode in DECODERS:
        with suppress(MalformedMessage):
            decode(data)


@given(data=st.data())
def test_damaged_bytes_decode_or_are_malformed(
    genomes: SearchStrategy[Genome], data: DataObject
) -> None:
    genome = data.draw(genomes)
    encoded = data.draw(
        st.sampled_from(
            [
                encode_genome(genome),
                encode_robot(develop(genome, BUILT_IN)),
                encode_answer(Answer(1, 2, 0.5, REPORT)),
            ]
        )
    )
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
    with suppress(MalformedMessage):
        answer = decode_answer(damaged)
        assert decode_answer(encode_answer(answer)) == answer


@pytest.mark.parametrize(
    "decode", [decode_robot, decode_body, decode_genome, decode_request]
)
def test_empty_bytes_are_not_a_robot(decode: Callable[[bytes], object]) -> None:
    with pytest.raises(MalformedMessage, match="at least the core"):
        decode(b"")


def test_answer_without_result_is_malformed() -> None:
    with pytest.raises(MalformedMessage, match="has no result"):
        decode_answer(pb.Answer(epoch=1, number=2).SerializeToString())


def test_report_of_zeros_round_trip() -> None:
    nowhere = (0.0, 0.0, 0.0)
    report = replace(REPORT, is_viable=False, lower=nowhere, upper=nowhere, mass=0.0)
    report = replace(report, motors=0)
    answer = Answer(0, 0, 0.0, report)
    assert decode_answer(encode_answer(answer)) == answer


@pytest.mark.parametrize("blank", ["", " \n\t"])
def test_a_failure_without_reason_says_so(blank: str) -> None:
    """The user of a run would read nothing in its table."""
    found = decode_answer(encode_answer(Answer(1, 2, 0.0, blank)))
    assert found.result == "(no message)"


@pytest.mark.parametrize(
    "result",
    [
        Evaluation(math.nan, 0.0, 0.0, 12.0),
        Evaluation(0.0, math.inf, 0.0, 12.0),
        Evaluation(0.0, 0.0, -math.inf, 12.0),
        Evaluation(0.0, 0.0, 0.0, math.nan),
        Evaluation(0.0, 0.0, 0.0, 12.0, (1.0, math.nan)),
        replace(REPORT, mass=math.inf),
        replace(REPORT, lower=(0.0, math.nan, 0.0)),
        replace(REPORT, reason="it is viable all the same"),
    ],
)
def test_result_that_breaks_a_rule_is_malformed(result: Report | Evaluation) -> None:
    with pytest.raises(MalformedMessage):
        decode_answer(encode_answer(Answer(1, 2, 0.5, result)))


def test_a_report_without_corners_is_malformed() -> None:
    message = pb.Answer(report=pb.Report(is_viable=True))
    with pytest.raises(MalformedMessage, match="both corners"):
        decode_answer(message.SerializeToString())


@pytest.mark.parametrize("decode", [decode_robot, decode_body])
def test_a_part_out_of_the_tree_is_malformed(
    node: NodeMaker, decode: Callable[[bytes], Robot]
) -> None:
    message = pb.Robot()
    message.ParseFromString(encode_robot(develop(node("Core"), BUILT_IN)))
    message.parts.add(kind="FixedBrick", parent=4, parent_slot=0, slot=0)
    with pytest.raises(MalformedMessage, match=r"Robot: body.parts\[1\].parent"):
        decode(message.SerializeToString())


def test_an_unknown_layer_is_malformed(node: NodeMaker) -> None:
    message = pb.Robot()
    message.ParseFromString(encode_robot(develop(node("Core"), BUILT_IN)))
    message.neurons.add(kind="Simple", parameters=(0.0, 0.5))
    with pytest.raises(MalformedMessage, match="layer: must be one of"):
        decode_robot(message.SerializeToString())


def test_parameters_of_a_neuron_gene_are_finite(node: NodeMaker) -> None:
    message = pb.Genome()
    message.ParseFromString(encode_genome(node("Core")))
    message.nodes[0].hidden.add(kind="Simple", parameters=(0.0, math.nan))
    with pytest.raises(MalformedMessage, match=r"neuron\.parameters: must be finite"):
        decode_genome(message.SerializeToString())


def test_neuron_types_are_checked_after_decoding(node: NodeMaker) -> None:
    """They may be those of a plug-in."""
    message = pb.Genome()
    message.ParseFromString(encode_genome(node("Core")))
    message.nodes[0].hidden.add(kind="Cosine", parameters=(0.0,))
    robot = develop(decode_genome(message.SerializeToString()), BUILT_IN)
    assert decode_robot(encode_robot(robot)) == robot
    with pytest.raises(InvalidRobot, match=r"must be one of Simple, .* got 'Cosine'"):
        check_robot(robot, BUILT_IN)


def test_unknown_fields_are_ignored(node: NodeMaker) -> None:
    robot = develop(node("Core"), BUILT_IN)
    # Field 99, a number.
    assert decode_robot(encode_robot(robot) + b"\x98\x06\x01") == robot
