"""All decoders of bytes from other processes, with valid messages for each.

A decoder returns, or raises the error that its docstring names; anything else is a
fault. Decoders are as in ``Target``.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import analyzer.report
from coordinator.dispatch.faults import PeerFaults
from coordinator.islands.events import (
    Advanced,
    Commanded,
    Evaluated,
    EvaluationFailed,
    Insert,
    Pause,
    Remove,
    Vetted,
)
from coordinator.network.membership import Membership
from coordinator.run.advance_checks import (
    ExpectedAdvance,
    check_advance,
    check_answer,
    place_poses,
    read_poses,
)
from coordinator.run.requests import read_evaluation, read_vetting
from coordinator.storage.journal import decode_entry, decode_record, encode_entry
from schema.agent.network import Agent
from schema.agent.request_handler import Server
from schema.agent.topics import Member, member_of
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
)
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import (
    arena_settings,
    evaluation_settings,
    lasting,
    read_arena_settings,
    read_evaluation_settings,
    read_vetting_settings,
    vetting_settings,
)
from schema.formats.files import robot_from_yaml
from schema.formats.robogen_json import robot_from_robogen_json
from schema.formats.robogen_text import robot_from_robogen_text
from schema.formats.yaml import robot_to_yaml
from schema.limits import LIVE_BYTES, MOST_LIVE_ROWS
from schema.parts import BUILT_IN, BodySpace
from schema.plugins.source import check_plugins
from schema.robot.inverse_development import genome_of
from schema.robot.results import Provenance
from schema.robot.robot import Robot, check_types
from schema.tables.received import received_columns
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import Advance, Changes, Insertion, Live, PastAdvance, Rebuild
from schema.wire.arena_codec import (
    AdvanceAnswer,
    AdvanceRequest,
    decode_advance_answer,
    decode_advance_request,
    decode_live,
    encode_advance_answer,
    encode_advance_request,
    encode_live,
)
from schema.wire.calls import (
    Call,
    call_settings,
    decode_call_request,
    encode_call_answer,
    encode_call_request,
    pack_value,
    read_call_answer,
)
from schema.wire.codec import (
    decode_answer,
    decode_body,
    decode_request,
    encode_answer,
    encode_body,
    encode_request,
    request_kind,
)
from schema.wire.messages import Answer
from schema.wire.operator import (
    GetStatus,
    InsertRobot,
    ListRobots,
    OperatorReply,
    OperatorRequest,
    RemoveRobot,
    SetBrain,
    decode_operator_reply,
    decode_operator_request,
    encode_operator_reply,
    encode_operator_request,
)
from schema.wire.protobuf import (
    decode_genome,
    decode_robot,
    encode_genome,
    encode_robot,
)
from schema.wire.status import IslandStatus, PeerFault, RunStatus, Status
from schema.wire.updates import (
    Birth,
    Death,
    Level,
    Migrant,
    Update,
    WorkerInfo,
    decode_page,
    decode_update,
    encode_update,
    pages_of,
)
from tests.coordinator.run.test_honest_worlds import advances, settings_of
from tests.coordinator.sent_requests import BIRTH, JUDGED, ROBOT, VIABLE
from tests.documents import parse_experiment
from worker.arena.world import World

JOB = (3, 5)
_SIGNED = Provenance("worker", "platform", 0.5)
_SECONDS = 12.0
_VERSION = "1"
_WORKER = Member("default", "worker", "w.00000001")


@dataclass(frozen=True, slots=True)
class Target:
    """A decoder.

    Attributes:
        name: of the decoder.
        decode: takes bytes.
        samples: valid messages.
        errors: that it may raise.
        share: how often it is tested, relative to the others.
    """

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
        *_requests(rules, made[-1][1]),
        *_answers(made),
        *_calls(),
        *_viewers(made),
        *_operators(),
        *_agents(),
        *_journal(made),
        *_files(rules),
    ]


def _robots() -> Iterator[Target]:
    yield Target("decode_robot", decode_robot, (encode_robot(ROBOT),))
    yield Target("decode_body", decode_body, (encode_body(ROBOT),))
    yield Target("decode_genome", decode_genome, (encode_genome(genome_of(ROBOT)),))


def _request(settings: bytes, robot: bytes) -> bytes:
    return encode_request(
        run="run",
        epoch=JOB[0],
        number=JOB[1],
        settings=settings,
        robot=robot,
        identity=Identity(Origin(1, 0), BIRTH, 0),
    )


def _requests(rules: Experiment, snapshot: bytes) -> Iterator[Target]:
    settings = arena_settings(rules, Origin())
    changes = Changes((BIRTH,), (Insertion(BIRTH, ROBOT, (0.0, 0.0)),))
    past = PastAdvance(changes, 200, bytes(32))
    rebuild = Rebuild(snapshot, (past,), (BIRTH,))
    advance = encode_advance_request(
        AdvanceRequest(
            "run", *JOB, settings, 0, 200, bytes(32), changes, 400, True, rebuild
        )
    )
    single = _request(evaluation_settings(rules), encode_robot(ROBOT))
    vetting = _request(vetting_settings(rules), encode_body(ROBOT))
    both = (single, advance)
    yield Target("decode_request", decode_request, (single,))
    body = partial(decode_request, read=decode_body)
    yield Target("decode_request, body", body, (vetting,))
    yield Target("request_kind", request_kind, both)
    yield Target("decode_advance_request", decode_advance_request, (advance,))
    yield Target(
        "analyzer's answer", analyzer.report.answer, (vetting,), (RevolveError,)
    )
    yield Target("worker's reading", _read_job, (single,), (RevolveError,))
    yield Target("Server.reply", Server(_read_job, _agent()).reply, both, ())
    yield Target("Server.cancel", Server(_read_job, _agent()).cancel, both, ())
    for read, sample in (
        (read_vetting_settings, vetting_settings(rules)),
        (read_evaluation_settings, evaluation_settings(rules)),
        (read_arena_settings, settings),
    ):
        yield Target(read.__name__, read, (sample,), (RevolveError,), share=3)
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


def _agent() -> Agent:
    return Agent("worker", "w", "tcp/127.0.0.1:1")


def _read_job(data: bytes) -> bytes:
    """Read an evaluation request as a worker does; nothing is simulated."""
    job = decode_request(data)
    settings = read_evaluation_settings(job.settings)
    check_types(job.robot, body_space(settings.space))
    lasting(settings, job.steps)
    return data


def _answers(made: list[tuple[Advance, bytes, ExpectedAdvance]]) -> Iterator[Target]:
    evaluated = encode_answer(Answer(*JOB, 0.5, JUDGED))
    vetted = encode_answer(Answer(*JOB, 0.5, VIABLE))
    failed = encode_answer(Answer(*JOB, 0.5, "diverged"))
    space = BUILT_IN
    yield Target("decode_answer", decode_answer, (evaluated, vetted, failed))
    vetting = partial(read_vetting, expected=JOB, robot=ROBOT, space=space)
    yield Target("read_vetting", vetting, (vetted, failed))
    evaluation = partial(read_evaluation, expected=JOB, simulated_s=_SECONDS)
    yield Target("read_evaluation", evaluation, (evaluated, failed))
    for number, (advance, snapshot, expected) in enumerate(made):
        answer = AdvanceAnswer(*expected.job, 0.5, advance, snapshot)
        without = AdvanceAnswer(*expected.job, 0.5, None)
        samples = (encode_advance_answer(answer), encode_advance_answer(without))
        read = partial(_read_advance, expected=expected)
        yield Target(f"advance checks {number}", read, samples)
        yield Target("decode_advance_answer", decode_advance_answer, samples)
        poses = partial(read_poses, advance=advance, expected=expected)
        yield Target(f"pose checks {number}", poses, (advance.poses,))


def _read_advance(data: bytes, expected: ExpectedAdvance) -> None:
    """Check an answer as ``coordinator.run.shard_requests`` does."""
    answer = decode_advance_answer(data, expected.most_bytes)
    check_answer(answer, expected)
    if answer.advance is None:
        return
    check_advance(answer.advance, expected)
    rows = read_poses(answer.advance.poses, answer.advance, expected)
    place_poses(answer.advance.poses, rows, 0)


def _viewers(made: list[tuple[Advance, bytes, ExpectedAdvance]]) -> Iterator[Target]:
    lives = tuple(encode_live(Live("run", 0, advance)) for advance, _, _ in made)
    yield Target("decode_live", decode_live, lives)
    columns = partial(
        received_columns, "poses", most_bytes=LIVE_BYTES, most_rows=MOST_LIVE_ROWS
    )
    yield Target("received_columns", columns, tuple(each[0].poses for each in made))
    yield Target("decode_update", decode_update, (encode_update(update()),))
    yield Target("decode_page", decode_page, tuple(pages_of(update())))


def update() -> Update:
    """Return a message to viewers that holds everything that one can."""
    body = encode_body(ROBOT)
    return Update(
        "run",
        JOB[0],
        1,
        True,
        "experiment",
        (Birth(BIRTH, (BIRTH,), 1, 1, 1.0, body), Birth(BIRTH, (), 0, 2, None, None)),
        (Death(0, BIRTH, 2, 2.0, "culled"),),
        (Level(0, 2, 1, 1, 0.5, 0.5, (BIRTH,)),),
        (Migrant(BIRTH, 0, 1, 1, 2, 3.0),),
        (WorkerInfo("w", "platform", (0,)),),
        "{}",
    )


def _operators() -> Iterator[Target]:
    robot = encode_robot(ROBOT)
    actions = (
        ListRobots(),
        GetStatus(),
        InsertRobot(robot, (0.0, 1.0)),
        RemoveRobot(BIRTH),
        SetBrain(BIRTH, robot),
    )
    requests = tuple(
        encode_operator_request(OperatorRequest("id", 0, action, "run"))
        for action in actions
    )
    yield Target("decode_operator_request", decode_operator_request, requests)
    run = RunStatus("run", "x", 0, "running", 1.0, (IslandStatus(1, 2, 0.5, 1),))
    status = Status((run,), 1, 1, 1.0, (PeerFault("late", "w", 3),))
    reply = encode_operator_reply(OperatorReply("text", status=status))
    yield Target("decode_operator_reply", decode_operator_reply, (reply,))


def _calls() -> Iterator[Target]:
    value = pack_value({"a": [1, 2.5, None, "é"]})
    request = encode_call_request(
        run="run",
        epoch=JOB[0],
        number=JOB[1],
        settings=call_settings("lab:score"),
        argument=value,
        plugins="",
    )
    answer = encode_call_answer(Call(*JOB, "lab:score", None), 0.1, value)
    yield Target("decode_call_request", decode_call_request, (request,))
    yield Target("read_call_answer", partial(read_call_answer, expected=JOB), (answer,))


def _agents() -> Iterator[Target]:
    info = pb.AgentInfo(
        agent=_WORKER.name,
        kind="worker",
        slots=1,
        platform="p",
        version=_VERSION,
        shards=4,
        cores=1,
        quiet_s=0.5,
    )
    info.deaths.add(agent="w.00000000", run="run", epoch=3, number=4, cause="SIGSEGV")
    data = (info.SerializeToString(),)

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


def _journal(made: list[tuple[Advance, bytes, ExpectedAdvance]]) -> Iterator[Target]:
    advance = made[0][0]
    events = (
        Evaluated(BIRTH, JUDGED, _SIGNED),
        EvaluationFailed(BIRTH, "diverged", _SIGNED),
        Vetted(BIRTH, 0, VIABLE),
        Advanced(0, 1, advance, 9, _SIGNED),
        Commanded(0, "id", 200, Insert(encode_genome(genome_of(ROBOT)), (0.0, 1.0))),
        Commanded(0, "id", 200, Remove(BIRTH)),
        Commanded(0, "id", 200, Pause()),
    )
    entries = tuple(encode_entry(event) for event in events)
    yield Target("decode_entry", decode_entry, entries)
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
