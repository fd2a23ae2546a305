"""A fleet of any size in simulated time, under the real ``Dispatch``.

The machine that gives out jobs is the one that runs use. Workers, network and the
coordinator's processor are a discrete-event model: evaluations last lognormally
distributed times, workers come and go, and the coordinator handles one answer after
the other, so long as it was measured to take for all of a birth: vetting, mating,
journal, tables, dispatch and network. Nothing else limits the model, so what it
loses is lost by waiting for the coordinator.
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


@dataclass(frozen=True, slots=True)
class Setting:
    """What is simulated.

    Attributes:
        workers: at the beginning, and on average.
        evaluation_s: mean time of an evaluation [s].
        coordinator_s: processor time of the coordinator per birth [s].
        credits: jobs that a worker has at a time, the one it is at included; >= 2.
        spread: standard deviation of a time's logarithm.
        losses_per_s: how often some worker is lost and another joins [1/s].
        latency_s: of the network, one way [s].
        seed: of times and losses.
    """

    workers: int
    evaluation_s: float
    coordinator_s: float
    credits: int = 3
    spread: float = 0.5
    losses_per_s: float = 0.0
    latency_s: float = 0.0003
    seed: int = 1


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a simulated fleet, in the second half of the time.

    Attributes:
        utilisation: share of the workers' time that went into evaluations whose
            answers were handled.
        births_per_s: answers that were delivered [1/s].
        coordinator: share of the time in which the coordinator was at work.
        dispatch_s: real processor time of ``Dispatch`` per birth [s].
        lost: workers that were lost.
    """

    utilisation: float
    births_per_s: float
    coordinator: float
    dispatch_s: float
    lost: int


@dataclass(slots=True)
class _Tally:
    """What was counted since the first half was over."""

    used_s: float = 0.0
    present_s: float = 0.0
    handling_s: float = 0.0
    dispatch_s: float = 0.0
    births: int = 0


