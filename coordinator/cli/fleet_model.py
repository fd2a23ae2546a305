"""Discrete-event simulation of a fleet of any size under the real ``Dispatch``.

Jobs are assigned by the same state machine as in runs. Workers, network and the
coordinator's processor are modelled: evaluation times are lognormally distributed,
workers leave and join, and the coordinator handles one answer after the other. Each
takes the measured time of a whole birth: vetting, mating, journal, tables, dispatch and
network.
Nothing else limits the model, so all lost utilisation is waiting for the coordinator.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import log

import numpy as np

from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.events import (
    Assign,
    Deliver,
    DispatchEvent,
    Job,
    Joined,
    Left,
    Requested,
    Returned,
    Ticked,
)

LEAST_UTILISATION = 0.95
_ROUNDS = 10
_LEAST = 5_000
_TICK_S = 0.2
_SEED = 1


@dataclass(frozen=True, slots=True)
class Setting:
    """Parameters of a simulation.

    Attributes:
        workers: number of workers at the start, and on average.
        evaluation_s: mean evaluation time [s].
        coordinator_s: CPU time of the coordinator per birth [s].
        credits: jobs that a worker holds at a time, the running one included; >= 2.
        spread: standard deviation of the logarithm of evaluation times.
        losses_per_s: rate at which a worker is lost and another joins [1/s].
        latency_s: one-way latency of the network [s].
    """

    workers: int
    evaluation_s: float
    coordinator_s: float
    credits: int = 3
    spread: float = 0.5
    losses_per_s: float = 0.0
    latency_s: float = 0.0003


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a simulation, measured in the second half of its time.

    Attributes:
        utilisation: share of the workers' time spent on evaluations whose answers
            were handled.
        births_per_s: delivered answers [1/s].
        coordinator: share of the time in which the coordinator was busy.
        dispatch_s: real CPU time of ``Dispatch`` per birth [s].
        lost: number of lost workers.
    """

    utilisation: float
    births_per_s: float
    coordinator: float
    dispatch_s: float
    lost: int


@dataclass(slots=True)
class _Totals:
    """Totals of the second half of the simulation."""

    used_s: float = 0.0
    present_s: float = 0.0
    handling_s: float = 0.0
    dispatch_s: float = 0.0
    births: int = 0


