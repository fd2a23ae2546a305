"""Every request gets one reply; an invalid request gets the reason."""

import os
import signal
import time
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schema.agent.network import CANCELLED, FENCED, UNFIT, Agent
from schema.agent.request_handler import LONG_S, Reply, Server
from schema.agent.supervision import CurrentJob, Death, JobWatch, ProcessSlot, Task
from schema.errors import InvalidRobot, PluginDiffers, UnknownPlugin
from schema.limits import LONGEST_REASON, MOST_EPOCH
from schema.plugins.permission import allow
from schema.plugins.source import check_plugins, plugins_of
from schema.wire import revolve_pb2 as pb
from schema.wire.codec import fingerprint


def request(number: int = 1, epoch: int = 1, plugins: str = "") -> bytes:
    message = pb.Request(run="r", epoch=epoch, number=number, plugins=plugins)
    return message.SerializeToString()


def server(compute: Callable[[bytes], bytes] = lambda _: b"answer") -> Server:
    return Server(compute, Agent("worker", "w", "tcp/h:1", version="1"))


def test_request_gets_its_answer() -> None:
    made = server()
    assert made.reply(request()) == Reply(b"answer")
    assert (made.counts.answered, made.counts.refused) == (1, 0)


def test_only_the_answer_to_a_long_job_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def compute(data: bytes) -> bytes:
        asked.append(pb.Request.FromString(data).number)
        monkeypatch.setattr(time, "monotonic", lambda: 100.0 + LONG_S * len(asked))
        return b"%d" % asked[-1]

    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    made = server(compute)
    assert [made.reply(request(n)).answer for n in (1, 2, 1, 2)] == [b"1", b"2"] * 2
    assert asked == [1, 2]
    monkeypatch.undo()
    assert [made.reply(request(3)).answer for _ in range(2)] == [b"3", b"3"]
    assert made.reply(request(1, epoch=2)).answer == b"1"
    assert asked == [1, 2, 3, 3, 1]


def test_an_older_epoch_is_fenced_once() -> None:
    """A coordinator that repeats the job has found its run folder unchanged."""
    made = server()
    assert made.reply(request(epoch=2)) == Reply(b"answer")
    assert made.reply(request(epoch=1)).reason.startswith(FENCED)
    for forged in (2, 3, MOST_EPOCH):
        assert made.reply(request(epoch=1)) == Reply(b"answer")
        assert made.reply(request(epoch=forged)) == Reply(b"answer")


def test_the_coordinator_that_replaced_another_is_not_fenced() -> None:
    made = server()
    for epoch in (1, 2):
        assert made.reply(request(epoch=epoch)) == Reply(b"answer")
    assert made.reply(request(epoch=1)).reason.startswith(FENCED)
    assert made.reply(request(epoch=2)) == Reply(b"answer")


@pytest.mark.parametrize(
    ("data", "story"),
    [
        (request(epoch=MOST_EPOCH + 1), "Request.epoch: must be <= 4294967296"),
        (request(epoch=2**64 - 1), "Request.epoch: must be <= 4294967296"),
        (pb.Request(run="r" * 10_000).SerializeToString(), "must be <= 5000, got"),
    ],
)
def test_what_is_beyond_a_limit_is_malformed_and_not_remembered(
    data: bytes, story: str
) -> None:
    made = server()
    assert story in made.reply(data).reason
    made.cancel(data)
    assert (made.counts.malformed, made.counts.cancels) == (1, 1)
    assert made.reply(request(epoch=1)) == Reply(b"answer")


def test_number_of_remembered_runs_is_limited() -> None:
    made = server()
    for number in range(3000):
        message = pb.Request(run=f"r{number}", epoch=5)
        made.reply(message.SerializeToString())
    assert len(made._epochs) == 1000


def test_a_job_that_comes_again_is_done_however_often_it_is_cancelled() -> None:
    made = server()
    made.cancel(request(7))
    assert made.reply(request(7)) == Reply(reason=CANCELLED)
    for _ in range(3):
        made.cancel(request(7))
        assert made.reply(request(7)) == Reply(b"answer")


def test_cancelled_job_is_skipped_once() -> None:
    made = server()
    made.cancel(request(7))
    made.cancel(b"\xff")
    assert made.reply(request(6)) == Reply(b"answer")
    assert made.reply(request(7)).reason == "the job was cancelled"
    assert made.reply(request(7)) == Reply(b"answer")
    assert (made.counts.skipped, made.counts.cancels) == (1, 1)


def test_a_cancellation_needs_the_request_of_the_job() -> None:
    made = server()
    made.cancel(request(7, plugins="x"))
    assert made.reply(request(7)) == Reply(b"answer")


def test_number_of_cancelled_jobs_is_limited() -> None:
    made = server()
    for number in range(3000):
        made.cancel(request(number))
    assert len(made._cancelled) == 1000
    assert made.reply(request(2999)).reason


