"""Order of an agent's requests, and one reply for each.

Requests of replaced coordinators, requests that need other plug-ins and cancelled jobs
are refused and counted. Any bytes from a peer and any error of a plug-in get a reply.

Any process that reaches the hub may claim to be a newer coordinator of a run, or cancel
a job. Neither can stop a run: a coordinator is refused once, and a job is cancelled
once. A coordinator that was really replaced finds that in its run folder and stops; one
that was not repeats the job.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from msgspec.structs import replace

from schema.agent.network import CANCELLED, FENCED, UNFIT, Agent
from schema.agent.supervision import JobWatch, ProcessSlot, thread_clock
from schema.errors import (
    MalformedMessage,
    PluginDiffers,
    RevolveError,
    UnknownPlugin,
    error_text,
)
from schema.limits import (
    ADVANCE_BYTES,
    ADVANCE_REQUEST_BYTES,
    LONGEST_REASON,
    REQUEST_BYTES,
    printable,
)
from schema.plugins.source import check_plugins
from schema.wire.arena import AdvanceShard
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.messages import (
    AgentInfo,
    Answer,
    Reply,
    Request,
    Result,
    RunningJob,
    StateMissing,
)

_MOST_REMEMBERED = 1000
LONG_S = 60.0
"""Answers to jobs that took as long are kept: their requests may come again [s].

