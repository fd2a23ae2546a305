"""Cost of dispatch, and the largest fleet that one coordinator can serve.

``python -m tests.benchmarks.dispatch_bench`` prints the figures of docs/scaling.md.

Evaluations that return at once measure dispatch and network alone. Births without
physics measure a birth's cost for the coordinator. Evaluations of fixed duration
measure the utilisation of workers. From the cost of a birth, larger fleets than this
machine can hold are simulated (``tests.benchmarks.fleet_model``).
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

import tests.analyzers
from coordinator.dispatch.events import AgentKind, Client, Job
from coordinator.dispatch.fleet import JobRouter
from coordinator.evolution.generation import generate
from coordinator.network.service import Network
from coordinator.run.session import RunSession
from coordinator.storage.folder import RunFolder
from schema.agent.network import Agent
from schema.agent.supervision import ProcessSlot
from schema.agent.supervisor import ProcessPool, prepare_process
from schema.agent.topics import unique_name
from schema.experiment.document import Experiment, body_space
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.settings import evaluation_settings
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.tables.arrow import skip_pandas
from schema.tables.description import RunDetails
from schema.wire.codec import encode
from schema.wire.messages import Evaluate, Request
from tests import null_workers
from tests.benchmarks.fleet_model import (
    LEAST_UTILISATION,
    FleetModel,
    Setting,
    most_workers,
)

Body = Callable[[Agent, ProcessSlot], None]
"""Function that a process of a pool runs."""

LEAST_NULL_PER_S = 2000
MOST_NULL_CPU_S = 0.4e-3
LEAST_WORKERS = 1000
"""Workers that one coordinator must keep busy with evaluations of 10 s."""

_say = partial(print, flush=True)
_CLIENT = Client("bench", 1)
_IN_FLIGHT = 64
_ROBOTS = 50
_TIMEOUT_S = 60.0
_SHORT_S, _LONG_S = 0.04, 10.0


@dataclass(frozen=True, slots=True)
class Rate:
    """Throughput and cost of a stream of jobs.

    Attributes:
        per_s: finished jobs [1/s].
        cpu_s: CPU time of this process per job, its network included [s].
    """

    per_s: float
    cpu_s: float


class Stream:
    """Endless stream of evaluations, a fixed number at a time.

    Attributes:
        done: number of finished evaluations.
    """

    def __init__(self, fleet: JobRouter, in_flight: int) -> None:
        """Request the first evaluations.

        Args:
            fleet: workers of the stream.
            in_flight: evaluations at a time.
        """
        experiment = read_experiment("scenario1")
        space = body_space(experiment.space)
        self.done = 0
        self._fleet = fleet
        self._settings = evaluation_settings(experiment)
        rngs = map(np.random.default_rng, range(_ROBOTS))
        robots = (develop(generate(rng, experiment), space) for rng in rngs)
        self._robots = list(robots)
        for _ in range(in_flight):
            self._ask()

    def _ask(self) -> None:
        number = self._fleet.new_number()
        robot = self._robots[number % _ROBOTS]
        run, epoch = _CLIENT
        work = Evaluate(BirthId(0, number), robot)
        payload = encode(Request(run, epoch, number, work, self._settings))
        self._fleet.request(Job(number, "evaluate", payload, client=_CLIENT))

    def listen(self, timeout_s: float, now_s: float) -> None:
        """Count the answers, and send a request for each.

        Raises:
            RuntimeError: the workers cannot do a job.
        """
        for end in self._fleet.listen(timeout_s, now_s).get(_CLIENT, ()):
            if end.reason:
                raise RuntimeError(end.reason)
            self.done += 1
            self._ask()


@contextmanager
def real_fleet(bodies: dict[AgentKind, tuple[Body, int]]) -> Iterator[JobRouter]:
    """Start a fleet of processes on this machine and wait until all have joined.

    Args:
        bodies: function and number of the processes of each kind.

    Raises:
        RuntimeError: a process does not join.
    """
    with ExitStack() as stack:
        network = stack.enter_context(Network(name=unique_name("bench")))
        fleet = JobRouter(network)
        for kind, (body, size) in bodies.items():
            agent = Agent(kind, kind, network.address)
            stack.enter_context(ProcessPool(body, (agent,), size=size))
        until_s = time.monotonic() + _TIMEOUT_S
        while any(
            fleet.dispatch.agents(kind) < size for kind, (_, size) in bodies.items()
        ):
            fleet.listen(0.1, time.monotonic())
            if time.monotonic() > until_s:
                raise RuntimeError("not all processes of the fleet have joined")
        yield fleet


def measure(stream: Stream, seconds: float) -> Rate:
    """Measure for some time, after a tenth of it to warm up.

    Args:
        stream: evaluations to count.
        seconds: duration of the measurement [s].
    """
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


def null_rate(seconds: float) -> Rate:
    """Measure null evaluations over the network."""
    with real_fleet({"worker": (null_workers.process, 1)}) as fleet:
        return measure(Stream(fleet, _IN_FLIGHT), seconds)


@contextmanager
def live_run(
    experiment: Experiment, body: Body, workers: int
) -> Iterator[tuple[RunSession, JobRouter]]:
    """Start a run on a fleet of its own, with journal and tables.

    Args:
        experiment: of the run.
        body: function of the workers' processes.
        workers: their number.
    """
    bodies: dict[AgentKind, tuple[Body, int]] = {
        "worker": (body, workers),
        "analyzer": (tests.analyzers.process, 1),
    }
    with tempfile.TemporaryDirectory() as folder, real_fleet(bodies) as fleet:
        details = RunDetails(experiment.name, 0, 1, experiment_text(experiment))
        run = RunSession(RunFolder(Path(folder) / "run", details), fleet)
        run.start()
        yield run, fleet
        run.close()


def measure_run(run: RunSession, fleet: JobRouter, is_done: Callable[[], bool]) -> Rate:
    """Measure the evaluations of a run until a condition holds."""
    count, wall_s, cpu_s = 0, time.perf_counter(), time.process_time()
    while not is_done():
        now_s = time.monotonic()
        ends = fleet.listen(0.1, now_s).get(run.loop.client, ())
        run.loop.act(now_s, ends)
        count += sum(end.job.kind == "evaluate" for end in ends)
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    return Rate(count / wall_s, cpu_s / max(1, count))


def birth_cost(births: int, parts: float = 12.0) -> Rate:
    """Measure whole births without physics, journal and tables included.

    Args:
        births: number of births.
        parts: mean number of parts of the founders.
    """
    shipped = read_experiment("scenario1")
    generation = msgspec.structs.replace(shipped.generation, parts_mean=parts)
    experiment = msgspec.structs.replace(shipped, births=births, generation=generation)
    with live_run(experiment, null_workers.process, 1) as (run, fleet):
        return measure_run(run, fleet, lambda: run.loop.is_finished)


def main(seconds: float, workers: int, births: int) -> None:
    """Measure and simulate; print the results.

    Args:
        seconds: duration of each measurement over the network [s].
        workers: number of workers that sleep 40 ms per evaluation.
        births: number of births without physics.
    """
    rate = null_rate(seconds)
    _say(
        f"null evaluations, real network, 1 worker: {rate.per_s:.0f}/s "
        f"(required: {LEAST_NULL_PER_S}), coordinator {1e3 * rate.cpu_s:.3f} ms CPU "
        f"each (required: {1e3 * MOST_NULL_CPU_S:.1f})"
    )
    with real_fleet({"worker": (null_workers.timed_process, workers)}) as fleet:
        slow = measure(Stream(fleet, 3 * workers), seconds)
    _say(
        f"evaluations of 40 ms, real network, {workers} workers: "
        f"{slow.per_s:.0f}/s, utilisation "
        f"{100 * slow.per_s * _SHORT_S / workers:.1f} %"
    )
    birth = birth_cost(births)
    _say(
        f"whole births without physics: {birth.per_s:.0f}/s, coordinator "
        f"{1e3 * birth.cpu_s:.2f} ms CPU per birth"
    )
    simulate(birth.cpu_s)


def simulate(coordinator_s: float) -> None:
    """Simulate fleets and print the results.

    Args:
        coordinator_s: the coordinator's CPU time per birth [s].
    """
    setting = Setting(LEAST_WORKERS, _LONG_S, coordinator_s, losses_per_s=0.1)
    outcome = FleetModel(setting).run()
    _say(
        f"simulated fleet, {LEAST_WORKERS} workers, evaluations of {_LONG_S:g} s, "
        f"{outcome.lost} workers lost and replaced: utilisation "
        f"{100 * outcome.utilisation:.1f} %, {outcome.births_per_s:.0f} births/s, "
        f"coordinator busy {100 * outcome.coordinator:.0f} % of the time, dispatch "
        f"{1e3 * outcome.dispatch_s:.3f} ms CPU per birth"
    )
    for evaluation_s in (_SHORT_S, _LONG_S):
        found = replace(setting, evaluation_s=evaluation_s, losses_per_s=0.0)
        reached, outcome = most_workers(found)
        _say(
            f"evaluations of {evaluation_s:g} s: up to {reached} workers at a "
            f"utilisation of {100 * LEAST_UTILISATION:.0f} %, "
            f"{outcome.births_per_s:.0f} births/s"
        )
    _say(f"required for {_LONG_S:g} s: {LEAST_WORKERS} workers")


if __name__ == "__main__":
    flags = argparse.ArgumentParser(description=__doc__)
    flags.add_argument("--seconds", type=float, default=5.0)
    flags.add_argument("--workers", type=int, default=8)
    flags.add_argument("--births", type=int, default=1500)
    prepare_process()  # before the first session is opened
    skip_pandas()  # as the command does
    main(**vars(flags.parse_args()))