def raising(error: Exception) -> Callable[[bytes], bytes]:
    def compute(_: bytes) -> bytes:
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
    assert made.reply(request()) == Reply(reason=reason)
    assert made.counts.refused == 1


@pytest.mark.parametrize("error", [InvalidRobot, UnknownPlugin, ValueError])
def test_reasons_are_short_printable_lines(error: type[Exception]) -> None:
    """They quote the request, which may be long or meant for a terminal."""
    quoted = error("\x1b[2J\n" + "x" * 10_000_000)
    reason = server(raising(quoted)).reply(request()).reason
    assert len(reason) == LONGEST_REASON
    assert reason.isprintable()


def test_long_names_of_runs_are_refused_and_not_kept() -> None:
    made = server()
    data = pb.Request(run="x" * 5001, number=7).SerializeToString()
    made.cancel(data)
    assert "characters of Request.run" in made.reply(data).reason
    assert (made.counts.malformed, made.counts.cancels) == (1, 1)
    assert (made._cancelled, made._epochs) == ({}, {})


def test_agent_without_a_plugin_is_unfit() -> None:
    reply = server().reply(request(plugins="nowhere_to_be_found=abc"))
    assert reply.reason.startswith(f"{UNFIT}has no plug-in 'nowhere_to_be_found' among")
    assert reply.reason.endswith("add --plugins PATH/nowhere_to_be_found.py")


@settings(derandomize=True, deadline=None)
@given(st.binary(max_size=64))
def test_any_bytes_get_a_reply(data: bytes) -> None:
    reply = server().reply(data)
    assert bool(reply.answer) != bool(reply.reason)


def test_agent_info_holds_the_deaths() -> None:
    death = Death(Task("v", "r", 3, 7, b"12345678"), "SIGSEGV")
    agent = Agent("worker", "w", "tcp/h:1", version="1", platform="p")
    info = pb.AgentInfo.FromString(
        Server(bytes, agent, ProcessSlot(0, None, (death,))).info
    )
    (told,) = info.deaths
    assert (told.agent, told.run, told.epoch, told.number) == ("v", "r", 3, 7)
    assert (told.cause, told.request) == ("SIGSEGV", b"12345678")


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
    noted: list[Task | None] = []

    def compute(_: bytes) -> bytes:
        nonlocal now_s
        if is_cancelled:
            made.cancel(request(1))
        for _second in range(waited_s):
            assert sent == []
            now_s += 1.0
            made.look()
        assert slot.note is not None
        noted.append(slot.note.read())
        told = pb.AgentInfo.FromString(made.info)
        assert told.quiet_s == waited_s
        return b"answer"

    agent = Agent(
        "worker", "w", "tcp/h:1", threads=3, shards=9, wait_limit_s=60.0, version="1"
    )
    watch = JobWatch(lambda: 0.0, lambda: now_s)
    made = Server(compute, agent, slot, watch=watch)
    made.reply(request(1))
    assert sent == signals
    is_blamed = sent != [signal.SIGKILL]
    doing = Task("w", "r", 1, 1, fingerprint(request(1)))
    assert noted == [doing if is_blamed else None]
    now_s += 1000.0
    made.look()
    assert sent == signals
    told = pb.AgentInfo.FromString(made.info)
    assert not told.HasField("quiet_s")
    assert (told.shards, told.cores) == (9, 3)


def test_plugins_are_identified_by_their_source(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path_factory.mktemp("plugged")
    (folder / "plugged_one.py").write_text("x = 1\n")
    (folder / "plugged_two").mkdir()
    (folder / "plugged_two" / "inner.py").write_text("y = 1\n")
    (folder / "plugged_two" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(folder))
    named = b'["plugged_two.inner:y", "schema.parts:CORE", "plugged_one:x", "a:b c"]'
    wanted = plugins_of(named)
    one, two = wanted.split()
    assert one.startswith("plugged_one=")
    assert two.startswith("plugged_two=")
    with pytest.raises(PluginDiffers, match="has no plug-in 'plugged_two' among"):
        check_plugins(two)
    allow(["plugged_one", "plugged_two"])
    check_plugins(wanted)
    reply = server().reply(request(plugins=f"plugged_one=0 {two}"))
    digest = one.partition("=")[2]
    differs = (
        f"{UNFIT}its plug-in 'plugged_one' differs from the coordinator's: source "
        f"digest {digest}, expected 0: give {folder}/plugged_one.py the content that "
        "it had when the run began"
    )
    assert reply.reason == differs
    wants_two = pb.Request(run="lab:1a2b:/runs/a", epoch=1, plugins="plugged_two=0")
    reply = server().reply(wants_two.SerializeToString())
    assert reply.reason.endswith(
        ", or start this process with the run's copy: "
        "--plugins plugged_two=/runs/a/plugins/plugged_two"
    )
    assert server().reply(request(plugins=wanted)) == Reply(b"answer")
    assert plugins_of(b'{"function":"worker.fitness:thesis"}') == ""