So is the last answer about each arena, however short it took: the arena has moved on.
"""
_MOST_LONG = 32
_FINGERPRINT_BYTES = 8
_CANCELLED_S = 10.0
"""Time after which a cancelled job that waits loses its process [s]."""

K = TypeVar("K")
V = TypeVar("V")


@dataclass(slots=True)
class ReplyCounts:
    """Counts of an agent's replies.

    Attributes:
        refused: jobs with a reason, malformed requests included.
        cancels: cancellations that do not decode.
        crowd: requests that were dropped because too many waited.
    """

    answered: int = 0
    refused: int = 0
    malformed: int = 0
    skipped: int = 0
    cancels: int = 0
    crowd: int = 0


Compute = Callable[[Request], Result]
"""Does the work of a request; it raises if the request is bad."""


def answer(compute: Compute, request: Request) -> bytes:
    """Return the encoded answer to a request."""
    began_s = time.perf_counter()
    result = compute(request)
    wall_s = time.perf_counter() - began_s
    return encode(Answer(request.epoch, request.number, wall_s, result))


@dataclass(slots=True)
class Server:
    """Answers single requests; knows the newest coordinator of each run.

    The thread that makes it does the jobs.
    """

    compute: Compute
    agent: Agent
    slot: ProcessSlot = field(default_factory=ProcessSlot)
    counts: ReplyCounts = field(default_factory=ReplyCounts)
    watch: JobWatch = field(
        default_factory=lambda: JobWatch(thread_clock(threading.get_ident()))
    )
    _epochs: dict[str, int] = field(default_factory=dict)
    _fenced: dict[tuple[str, int], None] = field(default_factory=dict)
    _cancelled: dict[bytes, None] = field(default_factory=dict)
    _skipped: dict[bytes, None] = field(default_factory=dict)
    _answers: dict[RunningJob, bytes] = field(default_factory=dict)
    _advances: dict[tuple[str, int], tuple[Request, bytes]] = field(
        default_factory=dict
    )

    @property
    def info(self) -> bytes:
        """Bytes of the ``AgentInfo`` of this agent."""
        agent = self.agent
        return encode(
            AgentInfo(
                agent=agent.name,
                kind=agent.role,
                slots=agent.slots,
                platform=agent.platform,
                version=agent.version,
                deaths=self.slot.deaths,
                shards=agent.shards,
                cores=agent.threads,
                quiet_s=self.watch.quiet_s,
            )
        )

    def cancel(self, data: bytes) -> None:
        """Note that the job of a fingerprint is cancelled; from any thread."""
        if len(data) != _FINGERPRINT_BYTES:
            self.counts.cancels += 1
            return
        _remember(data, None, self._cancelled)

    def reply(self, data: bytes, place: int = 0) -> Reply:
        """Return the reply to any bytes, which had a place among others."""
        try:
            is_analyzer = self.agent.role == "analyzer"
            most = REQUEST_BYTES if is_analyzer else ADVANCE_REQUEST_BYTES
            request = decode(Request, data, most)
            self._check(request)
            name = (request.run, request.epoch, request.number)
            task = RunningJob(self.agent.name, *name, fingerprint(data))
            if known := self._known(task, request):
                return Reply(place, known)
            # A job that comes again is wanted, whatever cancelled it before.
            if task.request in self._cancelled and task.request not in self._skipped:
                _remember(task.request, None, self._skipped)
                self.counts.skipped += 1
                return Reply(place, reason=CANCELLED)
            began_s = time.monotonic()
            self.watch.begin(task)
            with self.slot.doing(task, self.agent.cpu_limit_s):
                answered = answer(self.compute, request)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.counts.refused += 1
            self.counts.malformed += isinstance(error, MalformedMessage)
            is_ours = isinstance(error, RevolveError)
            reason = str(error) if is_ours else error_text(error)
            if isinstance(error, UnknownPlugin | PluginDiffers):
                reason = f"{UNFIT}{reason}"
            return Reply(place, reason=printable(reason, LONGEST_REASON))
        finally:
            self.watch.end()
        self.counts.answered += 1
        if isinstance(request.work, AdvanceShard):
            arena, last = (request.run, request.work.island), _repeatable(request)
            _remember(arena, (last, answered), self._advances, self.agent.shards)
        elif time.monotonic() - began_s >= LONG_S:
            _remember(task, answered, self._answers, _MOST_LONG)
        return Reply(place, answered)

    def _known(self, task: RunningJob, request: Request) -> bytes | None:
        if not isinstance(request.work, AdvanceShard):
            return self._answers.get(task)
        last, answered = self._advances.get(
            (request.run, request.work.island), (None, b"")
        )
        if last != _repeatable(request):
            return None
        known = decode(Answer, answered, ADVANCE_BYTES)
        if isinstance(known.result, StateMissing):
            return None
        return encode(replace(known, number=request.number))

    def look(self) -> None:
        """End this process if its job waits for too long; call it regularly.

        A job that was cancelled has less time and is not blamed: another process may
        have done it.
        """
        self.watch.measure()
        task, quiet_s = self.watch.task, self.watch.quiet_s
        if task is None or quiet_s is None:
            return
        if task.request in self._cancelled and quiet_s > _CANCELLED_S:
            self.slot.end_process(is_blamed=False)
        elif quiet_s > self.agent.wait_limit_s:
            self.slot.end_process(is_blamed=True)

    def _check(self, request: Request) -> None:
        """Raise unless this agent takes a request."""
        newest = max(self._epochs.pop(request.run, 0), request.epoch)
        _remember(request.run, newest, self._epochs)
        coordinator = (request.run, request.epoch)
        if request.epoch < newest and coordinator not in self._fenced:
            _remember(coordinator, None, self._fenced)
            raise RevolveError(
                f"{FENCED}epoch {request.epoch} of run {request.run} is over: "
                f"epoch {newest} has begun"
            )
        check_plugins(request.plugins, request.run)


def _repeatable(request: Request) -> Request:
    """Return the request of an advance without what changes if it is assigned again.

    That is its number, and whether the state comes with it.
    """
    work = request.work
    assert isinstance(work, AdvanceShard)
    if work.rebuild and work.rebuild.living is None:
        work = replace(work, rebuild=None)
    return replace(request, number=0, work=work)


def _remember(
    key: K, value: V, known: dict[K, V], most: int = _MOST_REMEMBERED
) -> None:
    """Add an entry to a limited number of them; the oldest is forgotten."""
    known.pop(key, None)
    known[key] = value
    if len(known) > most:
        del known[next(iter(known))]
