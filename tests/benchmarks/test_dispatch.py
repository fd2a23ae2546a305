"""Benchmarks of worker utilisation and of the cost of dispatch and network.

Utilisation is measured for two workers in a campaign of eight runs of 15+1, including
vetting, journal and tables, between 10 % and 90 % of all births. It is the total
evaluation time that the workers report, divided by twice the elapsed time. It excludes
the load of the coordinator: a worker counts as busy while it has a job, even if its
core executes the coordinator or the analyzer; it counts as idle while it waits for a
job.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import tests.analyzers
import worker.serve.service
from coordinator.dispatch.events import DispatchEvent, Joined, Left, Returned
from coordinator.dispatch.pool import AHEAD_S
from coordinator.network.service import Network
from coordinator.run.scheduler import RunScheduler
from coordinator.storage.campaign import Campaign
from schema.agent.network import Agent
from schema.agent.supervisor import ProcessPool, prepare_process
from schema.agent.topics import unique_name
from schema.experiment.file import read_experiment
from schema.limits import ANSWER_BYTES
from schema.tables.arrow import skip_pandas
from schema.wire.codec import decode
from schema.wire.messages import Answer
from tests.benchmarks.dispatch_bench import (
    LEAST_NULL_PER_S,
    LEAST_WORKERS,
    MOST_NULL_CPU_S,
    Rate,
    birth_cost,
    live_run,
    measure_run,
    null_rate,
)
from tests.benchmarks.fleet_model import Setting, most_workers
from tests.coordinator.run.test_scheduler import plan, scheduler_of

# As the command does, before the first session is opened.
prepare_process()
skip_pandas()

pytestmark = pytest.mark.benchmark

UTILISATION = 0.95
RUNS = 8
BIRTHS = 60
CPU_PER_BIRTH_S = 1.5e-3
SECOND_WORKER = 1.85
TURNS = 10
TURN_S = 2.0
JOINING_S = 0.3
LEAVING_S = AHEAD_S + 0.2  # time to finish the jobs that a leaving worker has


class TimedNetwork:
    """Network that adds up the evaluation time of the workers."""

    def __init__(self, network: Network) -> None:
        self.busy_s = 0.0
        self.send = network.send
        self.cancel, self.ask = network.cancel, network.ask
        self._network = network

    def receive(
        self, timeout_s: float, pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        events = self._network.receive(timeout_s, pause_s)
        for event in events:
            if isinstance(event, Returned) and event.agent.startswith("worker"):
                self.busy_s += decode(Answer, event.answer, ANSWER_BYTES).wall_s
        return events


@contextmanager
def campaign(folder: Path) -> Iterator[tuple[RunScheduler, TimedNetwork]]:
    """Yield the scheduler of a new campaign and its network."""
    experiment = replace(read_experiment("scenario2"), births=BIRTHS)
    planned = plan(folder, Campaign((experiment,), RUNS, 1))
    with ExitStack() as stack:
        network = stack.enter_context(Network(name=unique_name("bench")))
        vetting = Agent("analyzer", "analyzer", network.address)
        stack.enter_context(ProcessPool(tests.analyzers.process, (vetting,), size=1))
        evaluation = Agent("worker", "worker", network.address)
        stack.enter_context(
            ProcessPool(worker.serve.service.process, (evaluation,), size=2)
        )
        timed = TimedNetwork(network)
        scheduler = scheduler_of(
            planned, timed, lambda _status, error: pytest.fail(str(error))
        )
        stack.callback(scheduler.close)
        yield scheduler, timed


def test_utilisation_of_two_workers_of_a_campaign(tmp_path: Path) -> None:
    marks: list[tuple[float, float, float]] = []
    with campaign(tmp_path) as (scheduler, timed):
        while len(marks) < 2:
            scheduler.turn(0.2, time.monotonic)
            born = scheduler.status(time.monotonic()).births
            if born >= (0.1, 0.9)[len(marks)] * RUNS * BIRTHS:
                now_s = time.monotonic()
                marks.append((now_s, timed.busy_s, time.process_time()))
    wall_s, busy_s, own_s = (end - begin for begin, end in zip(*marks, strict=True))
    share = busy_s / (2 * wall_s)
    print(
        f"\ntwo workers busy for {busy_s:.1f} s in {wall_s:.1f} s: utilisation "
        f"{share:.3f}; coordinator {own_s:.1f} s CPU"
    )
    assert share >= UTILISATION


def test_rate_and_cpu_time_of_null_evaluations() -> None:
    best = max((null_rate(3.0) for _ in range(3)), key=lambda rate: rate.per_s)
    print(f"\n{best.per_s:.0f} null evaluations/s, {1e3 * best.cpu_s:.3f} ms CPU each")
    assert best.cpu_s <= MOST_NULL_CPU_S
    assert best.per_s >= LEAST_NULL_PER_S


def test_coordinator_serves_a_thousand_workers_at_ten_seconds_per_evaluation() -> None:
    cost = birth_cost(600).cpu_s
    setting = Setting(1, 10.0, cost)
    reached, outcome = most_workers(setting)
    rate = outcome.births_per_s
    print(f"\n{1e3 * cost:.2f} ms per birth: {reached} workers, {rate:.0f} births/s")
    assert reached >= LEAST_WORKERS


@pytest.mark.parametrize("parts", [12.0, 25.0], ids=["founders", "evolved"])
def test_cpu_per_birth(parts: float) -> None:
    """Founders of scenario 1 have 12 parts on average, its evolved robots 25.

    Without physics nothing evolves, so founders of the second size are generated.
    """
    rate = birth_cost(1500, parts)
    print(f"\n{rate.per_s:.0f} births/s, {1e3 * rate.cpu_s:.2f} ms CPU per birth")
    assert rate.cpu_s <= CPU_PER_BIRTH_S


def test_gain_of_a_second_worker() -> None:
    """Compare the evaluations per second of two workers with those of one.

    Coordinator, analyzer, two workers, real physics, network, journal and tables
    share the machine. Children of random founders are bred, vetted and evaluated as
    in scenario 1, with two differences: the brood does not end during the
    measurement, so no worker waits for its last child, and 60 births are in flight.
    One of the two workers leaves and joins in alternate turns, so that changes of the
    machine's speed affect both settings equally. The jobs of a leaving worker go to
    the other one, so births are still committed and each setting includes the
    breeding and vetting of its own births. The leaving worker finishes its current
    jobs and is idle before the turn is measured.
    """
    shipped = read_experiment("scenario1")
    selection = replace(shipped.selection, children=9_000, window=60)
    experiment = replace(shipped, births=10_000, selection=selection)
    rates: dict[int, list[float]] = {1: [], 2: []}
    cpu_s = []
    with live_run(experiment, worker.serve.service.process, 2) as (run, fleet):

        def measure_for(seconds: float) -> Rate:
            end_s = time.monotonic() + seconds
            return measure_run(run, fleet, lambda: time.monotonic() >= end_s)

        name = fleet.dispatch.names("worker")[1]
        joins = Joined(name, "worker", 1, fleet.dispatch.platform(name))
        measure_for(TURN_S)
        for turn in range(2 * TURNS):
            workers = 1 + turn % 2
            fleet.tell(Left(name) if workers == 1 else joins)
            measure_for(LEAVING_S if workers == 1 else JOINING_S)
            rate = measure_for(TURN_S)
            rates[workers].append(rate.per_s)
            cpu_s.append(rate.cpu_s)
    one, two = np.mean(rates[1]), np.mean(rates[2])
    gains = np.divide(rates[2], rates[1])
    error = gains.std(ddof=1) / np.sqrt(TURNS)
    print(
        f"\none worker {one:.1f}/s, two {two:.1f}/s: {two / one:.3f} +- {error:.3f}; "
        f"coordinator {1e3 * np.median(cpu_s):.2f} ms CPU per birth"
    )
    assert two / one >= SECOND_WORKER
