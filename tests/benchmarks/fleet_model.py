"""Discrete-event simulation of a fleet of any size under the real ``Dispatch``.

Jobs are assigned by the same state machine as in runs. Workers, network and the
coordinator's processor are modelled: evaluation times are lognormally distributed,
workers leave and join, and the coordinator handles one answer after the other. Each
takes the measured time of a whole birth: vetting, mating, journal, tables, dispatch and
network. A worker, too, does its jobs one after the other, in the order of assignment.
Nothing else limits the model, so all lost utilisation is waiting for the coordinator.
"""

import sched
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
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

    births: int = 0
    handled: int = 0
    used_s: float = 0.0
    dispatch_s: float = 0.0


class FleetModel:
    """Simulated fleet."""

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._rng = np.random.default_rng(_SEED)
        self._dispatch = Dispatch()
        # Time in which a slow coordinator, too, serves every worker once.
        round_s = max(setting.evaluation_s, setting.workers * setting.coordinator_s)
        self._end_s = max(_ROUNDS, _LEAST / setting.workers) * round_s
        self._now_s = 0.0
        self._agenda = sched.scheduler(lambda: self._now_s, self._pass)
        self._jobs, self._names = count(1), count()
        self._lasts_s: dict[int, float] = {}
        # Times at which the workers and the coordinator are done with all their work.
        self._workers_end_s: dict[str, float] = {}
        self._coordinator_end_s = 0.0
        self._lost = 0
        self._totals = _Totals()

    def run(self) -> Outcome:
        """Simulate enough evaluations; return the result of the second half."""
        setting, span_s = self._setting, self._end_s / 2
        for _ in range(setting.workers):
            self._join()
        for _ in range((setting.credits + 1) * setting.workers):
            self._request()
        self._tick()
        if setting.losses_per_s:
            self._plan_loss()
        self._at(span_s, self._reset_totals)
        self._agenda.run()
        totals = self._totals
        return Outcome(
            utilisation=totals.used_s / (setting.workers * span_s),
            births_per_s=totals.births / span_s,
            coordinator=totals.handled * setting.coordinator_s / span_s,
            dispatch_s=totals.dispatch_s / max(1, totals.births),
            lost=self._lost,
        )

    def _pass(self, seconds: float) -> None:
        self._now_s += seconds

    def _at(self, when_s: float, call: Callable[..., None], *arguments: object) -> None:
        """Plan a call, unless it is after the end."""
        if when_s <= self._end_s:
            self._agenda.enterabs(when_s, 0, call, arguments)

    def _reset_totals(self) -> None:
        """Start counting: the fleet has reached its steady state."""
        self._totals = _Totals()

    def _tell(self, event: DispatchEvent) -> None:
        """Pass an event to ``Dispatch`` and carry out its commands."""
        began_s = time.thread_time()
        commands = self._dispatch.handle(event)
        self._totals.dispatch_s += time.thread_time() - began_s
        self._totals.handled += isinstance(event, Returned)
        for command in commands:
            if isinstance(command, Assign):
                self._evaluate(command.agent, command.job.number)
            elif isinstance(command, Deliver):
                self._totals.births += 1
                self._totals.used_s += self._lasts_s.pop(command.job.number)
                self._request()

    def _request(self) -> None:
        self._tell(Requested(Job(next(self._jobs), "evaluate", b"")))

    def _tick(self) -> None:
        self._tell(Ticked(self._now_s))
        self._at(self._now_s + _TICK_S, self._tick)

    def _join(self) -> None:
        name = f"worker-{next(self._names):06}"
        self._workers_end_s[name] = self._now_s
        self._tell(Joined(name, "worker", self._setting.credits - 1, "model"))

    def _plan_loss(self) -> None:
        wait_s = self._rng.exponential(1 / self._setting.losses_per_s)
        self._at(self._now_s + wait_s, self._lose)

    def _lose(self) -> None:
        """Remove a worker with all its jobs; another one joins."""
        name = self._rng.choice(list(self._workers_end_s))
        del self._workers_end_s[name]
        self._lost += 1
        self._tell(Left(name))
        self._join()
        self._plan_loss()

    def _evaluate(self, name: str, number: int) -> None:
        """Have a worker do a job after its others; the answer arrives later."""
        setting = self._setting
        lasts_s = drawn_s(self._rng, setting.evaluation_s, setting.spread)
        arrival_s = self._now_s + setting.latency_s
        end_s = max(arrival_s, self._workers_end_s[name]) + lasts_s
        self._lasts_s[number], self._workers_end_s[name] = lasts_s, end_s
        returned = Returned(number, name, "ok")
        self._at(end_s + setting.latency_s, self._take, returned)

    def _take(self, returned: Returned) -> None:
        """Queue an answer for the coordinator, unless its worker is lost."""
        if returned.agent in self._workers_end_s:
            begin_s = max(self._now_s, self._coordinator_end_s)
            self._coordinator_end_s = begin_s + self._setting.coordinator_s
            self._at(self._coordinator_end_s, self._tell, returned)


def drawn_s(rng: np.random.Generator, mean_s: float, spread: float) -> float:
    """Return a lognormally distributed duration [s] with a given mean."""
    return float(rng.lognormal(log(mean_s) - spread**2 / 2, spread))


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
