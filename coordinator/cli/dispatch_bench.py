"""``revolve bench dispatch``: what giving out jobs costs, and how far it reaches.

Null evaluations through the real network tell what dispatch and network cost alone;
whole births without physics tell what a birth costs the coordinator; timed
evaluations tell how busy real workers are kept. With the cost of a birth, fleets
that no machine here can hold are simulated (``coordinator.cli.fleet_model``).
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from coordinator.cli.fleet_model import (
    LEAST_UTILISATION,
    FleetModel,
    Setting,
    most_workers,
)
from coordinator.dispatch.events import AgentKind, Client, Deliver, Job
from coordinator.dispatch.fleet import Fleet
from coordinator.evolution.generation import generate
from coordinator.network.service import Network
from coordinator.run.session import RunSession
from coordinator.storage.folder import RunDetails, RunFolder
from schema.agent.network import Agent
from schema.agent.supervision import ProcessSlot
from schema.agent.supervisor import ProcessPool
from schema.agent.topics import unique_name
from schema.experiment.document import body_space
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.settings import evaluation_settings
from schema.robot.genome import develop
from schema.wire.codec import encode_request, encode_robot

Body = Callable[[Agent, ProcessSlot], None]
"""What a process of a crew does."""

LEAST_NULL_PER_S = 2000
MOST_NULL_CPU_S = 0.4e-3
LEAST_WORKERS = 1000
"""That one coordinator must keep busy with evaluations of 10 s."""

_CLIENT = Client("bench", 1)
_IN_FLIGHT = 64
_ROBOTS = 50
_PATIENCE_S = 60.0
_SHORT_S, _LONG_S = 0.04, 10.0


@dataclass(frozen=True, slots=True)
class Rate:
    """What a stream of jobs cost.

    Attributes:
        per_s: jobs that were done [1/s].
        cpu_s: processor time of this process for each, its network's included [s].
    """

    per_s: float
    cpu_s: float


class Stream:
    """Asks for the same evaluations for ever, so many at a time."""

    def __init__(self, fleet: Fleet, in_flight: int) -> None:
        """Begin to ask."""
        self.done = 0
        self._fleet = fleet
        self._payloads = _robots()
        for _ in range(in_flight):
            self._ask()

    def _ask(self) -> None:
        number = self._fleet.new_number()
        robot = self._payloads[number % len(self._payloads)]
        run, epoch = _CLIENT
        payload = encode_request(
            run=run, epoch=epoch, number=number, settings=_SETTINGS, robot=robot
        )
        self._fleet.request(Job(number, "evaluate", payload, client=_CLIENT))

    def listen(self, timeout_s: float, now_s: float) -> None:
        """Count the answers, and send a request for each.

        Raises:
            RuntimeError: the workers cannot do a job.
        """
        for end in self._fleet.listen(timeout_s, now_s).get(_CLIENT, ()):
            if isinstance(end, Deliver) and end.reason:
                raise RuntimeError(end.reason)
            self.done += 1
            self._ask()


_SETTINGS = evaluation_settings(read_experiment("scenario1"))


def _robots() -> list[bytes]:
    """Return some random robots, encoded."""
    experiment = read_experiment("scenario1")
    space = body_space(experiment.space)
    return [
        encode_robot(develop(generate(np.random.default_rng(seed), experiment), space))
        for seed in range(_ROBOTS)
    ]


@contextmanager
def real_fleet(bodies: dict[AgentKind, tuple[Body, int]]) -> Iterator[Fleet]:
    """Give a fleet of processes on this machine, all of them there.

    Args:
        bodies: what the processes of each kind do, and how many there are.
    """
    with Network(name=unique_name("bench")) as network:
        fleet = Fleet(network)
        process_pools = []
        try:
            for kind, (body, size) in bodies.items():
                agent = Agent(kind, kind, network.address)
                process_pools.append(ProcessPool(body, (agent,), size=size))
                process_pools[-1].look_after()
            until_s = time.monotonic() + _PATIENCE_S
            while any(
                fleet.dispatch.agents(kind) < size for kind, (_, size) in bodies.items()
            ):
                fleet.listen(0.1, time.monotonic())
                if time.monotonic() > until_s:
                    raise RuntimeError("not all processes of the fleet came up")
            yield fleet
        finally:
            for process_pool in process_pools:
                process_pool.end()


def measure(stream: Stream, seconds: float) -> Rate:
    """Return what is done in some time, after a tenth of it to get going."""
    for share in (0.1, 1.0):
        before, wall_s, cpu_s = stream.done, time.perf_counter(), time.process_time()
        end_s = time.monotonic() + share * seconds
        while (now_s := time.monotonic()) < end_s:
            stream.listen(0.1, now_s)
        count = max(1, stream.done - before)
        rate = Rate(
            count / (time.perf_counter() - wall_s),
            (time.process_time() - cpu_s) / count,
        )
    return rate


def null_rate(body: Body, workers: int, seconds: float) -> Rate:
    """Return how fast evaluations that do nothing go through the network."""
    with real_fleet({"worker": (body, workers)}) as fleet:
        return measure(Stream(fleet, _IN_FLIGHT), seconds)


def birth_cost(null: Body, analyzer: Body, births: int) -> Rate:
    """Return what whole births cost without physics: journal and tables are on."""
    shipped = read_experiment("scenario1")
    experiment = msgspec.structs.replace(shipped, births=births)
    with (
        tempfile.TemporaryDirectory() as folder,
        real_fleet({"worker": (null, 1), "analyzer": (analyzer, 1)}) as fleet,
    ):
        details = RunDetails(experiment.name, 0, 1, experiment_text(experiment))
        run = RunSession(RunFolder(Path(folder) / "run", details), fleet)
        run.start()
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        while not run.loop.is_finished:
            now_s = time.monotonic()
            ends = fleet.listen(0.1, now_s)
            run.loop.act(now_s, ends.get(run.loop.client, ()))
        wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
        run.close()
    return Rate(births / wall_s, cpu_s / births)


def run(options: argparse.Namespace, null: Body, timed: Body, analyzer: Body) -> int:
    """Measure, simulate, and tell.

    Args:
        options: of the command line.
        null: a worker that answers at once.
        timed: one that takes 40 ms and does nothing with them.
        analyzer: that of real runs.

    Returns:
        0 if all figures are as promised, 1 if not.
    """
    seconds = options.seconds
    rate = null_rate(null, 1, seconds)
    _say(
        f"null evaluations, real network, 1 worker: {rate.per_s:.0f}/s "
        f"(promised: {LEAST_NULL_PER_S}), coordinator {1e3 * rate.cpu_s:.3f} ms CPU "
        f"each (promised: {1e3 * MOST_NULL_CPU_S:.1f})"
    )
    is_kept = rate.per_s >= LEAST_NULL_PER_S and rate.cpu_s <= MOST_NULL_CPU_S
    with real_fleet({"worker": (timed, options.workers)}) as fleet:
        slow = measure(Stream(fleet, 3 * options.workers), seconds)
    _say(
        f"evaluations of 40 ms, real network, {options.workers} workers: "
        f"{slow.per_s:.0f}/s, the workers are busy "
        f"{100 * slow.per_s * _SHORT_S / options.workers:.1f} % of the time"
    )
    birth = birth_cost(null, analyzer, options.births)
    _say(
        f"whole births without physics: {birth.per_s:.0f}/s, coordinator "
        f"{1e3 * birth.cpu_s:.2f} ms CPU per birth"
    )
    return 0 if simulate(birth.cpu_s) and is_kept else 1


def simulate(coordinator_s: float) -> bool:
    """Simulate fleets, and tell; return whether they reach as far as promised.

    Args:
        coordinator_s: what a birth costs the coordinator [s].
    """
    setting = Setting(LEAST_WORKERS, _LONG_S, coordinator_s, losses_per_s=0.1)
    outcome = FleetModel(setting).run()
    _say(
        f"simulated fleet, {LEAST_WORKERS} workers, evaluations of {_LONG_S:g} s, "
        f"{outcome.lost} workers lost and replaced: busy "
        f"{100 * outcome.utilisation:.1f} %, {outcome.births_per_s:.0f} births/s, "
        f"coordinator at work {100 * outcome.coordinator:.0f} % of the time, dispatch "
        f"{1e3 * outcome.dispatch_s:.3f} ms CPU per birth"
    )
    reached = 0
    for evaluation_s in (_SHORT_S, _LONG_S):
        found = replace(setting, evaluation_s=evaluation_s, losses_per_s=0.0)
        reached, outcome = most_workers(found)
        _say(
            f"evaluations of {evaluation_s:g} s: {100 * LEAST_UTILISATION:.0f} % is "
            f"lost beyond {reached} workers, at {outcome.births_per_s:.0f} births/s"
        )
    _say(f"promised for {_LONG_S:g} s: {LEAST_WORKERS} workers")
    return reached >= LEAST_WORKERS


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