class FleetModel:
    """A fleet on its way through simulated time."""

    def __init__(self, setting: Setting) -> None:
        """Have nobody there yet."""
        self._setting = setting
        self._rng = np.random.default_rng(setting.seed)
        self._dispatch = Dispatch()
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self._order, self._jobs, self._names = count(), count(1), count()
        # Jobs of each worker, the one that it is at first.
        self._workers: dict[str, deque[int]] = {}
        self._lasts_s: dict[int, float] = {}
        self._lost = 0
        self._inbox: deque[Returned] = deque()
        self._now_s = 0.0
        self._tally = _Tally()

    def run(self) -> Outcome:
        """Let the fleet do enough evaluations; tell of the second half of the time."""
        setting = self._setting
        # However slow the coordinator, every worker is served that often.
        round_s = max(setting.evaluation_s, setting.workers * setting.coordinator_s)
        end_s = max(_ROUNDS, _LEAST / setting.workers) * round_s
        for _ in range(setting.workers):
            self._join()
        for _ in range((setting.credits + 1) * setting.workers):
            self._request()
        self._at(0.0, self._tick)
        if setting.losses_per_s:
            self._at(self._rng.exponential(1 / setting.losses_per_s), self._lose)
        self._at(end_s / 2, self._forget)
        self._at(end_s, lambda: None)
        while self._now_s < end_s:
            now_s, _, happen = heappop(self._agenda)
            self._pass(now_s)
            happen()
        tally, span_s = self._tally, end_s / 2
        return Outcome(
            utilisation=tally.used_s / tally.present_s,
            births_per_s=tally.births / span_s,
            coordinator=tally.handling_s / span_s,
            dispatch_s=tally.dispatch_s / max(1, tally.births),
            lost=self._lost,
        )

    def _at(self, when_s: float, happen: Callable[[], None]) -> None:
        heappush(self._agenda, (when_s, next(self._order), happen))

    def _pass(self, now_s: float) -> None:
        """Let time pass, and count who was at work."""
        passed_s, self._now_s = now_s - self._now_s, now_s
        self._tally.present_s += passed_s * len(self._workers)
        self._tally.handling_s += passed_s * bool(self._inbox)

    def _forget(self) -> None:
        """Count from now on: the fleet has found its pace."""
        self._tally = _Tally()

    def _tell(self, event: DispatchEvent) -> None:
        """Tell the real machine, and do as it says."""
        began_s = time.thread_time()
        commands = self._dispatch.handle(event)
        self._tally.dispatch_s += time.thread_time() - began_s
        for command in commands:
            if isinstance(command, Assign):
                arrival_s = self._now_s + self._setting.latency_s
                name, number = command.agent, command.job.number
                self._at(arrival_s, partial(self._arrive, name, number))
            elif isinstance(command, Deliver):
                self._tally.births += 1
                self._tally.used_s += self._lasts_s.pop(command.job.number)
                self._request()

    def _request(self) -> None:
        number = next(self._jobs)
        job = Job(number, "evaluate", b"")
        self._tell(Requested(job))

    def _tick(self) -> None:
        self._tell(Ticked(self._now_s))
        self._at(self._now_s + _TICK_S, self._tick)

    def _join(self) -> None:
        name = f"worker-{next(self._names):06}"
        self._workers[name] = deque()
        self._tell(Joined(name, "worker", self._setting.credits - 1, "model"))

    def _lose(self) -> None:
        """Take a worker away with all that it has; another one joins."""
        names = list(self._workers)
        name = names[self._rng.integers(len(names))]
        del self._workers[name]
        self._lost += 1
        self._tell(Left(name))
        self._join()
        next_s = self._rng.exponential(1 / self._setting.losses_per_s)
        self._at(self._now_s + next_s, self._lose)

    def _arrive(self, name: str, number: int) -> None:
        """Have a worker take a job; it begins at once if it has no other."""
        if name in self._workers:
            self._workers[name].append(number)
            if len(self._workers[name]) == 1:
                self._evaluate(name)

    def _evaluate(self, name: str) -> None:
        setting = self._setting
        # So that the mean is the one that was set.
        shift = log(setting.evaluation_s) - setting.spread**2 / 2
        lasts_s = self._rng.lognormal(shift, setting.spread)
        self._lasts_s[self._workers[name][0]] = lasts_s
        self._at(self._now_s + lasts_s, partial(self._complete, name))

    def _complete(self, name: str) -> None:
        """Send an answer, and begin what waits."""
        if name not in self._workers:
            return
        queue = self._workers[name]
        returned = Returned(queue.popleft(), name, "ok")
        arrival_s = self._now_s + self._setting.latency_s
        self._at(arrival_s, partial(self._take, returned))
        if queue:
            self._evaluate(name)

    def _take(self, returned: Returned) -> None:
        """Have the coordinator handle an answer, after those before it."""
        self._inbox.append(returned)
        if len(self._inbox) == 1:
            self._at(self._now_s + self._setting.coordinator_s, self._handle)

    def _handle(self) -> None:
        """End the handling of an answer; begin that of the next."""
        self._tell(self._inbox.popleft())
        if self._inbox:
            self._at(self._now_s + self._setting.coordinator_s, self._handle)


def most_workers(
    setting: Setting, least: float = LEAST_UTILISATION
) -> tuple[int, Outcome]:
    """Return how many workers a coordinator keeps busy, to a twentieth.

    Args:
        setting: of the fleet; ``workers`` is not looked at.
        least: utilisation that must be kept.

    Returns:
        The greatest number found at which it is kept, and what became of that fleet.
    """
    # A coordinator can give out no more than one job per handling.
    high = max(2, int(1.1 * setting.evaluation_s / setting.coordinator_s))
    low, found = 1, FleetModel(replace(setting, workers=1)).run()
    while high - low > max(1, low // 20):
        middle = (low + high) // 2
        outcome = FleetModel(replace(setting, workers=middle)).run()
        if outcome.utilisation >= least:
            low, found = middle, outcome
        else:
            high = middle
    return low, found
