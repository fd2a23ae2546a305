"""All decoders of bytes from other processes, with valid messages for each.

A decoder returns, or raises the error that its docstring names; anything else is a
fault. Decoders are as in ``Target``.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace

import tests.analyzers
from analysis.viewer.scene import Scene, scene_of
from analysis.viewer.watch import received_poses
from coordinator.dispatch.faults import PeerFaults
from coordinator.evolution.encodings import encoding_of
from coordinator.islands.events import JournalledEvent
from coordinator.network.membership import Membership
from coordinator.run.advance_checks import ExpectedAdvance, check_advance, check_poses
from coordinator.run.requests import read_answer, read_bred, read_evaluation
from coordinator.storage.journal import decode_record, encode_event
from revolve.fleet import _read_value
from schema.agent.network import Agent
from schema.agent.request_handler import Server
from schema.agent.topics import FleetMember, member_of
from schema.errors import (
    ExperimentError,
    InvalidRobot,
    MalformedMessage,
    RevolveError,
    RunFolderError,
)
from schema.experiment.document import Experiment, body_space
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
)
from schema.experiment.identity import Origin
from schema.experiment.settings import (
    arena_settings,
    breeding_settings,
    evaluation_settings,
    lasting,
    read_arena_settings,
    read_breeding_settings,
    read_evaluation_settings,
)
from schema.formats.files import robot_from_yaml
from schema.formats.robogen_json import robot_from_robogen_json
from schema.formats.robogen_text import robot_from_robogen_text
from schema.formats.yaml import robot_to_yaml
from schema.limits import (
    ADVANCE_BYTES,
    ADVANCE_REQUEST_BYTES,
    LIVE_BYTES,
    OPERATOR_REQUEST_BYTES,
    UPDATE_BYTES,
)
from schema.parts import BUILT_IN, BodySpace
from schema.plugins.source import check_plugins
from schema.robot.brain import check_brain
from schema.robot.inverse_development import genome_of
from schema.robot.robot import Robot, check_tree, check_types
from schema.wire.arena import (
    Advance,
    AdvanceShard,
    Changes,
    Insertion,
    Live,
    PastAdvance,
    Rebuild,
)
from schema.wire.calls import call_settings, pack_value, unpack_value
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.genome_bytes import encode_genome
from schema.wire.messages import (
    AgentInfo,
    Answer,
    Breed,
    Call,
    CallValue,
    Crash,
    Evaluate,
    Failure,
    Request,
    Result,
    RunningJob,
    StateMissing,
    Work,
)
from schema.wire.operator import (
    GetStatus,
    InsertRobot,
    ListRobots,
    OperatorReply,
    OperatorRequest,
    RemoveRobot,
    SetBrain,
    decode_operator_reply,
)
from schema.wire.protobuf import decode_genome, decode_robot, encode_robot
from schema.wire.status import IslandStatus, PeerFault, RunStatus, Status
from schema.wire.updates import (
    ArenaSample,
    Birth,
    Level,
    Migrant,
    RecordedDeath,
    Update,
    WorkerInfo,
    decode_page,
    pages_of,
)
from tests.coordinator.run.test_honest_worlds import advances, settings_of
from tests.coordinator.sent_requests import BIRTH, EXPERIMENT, JUDGED, ROBOT
from tests.coordinator.storage.test_journal import EVENTS
from tests.documents import parse_experiment
from worker.arena.world import World

JOB = (3, 5)
_VERSION = "1"
_WORKER = FleetMember("default", "worker", "w.00000001")


@dataclass(frozen=True, slots=True)
class Target:
    """A decoder, valid messages, the errors that it may raise, how often it runs."""

    name: str
    decode: Callable[[bytes], object]
    samples: tuple[bytes, ...]
    errors: tuple[type[Exception], ...] = (MalformedMessage,)
    share: int = 10


def targets() -> list[Target]:
    """Return all decoders."""
    rules = settings_of(
        arena={"record_touches": True},
        simulation={"warmup_steps": 0, "window_steps": 400},
    )
    made = list(advances(rules, [200, 400]))
    return [
        *_robots(),
        *_requests(rules, made[-1][0].snapshot),
        *_answers(made),
        *_viewers(made),
        *_operators(),
        *_agents(),
        *_journal(),
        *_files(rules),
    ]


def _robots() -> Iterator[Target]:
    yield Target("decode_robot", decode_robot, (encode_robot(ROBOT),))
    yield Target("decode_genome", decode_genome, (encode_genome(genome_of(ROBOT)),))


def _requests(rules: Experiment, snapshot: bytes) -> Iterator[Target]:
    settings = arena_settings(rules, Origin())
    changes = Changes((BIRTH,), (Insertion(BIRTH, ROBOT, (0.0, 0.0)),))
    past = PastAdvance(changes, 200, bytes(32))
    rebuild = Rebuild(snapshot, (past,), (BIRTH,))
    kept = (200, bytes(32), rebuild)
    advance = _request(AdvanceShard(0, 1, 400, changes, True, False, *kept), settings)
    evaluation = _request(Evaluate(BIRTH, ROBOT, 1, 400, 0), evaluation_settings(rules))
    breeding = _request(Breed(BIRTH, 0, 5), breeding_settings(rules))
    argument = Call(pack_value({"a": [1, 2.5, None, "é"]}))
    call = _request(argument, call_settings("lab:score"))
    requests = (advance, evaluation, breeding, call)
    yield _of(Request, ADVANCE_REQUEST_BYTES, *requests)
    for compute, samples in (
        (tests.analyzers.answer, (breeding,)),
        (_read_job, (evaluation, breeding, call)),
    ):
        reply = Server(compute, _agent()).reply
        # It refuses only what is no valid sample for it.
        assert all(reply(sample).answer for sample in samples)
        yield Target("Server.reply", reply, requests, (), share=20)
    prints = tuple(map(fingerprint, requests))
    yield Target("Server.cancel", Server(_read_job, _agent()).cancel, prints, ())
    yield Target("unpack_value", unpack_value, (argument.argument,))
    for name, read, sample in (
        ("breeding", read_breeding_settings, breeding_settings(rules)),
        ("evaluation", read_evaluation_settings, evaluation_settings(rules)),
        ("arena", read_arena_settings, settings),
    ):
        yield Target(f"settings of {name}", read, (sample,), (RevolveError,), share=3)
    own = read_arena_settings(settings)

    def restore(data: bytes) -> None:
        World.restore(own, data).close()

    yield Target("World.restore", restore, (snapshot,), (RevolveError,), share=1)
    text = b"schema.parts:LIGHT_SENSOR=" + b"0" * 64
    yield Target(
        "check_plugins",
        lambda data: check_plugins(data.decode("utf-8", "replace")),
        (text, text + b" " + text),
        (RevolveError,),
        share=3,
    )


def _request(work: Work, settings: bytes) -> bytes:
    return encode(Request("run", *JOB, work, settings, "", Origin(1, 0)))


def _of(kind: Any, most: int, *samples: bytes) -> Target:  # noqa: ANN401 - also unions
    """Return the target of a type of messages, or of a union of types."""
    name = getattr(kind, "__name__", "JournalledEvent")
    return Target(name, partial(decode, kind, most=most), samples)


def _agent() -> Agent:
    return Agent("worker", "w", "tcp/127.0.0.1:1")


def _read_job(request: Request) -> Result:
    """Read an evaluation request as a worker does; nothing is simulated."""
    work = request.work
    if isinstance(work, Evaluate):
        settings = read_evaluation_settings(request.settings)
        check_tree(work.robot.parts)
        check_brain(work.robot.brain, len(work.robot.parts))
        check_types(work.robot, body_space(settings.space))
        lasting(settings, work.steps)
    return Failure("not simulated")


def _answers(made: list[tuple[Advance, ExpectedAdvance]]) -> Iterator[Target]:
    def answer(result: Result) -> bytes:
        return encode(Answer(*JOB, 0.5, result))

    failed, value = answer(Failure("diverged")), answer(CallValue(pack_value([1])))
    breeding = Request("run", *JOB, Breed(BIRTH, 0, 5), breeding_settings(EXPERIMENT))
    evaluated, bred = answer(JUDGED), answer(tests.analyzers.answer(breeding))
    yield _of(Answer, ADVANCE_BYTES, evaluated, bred, failed, value)
    encoding = encoding_of(EXPERIMENT)
    breeding_of = partial(read_bred, request=breeding, encoding=encoding)
    yield Target("read_bred", breeding_of, (bred,))
    evaluation = partial(read_evaluation, expected=JOB)
    yield Target("read_evaluation", evaluation, (evaluated, failed))
    yield Target("_read_value", partial(_read_value, expected=JOB), (value, failed))
    for number, (advance, expected) in enumerate(made):
        read = partial(_read_advance, expected=expected)
        samples = (answer(advance), answer(StateMissing()))
        yield Target(f"advance checks {number}", read, samples, share=20)


def _read_advance(data: bytes, expected: ExpectedAdvance) -> None:
    """Check an answer as ``coordinator.run.shard_requests`` does."""
    answer = read_answer(data, JOB, Advance | StateMissing, ADVANCE_BYTES)
    advance = answer.result
    if isinstance(advance, Advance):
        check_advance(advance, expected)
        check_poses(advance, expected)


def _show_poses(data: bytes, scene: Scene) -> None:
    received_poses(decode(Live, data, LIVE_BYTES), scene)


def _viewers(made: list[tuple[Advance, ExpectedAdvance]]) -> Iterator[Target]:
    lives = [replace(advance, snapshot=b"") for advance, _ in made]
    scene = scene_of(read_experiment("scenario3"))
    sent = tuple(encode(Live("run", 0, each)) for each in lives)
    yield Target("received_poses", partial(_show_poses, scene=scene), sent)
    yield _of(Update, UPDATE_BYTES, encode(update()))
    yield Target("decode_page", decode_page, tuple(pages_of(update())))


def update() -> Update:
    """Return a message to viewers that holds everything that one can."""
    body = ROBOT.parts
    return Update(
        "run",
        JOB[0],
        1,
        True,
        "experiment",
        (Birth(BIRTH, (BIRTH,), 1, 1, 1.0, body), Birth(BIRTH, (), 0, 2, None, None)),
        (RecordedDeath(0, BIRTH, 2, 2.0, "culled"),),
        (Level(0, 2, 1, 1, 0.5, 0.5, (BIRTH,)),),
        (Migrant(BIRTH, 0, 1, 1, 2, 3.0),),
        (WorkerInfo("w", "platform", (0,)),),
        "{}",
        (ArenaSample(0, 2.0, "e", ((BIRTH, 1.0),), 1.0, ((BIRTH, BIRTH, True),)),),
    )


def _operators() -> Iterator[Target]:
    actions = (
        ListRobots(),
        GetStatus(),
        InsertRobot(ROBOT, (0.0, 1.0)),
        RemoveRobot(BIRTH),
        SetBrain(BIRTH, ROBOT),
    )
    requests = [encode(OperatorRequest("id", 0, action, "run")) for action in actions]
    yield _of(OperatorRequest, OPERATOR_REQUEST_BYTES, *requests)
    run = RunStatus("run", "x", 0, "running", 1.0, (IslandStatus(1, 2, 0.5, 1),))
    status = Status((run,), 1, 1, 1.0, (PeerFault("late", "w", 3),))
    reply = encode(OperatorReply("text", status=status))
    yield Target("decode_operator_reply", decode_operator_reply, (reply,))


def _agents() -> Iterator[Target]:
    info = AgentInfo(
        agent=_WORKER.name,
        kind="worker",
        slots=1,
        platform="p",
        version=_VERSION,
        deaths=(Crash(RunningJob("w.00000000", "run", 3, 4, bytes(8)), "SIGSEGV"),),
        shards=4,
        cores=1,
        quiet_s=0.5,
    )
    data = (encode(info),)

    def introduce(message: bytes) -> None:
        membership = Membership(_VERSION, PeerFaults())
        membership.appear(_WORKER.alive)
        membership.introduce(_WORKER, message)

    joined = Membership(_VERSION, PeerFaults())
    joined.appear(_WORKER.alive)
    joined.introduce(_WORKER, data[0])
    yield Target("Membership.introduce", introduce, data)
    yield Target("Membership.progress", partial(joined.progress, _WORKER), data)
    key = _WORKER.alive.encode()
    yield Target("member_of", lambda found: member_of(found.decode("latin-1")), (key,))


def _journal() -> Iterator[Target]:
    entries = tuple(map(encode_event, EVENTS))
    yield _of(JournalledEvent, ADVANCE_BYTES, *entries)
    record = partial(decode_record, Path("journal.bin"))
    yield Target("decode_record", record, entries, (RunFolderError,))


def _read_text(read: Callable[[str, str, BodySpace], Robot], data: bytes) -> Robot:
    return read(data.decode("latin-1"), "file", BUILT_IN)


def _files(rules: Experiment) -> Iterator[Target]:
    yaml = robot_to_yaml(ROBOT, BUILT_IN).encode()
    readers: tuple[Callable[[str, str, BodySpace], Robot], ...] = (
        robot_from_yaml,
        robot_from_robogen_text,
        robot_from_robogen_json,
    )
    for read in readers:
        samples = (
            (yaml,) if read is robot_from_yaml else (b"0 CoreComponent 0\n", b"{}")
        )
        errors = (InvalidRobot, MalformedMessage)
        decode = partial(_read_text, read)
        yield Target(read.__name__, decode, samples, errors, share=1)
    yield Target(
        "parse_experiment",
        lambda data: parse_experiment(data.decode("latin-1"), "file"),
        (b'name = "a"\nbirths = 25\n[selection]\npopulation = 8\n',),
        (ExperimentError,),
        share=1,
    )
    yield Target(
        "experiment_from_text",
        lambda data: experiment_from_text(data.decode("latin-1")),
        (experiment_text(rules).encode(),),
        (RevolveError,),
        share=1,
    )
