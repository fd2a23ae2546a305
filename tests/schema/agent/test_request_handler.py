"""Every request gets one reply; an invalid request gets the reason."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from schema.agent.network import CANCELLED, FENCED, UNFIT, Agent
from schema.agent.request_handler import LONG_S, Compute, Server
from schema.agent.supervision import CurrentJob, JobWatch, ProcessSlot
from schema.errors import InvalidRobot, PluginDiffers, UnknownPlugin
from schema.limits import (
    ANSWER_BYTES,
    INFO_BYTES,
    LONGEST_REASON,
    MOST_EPOCH,
    REQUEST_BYTES,
)
from schema.plugins.permission import allow
from schema.plugins.source import check_plugins, plugins_of
from schema.robot.ids import NOBODY
from schema.robot.results import Evaluation
from schema.robot.robot import Part, Robot
from schema.wire.arena import AdvanceShard, Changes, Rebuild
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.messages import (
    AgentInfo,
    Answer,
    Crash,
    Evaluate,
    Failure,
    Reply,
    Request,
    Result,
    RunningJob,
    StateMissing,
    Work,
)

ROBOT = Robot((Part("Core", -1, -1, -1, 0, ()),))
EVALUATE = Evaluate(NOBODY, ROBOT)
ANSWER = Evaluation(0.25, 0.0, 0.0, 12.0)


def request(
    number: int = 1,
    epoch: int = 1,
    plugins: str = "",
    run: str = "r",
    work: Work = EVALUATE,
) -> bytes:
    return encode(Request(run, epoch, number, work, b"{}", plugins))


def advance(number: int, island: int = 0, *, run: str = "r") -> bytes:
    work = AdvanceShard(island, 0, 10 * number, Changes(), False)
    return request(number, run=run, work=work)


def server(compute: Compute = lambda _: ANSWER, shards: int = 1) -> Server:
    agent = Agent("worker", "w", "tcp/h:1", shards=shards, version="1")
    return Server(compute, agent)


def result(reply: Reply) -> Result:
    """Return the result in the answer of a reply."""
    assert reply.reason == ""
    return decode(Answer, reply.answer, ANSWER_BYTES).result


def counting() -> tuple[Compute, list[int]]:
    """Return what answers by the number of a request, and the numbers it was asked."""
    asked: list[int] = []

    def compute(wanted: Request) -> Result:
        asked.append(wanted.number)
        return Failure(f"{wanted.number}")

    return compute, asked


def test_request_gets_its_answer() -> None:
    made = server()
    answer = decode(Answer, made.reply(request(7, 3)).answer, ANSWER_BYTES)
    assert (answer.epoch, answer.number, answer.result) == (3, 7, ANSWER)
    assert 0.0 < answer.wall_s < 60.0
    assert (made.counts.answered, made.counts.refused) == (1, 0)


def test_only_the_answer_to_a_long_job_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    compute, asked = counting()
    made = server(compute)
    with monkeypatch.context() as patch:
        patch.setattr(time, "monotonic", lambda: 100.0 + LONG_S * len(asked))
        replies = [made.reply(request(number)) for number in (1, 2, 1, 2)]
    assert asked == [1, 2]
    assert replies[:2] == replies[2:]
    assert result(replies[0]) == Failure("1")
    for _ in range(2):
        made.reply(request(3))
    made.reply(request(1, epoch=2))
    assert asked == [1, 2, 3, 3, 1]


def test_the_last_advance_of_each_arena_is_answered_from_memory() -> None:
    """The arena has moved on, so that it cannot be done again."""
    compute, asked = counting()
    made = server(compute, shards=2)
    first = made.reply(advance(1))
    for _ in range(3):
        assert made.reply(advance(1)) == first
    made.reply(advance(2, island=1))
    made.reply(request(3))
    assert made.reply(advance(1)) == first
    assert asked == [1, 2, 3]
    # Only the last answer is kept, and of as many arenas as the worker keeps.
    made.reply(advance(4))
    made.reply(advance(1))
    assert asked == [1, 2, 3, 4, 1]
    made.reply(advance(5, run="other"))
    made.reply(advance(2, island=1))
    assert asked == [1, 2, 3, 4, 1, 5, 2]


ADVANCE = AdvanceShard(0, 0, 9, Changes(), False)
REBUILD = Rebuild(b"snapshot", ())


@pytest.mark.parametrize("work", [ADVANCE, replace(ADVANCE, rebuild=REBUILD)])
def test_an_advance_that_is_assigned_again_is_answered_from_memory(work: Work) -> None:
    """Its worker was lost for a moment, and may have several requests by now."""
    compute, asked = counting()
    made = server(compute)
    first = made.reply(request(1, work=ADVANCE))
    for number in (2, 3):
        reply = made.reply(request(number, work=work))
        assert result(reply) == result(first)
        assert decode(Answer, reply.answer, ANSWER_BYTES).number == number
    assert asked == [1]


def test_an_advance_without_its_state_is_done_when_the_state_comes() -> None:
    given: list[object] = []

    def compute(wanted: Request) -> Result:
        assert isinstance(wanted.work, AdvanceShard)
        given.append(wanted.work.rebuild)
        return Failure("done") if wanted.work.rebuild else StateMissing()

    made = server(compute)
    assert result(made.reply(request(1, work=ADVANCE))) == StateMissing()
    whole = replace(ADVANCE, rebuild=REBUILD)
    assert result(made.reply(request(2, work=whole))) == Failure("done")
    assert given == [None, REBUILD]


@pytest.mark.parametrize(
    "other",
    [
        {"epoch": 2},
        {"run": "s"},
        {"plugins": " "},
        {"work": replace(ADVANCE, wants_snapshot=True)},
        {"work": replace(ADVANCE, rebuild=replace(REBUILD, living=()))},
    ],
)
def test_another_request_is_not_answered_from_memory(other: dict[str, Any]) -> None:
    compute, asked = counting()
    made = server(compute, shards=9)
    made.reply(request(work=ADVANCE))
    made.reply(request(**{"work": ADVANCE, **other}))
    assert len(asked) == 2


def test_an_older_epoch_is_fenced_once() -> None:
    """A coordinator that repeats the job has found its run folder unchanged."""
    made = server()
    for epoch in (1, 2):
        assert result(made.reply(request(epoch=epoch))) == ANSWER
    assert made.reply(request(epoch=1)).reason.startswith(FENCED)
    for forged in (2, 3, MOST_EPOCH):
        assert result(made.reply(request(epoch=1))) == ANSWER
        assert result(made.reply(request(epoch=forged))) == ANSWER


@pytest.mark.parametrize(
    ("data", "story"),
    [
        (request(epoch=MOST_EPOCH + 1), "<= 4294967296"),
        (request(epoch=2**64 - 1), "<= 4294967296"),
        (request(run="r" * 5001), "length <= 5000"),
    ],
)
def test_what_is_beyond_a_limit_is_malformed_and_not_remembered(
    data: bytes, story: str
) -> None:
    made = server()
    assert story in made.reply(data).reason
    assert made.counts.malformed == 1
    assert made._epochs == {}


def test_an_analyzer_takes_no_request_as_large_as_one_about_an_arena() -> None:
    large = encode(Request("r", 1, 1, EVALUATE, bytes(REQUEST_BYTES)))
    assert result(server().reply(large)) == ANSWER
    made = Server(lambda _: ANSWER, Agent("analyzer", "a", "tcp/h:1", version="1"))
    assert "must be <= 16777216 bytes" in made.reply(large).reason


def test_memory_of_runs_and_cancellations_is_limited() -> None:
    made = server()
    for number in range(3000):
        made.reply(request(run=f"r{number}", epoch=5))
        made.cancel(fingerprint(request(number)))
    assert len(made._epochs) == len(made._cancelled) == 1000


def test_cancelled_job_is_skipped_once_and_done_if_it_comes_again() -> None:
    made = server()
    made.cancel(fingerprint(request(7)))
    for other in (b"\xff" * 7, request(6), fingerprint(request(8, plugins="x"))):
        made.cancel(other)
    for number in (6, 8):
        assert result(made.reply(request(number))) == ANSWER
    assert made.reply(request(7)) == Reply(0, reason=CANCELLED)
    for _ in range(3):
        assert result(made.reply(request(7))) == ANSWER
        made.cancel(fingerprint(request(7)))
    assert (made.counts.skipped, made.counts.cancels) == (1, 2)


def raising(error: Exception) -> Compute:
    def compute(_: Request) -> Result:
        raise error

    return compute


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (InvalidRobot("no core"), "no core"),
        (UnknownPlugin("fitness: no module"), f"{UNFIT}fitness: no module"),
        (ZeroDivisionError("by zero"), "ZeroDivisionError: by zero"),
    ],
)
def test_error_is_the_reason_of_the_reply(error: Exception, reason: str) -> None:
    made = server(raising(error))
    assert made.reply(request()) == Reply(0, reason=reason)
    assert made.counts.refused == 1
    # It may quote the request, which may be long or meant for a terminal.
    quoted = type(error)("\x1b[2J\n" + "x" * 10_000_000)
    reason = server(raising(quoted)).reply(request()).reason
    assert len(reason) == LONGEST_REASON
    assert reason.isprintable()


def test_agent_info_holds_the_deaths() -> None:
    death = Crash(RunningJob("v", "r", 3, 7, b"12345678"), "SIGSEGV")
    agent = Agent("worker", "w", "tcp/h:1", version="1", platform="p")
    made = Server(lambda _: ANSWER, agent, ProcessSlot(0, None, (death,)))
    info = decode(AgentInfo, made.info, INFO_BYTES)
    assert info.deaths == (death,)


@pytest.mark.parametrize(
    ("is_cancelled", "waited_s", "signals"),
    [
        (False, 60, []),
        (False, 61, [signal.SIGVTALRM]),
        (True, 10, []),
        # Another process may have done the job: it is not to blame.
        (True, 11, [signal.SIGKILL]),
    ],
)
def test_job_that_waits_too_long_loses_its_process(
    monkeypatch: pytest.MonkeyPatch,
    *,
    is_cancelled: bool,
    waited_s: int,
    signals: list[int],
) -> None:
    sent: list[int] = []
    monkeypatch.setattr(os, "kill", lambda _, number: sent.append(number))
    now_s = 0.0
    slot = ProcessSlot(0, CurrentJob())
    noted: list[RunningJob | None] = []

    def compute(_: Request) -> Result:
        nonlocal now_s
        if is_cancelled:
            made.cancel(fingerprint(request(1)))
        for _second in range(waited_s):
            assert sent == []
            now_s += 1.0
            made.look()
        assert slot.note is not None
        noted.append(slot.note.read())
        assert decode(AgentInfo, made.info, INFO_BYTES).quiet_s == waited_s
        return ANSWER

    agent = Agent(
        "worker", "w", "tcp/h:1", threads=3, shards=9, wait_limit_s=60.0, version="1"
    )
    watch = JobWatch(lambda: 0.0, lambda: now_s)
    made = Server(compute, agent, slot, watch=watch)
    made.reply(request(1))
    assert sent == signals
    is_blamed = sent != [signal.SIGKILL]
    doing = RunningJob("w", "r", 1, 1, fingerprint(request(1)))
    assert noted == [doing if is_blamed else None]
    now_s += 1000.0
    made.look()
    assert sent == signals
    told = decode(AgentInfo, made.info, INFO_BYTES)
    assert told.quiet_s is None
    assert (told.shards, told.cores) == (9, 3)


def test_plugins_are_identified_by_their_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "plugged_one.py").write_text("x = 1\n")
    (tmp_path / "plugged_two").mkdir()
    (tmp_path / "plugged_two" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    wanted = plugins_of(b'["plugged_two:y", "schema.parts:CORE", "plugged_one:x"]')
    one, two = (entry.partition("=") for entry in wanted.split())
    assert (one[0], two[0]) == ("plugged_one", "plugged_two")
    with pytest.raises(PluginDiffers, match="has no plug-in 'plugged_one' among"):
        check_plugins(wanted)
    allow(["plugged_one", "plugged_two"])
    assert result(server().reply(request(plugins=wanted))) == ANSWER
    reply = server().reply(request(plugins="plugged_one=0"))
    assert reply.reason.startswith(
        f"{UNFIT}its plug-in 'plugged_one' differs from the coordinator's: source "
        f"digest {one[2]}, expected 0: "
    )
    reply = server().reply(request(run="lab:1a2b:/runs/a", plugins="plugged_two=0"))
    assert reply.reason.endswith("plugged_two=/runs/a/plugins/plugged_two")
