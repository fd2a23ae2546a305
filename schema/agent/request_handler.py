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

from schema.agent.network import CANCELLED, FENCED, UNFIT, Agent
from schema.agent.supervision import JobWatch, ProcessSlot, Task, thread_clock
from schema.errors import (
    MalformedMessage,
    PluginDiffers,
    RevolveError,
    UnknownPlugin,
    error_text,
)
from schema.limits import (
    ADVANCE_REQUEST_BYTES,
    LONGEST_REASON,
    MOST_EPOCH,
    MOST_RUN_NAME,
    printable,
)
from schema.plugins.source import check_plugins
from schema.wire import revolve_pb2 as pb
from schema.wire.decoding import fingerprint, parsed, require_most

_MOST_REMEMBERED = 1000
LONG_S = 60.0
"""Answers to jobs that took as long are kept: their requests may come again [s].

Arenas keep the answer to their last advance by themselves, however short it was.
"""
_MOST_LONG = 32
_CANCELLED_S = 10.0
"""Time after which a cancelled job that waits loses its process [s]."""

K = TypeVar("K")
V = TypeVar("V")


@dataclass(slots=True)
class ReplyCounts:
    """Counts of an agent's replies.

    Attributes:
        answered: jobs with an answer.
        refused: jobs with a reason, malformed requests included.
        malformed: requests that do not decode.
        skipped: cancelled jobs.
        cancels: cancellations that do not decode.
        crowd: requests that were dropped because too many waited.
    """

    answered: int = 0
    refused: int = 0
    malformed: int = 0
    skipped: int = 0
    cancels: int = 0
    crowd: int = 0


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer, or the reason for the lack of one."""

    answer: bytes = b""
    reason: str = ""


@dataclass(slots=True)
class Server:
    """Answers single requests; knows the newest coordinator of each run.

    The thread that makes it does the jobs.

    Attributes:
        compute: bytes of a ``Request`` to bytes of an ``Answer``; it raises if the
            request is bad.
        agent: this agent.
        slot: its slot in a pool.
        counts: counts of its replies.
        watch: over the current job.
    """

    compute: Callable[[bytes], bytes]
    agent: Agent
    slot: ProcessSlot = field(default_factory=ProcessSlot)
    counts: ReplyCounts = field(default_factory=ReplyCounts)
    watch: JobWatch = field(
        default_factory=lambda: JobWatch(thread_clock(threading.get_ident()))
    )
    _epochs: dict[str, int] = field(default_factory=dict)
    _fenced: dict[tuple[str, int], None] = field(default_factory=dict)
    _cancelled: dict[Task, None] = field(default_factory=dict)
    _skipped: dict[Task, None] = field(default_factory=dict)
    _answers: dict[Task, bytes] = field(default_factory=dict)

    @property
    def info(self) -> bytes:
        """Bytes of the ``AgentInfo`` of this agent."""
        agent = self.agent
        info = pb.AgentInfo(
            agent=agent.name,
            kind=agent.role,
            slots=agent.slots,
            platform=agent.platform,
            version=agent.version,
            shards=agent.shards,
            cores=agent.threads,
            quiet_s=self.watch.quiet_s,
        )
        for death in self.slot.deaths:
            task = death.task
            info.deaths.add(
                agent=task.agent,
                run=task.run,
                epoch=task.epoch,
                number=task.number,
                cause=death.cause,
                request=task.request,
            )
        return info.SerializeToString()

    def cancel(self, data: bytes) -> None:
        """Note that a job is cancelled; may be called from any thread.

        Args:
            data: bytes of the job's ``Request``.
        """
        try:
            task = self._task(_parsed(data), data)
        except MalformedMessage:
            self.counts.cancels += 1
            return
        _remember(task, None, self._cancelled)

    def reply(self, data: bytes) -> Reply:
        """Return the reply to any bytes."""
        try:
            request = self._checked(data)
            task = self._task(request, data)
            if task in self._answers:
                return Reply(self._answers[task])
            # A job that comes again is wanted, whatever cancelled it before.
            if task in self._cancelled and task not in self._skipped:
                _remember(task, None, self._skipped)
                self.counts.skipped += 1
                return Reply(reason=CANCELLED)
            began_s = time.monotonic()
            self.watch.begin(task)
            with self.slot.doing(task, self.agent.cpu_limit_s):
                answer = self.compute(data)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.counts.refused += 1
            self.counts.malformed += isinstance(error, MalformedMessage)
            is_ours = isinstance(error, RevolveError)
            reason = str(error) if is_ours else error_text(error)
            if isinstance(error, UnknownPlugin | PluginDiffers):
                reason = f"{UNFIT}{reason}"
            return Reply(reason=printable(reason, LONGEST_REASON))
        finally:
            self.watch.end()
        self.counts.answered += 1
        if time.monotonic() - began_s >= LONG_S:
            _remember(task, answer, self._answers, _MOST_LONG)
        return Reply(answer)

    def look(self) -> None:
        """End this process if its job waits for too long; call it regularly.

        A job that was cancelled has less time and is not blamed: another process may
        have done it.
        """
        self.watch.measure()
        task, quiet_s = self.watch.task, self.watch.quiet_s
        if task is None or quiet_s is None:
            return
        if task in self._cancelled and quiet_s > _CANCELLED_S:
            self.slot.end_process(is_blamed=False)
        elif quiet_s > self.agent.wait_limit_s:
            self.slot.end_process(is_blamed=True)

    def _task(self, request: pb.Request, data: bytes) -> Task:
        name = (request.run, request.epoch, request.number)
        return Task(self.agent.name, *name, fingerprint(data))

    def _checked(self, data: bytes) -> pb.Request:
        """Return the fields that requests of all kinds share.

        Raises:
            MalformedMessage: see ``_parsed``.
            PluginDiffers: a plug-in that is missing or has another source here.
            RevolveError: an older epoch than the newest one of its run.
        """
        request = _parsed(data)
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
        return request


def _parsed(data: bytes) -> pb.Request:
    """Return the fields that requests of all kinds share.

    Raises:
        MalformedMessage: not the bytes of a request, no run, or a run's name or an
            epoch beyond its limit.
    """
    request = parsed(data, pb.Request(), ADVANCE_REQUEST_BYTES)
    if not request.run:
        raise MalformedMessage("Request: names no run")
    require_most(len(request.run), MOST_RUN_NAME, "characters of Request.run")
    require_most(request.epoch, MOST_EPOCH, "as Request.epoch")
    return request


def _remember(
    key: K, value: V, known: dict[K, V], most: int = _MOST_REMEMBERED
) -> None:
    """Add an entry to a limited number of them; the oldest is forgotten."""
    known[key] = value
    if len(known) > most:
        del known[next(iter(known))]