class FleetModel:
    """Simulated fleet."""

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._rng = np.random.default_rng(_SEED)
        self._dispatch = Dispatch()
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self._order, self._jobs, self._names = count(), count(1), count()
        # Jobs of each worker, the running one first.
        self._workers: dict[str, deque[int]] = {}
        self._lasts_s: dict[int, float] = {}
        self._lost = 0
        self._inbox: deque[Returned] = deque()
        self._now_s = 0.0
        self._totals = _Totals()

    def run(self) -> Outcome:
        """Simulate enough evaluations; return the result of the second half."""
        setting = self._setting
        # Time in which a slow coordinator, too, serves every worker once.
        round_s = max(setting.evaluation_s, setting.workers * setting.coordinator_s)
        end_s = max(_ROUNDS, _LEAST / setting.workers) * round_s
        for _ in range(setting.workers):
            self._join()
        for _ in range((setting.credits + 1) * setting.workers):
            self._request()
        self._at(0.0, self._tick)
        if setting.losses_per_s:
            self._at(self._rng.exponential(1 / setting.losses_per_s), self._lose)
        self._at(end_s / 2, self._reset_totals)
        self._at(end_s, lambda: None)
        while self._now_s < end_s:
            now_s, _, call = heappop(self._agenda)
            self._pass(now_s)
            call()
        totals, span_s = self._totals, end_s / 2
        return Outcome(
            utilisation=totals.used_s / totals.present_s,
            births_per_s=totals.births / span_s,
            coordinator=totals.handling_s / span_s,
            dispatch_s=totals.dispatch_s / max(1, totals.births),
            lost=self._lost,
        )

    def _at(self, when_s: float, call: Callable[[], None]) -> None:
        heappush(self._agenda, (when_s, next(self._order), call))

    def _pass(self, now_s: float) -> None:
        """Advance the time; add up workers' and coordinator's time."""
        passed_s, self._now_s = now_s - self._now_s, now_s
        self._totals.present_s += passed_s * len(self._workers)
        self._totals.handling_s += passed_s * bool(self._inbox)

    def _reset_totals(self) -> None:
        """Start counting: the fleet has reached its steady state."""
        self._totals = _Totals()

    def _handle_event(self, event: DispatchEvent) -> None:
        """Pass an event to ``Dispatch`` and carry out its commands."""
        began_s = time.thread_time()
        commands = self._dispatch.handle(event)
        self._totals.dispatch_s += time.thread_time() - began_s
        for command in commands:
            if isinstance(command, Assign):
                arrival_s = self._now_s + self._setting.latency_s
                name, number = command.agent, command.job.number
                self._at(arrival_s, partial(self._arrive, name, number))
            elif isinstance(command, Deliver):
                self._totals.births += 1
                self._totals.used_s += self._lasts_s.pop(command.job.number)
                self._request()

    def _request(self) -> None:
        number = next(self._jobs)
        self._handle_event(Requested(Job(number, "evaluate", b"")))

    def _tick(self) -> None:
        self._handle_event(Ticked(self._now_s))
        self._at(self._now_s + _TICK_S, self._tick)

    def _join(self) -> None:
        name = f"worker-{next(self._names):06}"
        self._workers[name] = deque()
        self._handle_event(Joined(name, "worker", self._setting.credits - 1, "model"))

    def _lose(self) -> None:
        """Remove a worker with all its jobs; another one joins."""
        names = list(self._workers)
        name = names[self._rng.integers(len(names))]
        del self._workers[name]
        self._lost += 1
        self._handle_event(Left(name))
        self._join()
        next_s = self._rng.exponential(1 / self._setting.losses_per_s)
        self._at(self._now_s + next_s, self._lose)

    def _arrive(self, name: str, number: int) -> None:
        """Give a worker a job; it starts at once if it has no other."""
        if name in self._workers:
            self._workers[name].append(number)
            if len(self._workers[name]) == 1:
                self._evaluate(name)

    def _evaluate(self, name: str) -> None:
        setting = self._setting
        # Makes the mean of the distribution equal to the setting.
        shift = log(setting.evaluation_s) - setting.spread**2 / 2
        lasts_s = self._rng.lognormal(shift, setting.spread)
        self._lasts_s[self._workers[name][0]] = lasts_s
        self._at(self._now_s + lasts_s, partial(self._complete, name))

    def _complete(self, name: str) -> None:
        """Send an answer and start the next job."""
        if name not in self._workers:
            return
        queue = self._workers[name]
        returned = Returned(queue.popleft(), name, "ok")
        arrival_s = self._now_s + self._setting.latency_s
        self._at(arrival_s, partial(self._take, returned))
        if queue:
            self._evaluate(name)

    def _take(self, returned: Returned) -> None:
        """Queue an answer for the coordinator."""
        self._inbox.append(returned)
        if len(self._inbox) == 1:
            self._at(self._now_s + self._setting.coordinator_s, self._handle)

    def _handle(self) -> None:
        """Finish handling an answer; start with the next."""
        self._handle_event(self._inbox.popleft())
        if self._inbox:
            self._at(self._now_s + self._setting.coordinator_s, self._handle)


def most_workers(setting: Setting) -> tuple[int, Outcome]:
    """Return how many workers a coordinator keeps busy, with an accuracy of 5 %.

    Args:
        setting: parameters of the fleet; ``workers`` is ignored.

    Returns:
        The largest number found with at least ``LEAST_UTILISATION``, and its result.
    """
    # A coordinator can assign at most one job per handled answer.
    high = max(2, int(1.1 * setting.evaluation_s / setting.coordinator_s))
    low, found = 1, FleetModel(replace(setting, workers=1)).run()
    while high - low > max(1, low // 20):
        middle = (low + high) // 2
        outcome = FleetModel(replace(setting, workers=middle)).run()
        if outcome.utilisation >= LEAST_UTILISATION:
            low, found = middle, outcome
        else:
            high = middle
    return low, found
