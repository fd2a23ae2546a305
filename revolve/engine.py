"""The thread that sends the jobs of a fleet and receives their answers.

It owns the network and the state machines of ``coordinator.dispatch``, as the main loop
of a run does. Other threads pass orders by a queue and get futures.
"""

import os
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from coordinator.dispatch.events import Client, Deliver, Job, JobKind, Withdrawn
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.service import Network
from schema.agent.log import tell_user, warn_user
from schema.agent.topics import unique_name
from schema.errors import NetworkError, RevolveError, counted, error_text
from schema.experiment.identity import NO_ORIGIN, Origin
from schema.plugins.source import plugins_of
from schema.wire.codec import encode
from schema.wire.messages import Request, Work

_WAIT_S = 0.2
_CHORES_S = 1.0
_ALONE_S = 10.0
"""Time without any worker after which the user is told [s]."""
_EPOCH = 1
_CLOSED = RevolveError("the fleet is closed")


@dataclass(frozen=True, slots=True, eq=False)
class WantedJob:
    """A job that is wanted.

    Attributes:
        settings: JSON of the settings of the work.
        read: decodes and checks an answer, given ``expected``, epoch and number.
        settle: returns the future's value for the end of the job, or raises.
        simulated_s: as of ``Job``.
        origin: as of ``Request``.
    """

    kind: JobKind
    work: Work
    settings: bytes
    read: Callable[..., object]
    settle: Callable[[Deliver], Any]
    simulated_s: float | None = None
    origin: Origin = NO_ORIGIN
    future: "Future[Any]" = field(default_factory=Future)


class Engine:
    """Thread with a connection to agents; ``close`` ends it."""

    def __init__(
        self, network: Network, find_fault: Callable[[], str], give_up_after_s: float
    ) -> None:
        """Open the network and start the thread.

        ``find_fault`` returns why no worker can do a job any more, or "". Jobs wait for
        ``give_up_after_s`` without a fit worker.

        Raises:
            NetworkError: there is no hub, or none can be opened.
        """
        self._network = network
        self._find_fault = find_fault
        self._give_up_after_s = give_up_after_s
        self._orders: SimpleQueue[WantedJob] = SimpleQueue()
        self._client = Client(
            unique_name(f"python-{socket.gethostname()[:40]}"), _EPOCH
        )
        self._open: dict[int, WantedJob] = {}
        self._fleet: JobRouter | None = None
        self._fault: RevolveError | None = None
        self._is_closing = False
        self._lock = threading.Lock()
        self._is_open = threading.Event()
        self._owner = os.getpid()
        self._thread = threading.Thread(
            target=self._run, name="revolve.Fleet", daemon=True
        )
        self._thread.start()
        self._is_open.wait()
        if self._fault is not None:
            raise self._fault

    @property
    def workers(self) -> int:
        """Number of workers that have joined and can do the jobs."""
        if self._fleet is None:
            return 0
        return len(self._fleet.dispatch.fit("worker", self._client))

    def check(self) -> None:
        """Raise if there can be no more jobs.

        Raises:
            RevolveError: the fleet is closed, or cannot do jobs any more.
        """
        if self._fault is not None:
            raise type(self._fault)(*self._fault.args)

    def refuse(self) -> None:
        """Refuse further orders."""
        with self._lock:
            self._fault = self._fault or _CLOSED

    def order(self, order: WantedJob) -> None:
        """Order a job; its future gets the outcome. Errors are those of ``check``."""
        with self._lock:
            self.check()
            self._orders.put(order)
        self._network.wake()

    def close(self) -> None:
        """Drop all jobs, close the network and end the thread."""
        self._is_closing = True
        if self._owner == os.getpid():
            self._network.wake()
            self._thread.join()

    def _run(self) -> None:
        why = _CLOSED
        try:
            with self._network:
                self._fleet = fleet = JobRouter(
                    self._network, warn=warn_user, faults=self._network.faults
                )
                self._is_open.set()
                self._serve(fleet)
                fleet.leave(self._client)
        except RevolveError as error:
            why = error
        except Exception as error:  # noqa: BLE001 - else callers would wait for ever
            why = RevolveError(error_text(error))
        finally:
            self._end(why)
            self._is_open.set()

    def _end(self, why: RevolveError) -> None:
        """Refuse further orders and settle the open ones."""
        with self._lock:
            self._fault = self._fault or why
        waiting = [*self._open.values(), *_all_of(self._orders)]
        for order in waiting:
            if self._is_closing:
                order.future.cancel()
            elif order.future.set_running_or_notify_cancel():
                order.future.set_exception(why)
        self._open.clear()

    def _serve(self, fleet: JobRouter) -> None:
        alone_s = done_s = time.monotonic()
        is_told = False
        while not self._is_closing:
            for order in _all_of(self._orders):
                self._request(fleet, order)
            ends = fleet.listen(_WAIT_S, time.monotonic())
            for end in ends.get(self._client, ()):
                assert isinstance(end, Deliver)
                self._settle(end)
            now_s = time.monotonic()
            if now_s - done_s < _CHORES_S:
                continue
            done_s = now_s
            self._do_chores(fleet)
            if not self._open or self.workers:
                alone_s, is_told = now_s, False
            elif now_s - alone_s >= self._give_up_after_s:
                after = f"gave up after {self._give_up_after_s:g} s"
                raise NetworkError(f"{after}: {self._lack(fleet)}")
            elif now_s - alone_s >= _ALONE_S and not is_told:
                is_told = True
                tell_user(self._lack(fleet))

    def _lack(self, fleet: JobRouter) -> str:
        """Return why no worker can do the jobs."""
        refused = {**self._network.refused, **fleet.dispatch.unfit()}
        place = self._network.address
        if not refused:
            return f"no worker is connected at {place}"
        agent, why = [*refused.items()][-1]
        joined = f"{counted(len(refused), 'agent')} joined at {place}"
        return f"{joined} and cannot do the jobs, the last of them {agent}: {why}"

    def _do_chores(self, fleet: JobRouter) -> None:
        """Drop the jobs of cancelled futures; tell what is wrong with agents."""
        for number, order in list(self._open.items()):
            if order.future.cancelled():
                del self._open[number]
                fleet.tell(Withdrawn(number))
        for fenced in fleet.fenced():
            fleet.faults.note("fenced", fenced.agent, fenced.reason)
        for line in fleet.faults.lines():
            warn_user(line)
        if fault := self._find_fault():
            raise NetworkError(fault)

    def _request(self, fleet: JobRouter, order: WantedJob) -> None:
        if order.future.cancelled():
            return
        number = fleet.new_number()
        run, epoch = self._client
        settings = order.settings
        request = Request(
            run, epoch, number, order.work, settings, plugins_of(settings), order.origin
        )
        self._open[number] = order
        read = partial(order.read, expected=(_EPOCH, number))
        about = (self._client, order, read, order.simulated_s)
        fleet.request(Job(number, order.kind, encode(request), -1, *about))

    def _settle(self, end: Deliver) -> None:
        order = self._open.pop(end.job.number, None)
        if order is None or not order.future.set_running_or_notify_cancel():
            return
        try:
            value = order.settle(end)
        except Exception as error:  # noqa: BLE001 - the caller gets it
            order.future.set_exception(error)
        else:
            order.future.set_result(value)


def _all_of(queue: "SimpleQueue[Any]") -> list[Any]:
    entries = []
    with suppress(Empty):
        while True:
            entries.append(queue.get_nowait())
    return entries
