"""Benchmark of TLS and access rules: their share of the throughput of a fleet."""

import time
from contextlib import ExitStack
from math import exp
from pathlib import Path
from statistics import mean, stdev

import numpy as np
import pytest

import tests.null_workers
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.service import Network
from schema.agent.access import Certificate
from schema.agent.network import Agent
from schema.agent.supervisor import ProcessPool, prepare_process
from schema.agent.topics import unique_name
from tests.benchmarks.dispatch_bench import Rate, Stream, measure
from tests.system.fleet import kit_files, make_kit
from tests.system.workspace import free_address

prepare_process()  # as the command does, before the first session is opened

pytestmark = pytest.mark.benchmark

LEAST_RATIO = 0.95
PAIRS = 20
TURN_S = 1.0
IN_FLIGHT = 64


class Turns(Stream):
    """Stream of evaluations that can end: none is in flight between two turns.

    An answer that waited during another fleet's turn would count as a slow job, and the
    coordinator pauses for as long as it expects jobs to take.
    """

    is_open = True
    asked = 0

    def _ask(self) -> None:
        if self.is_open:
            self.asked += 1
            super()._ask()

    def turn(self, seconds: float) -> Rate:
        """Measure for some time; return once all answers are there."""
        self.is_open = True
        for _ in range(IN_FLIGHT):
            self._ask()
        found = measure(self, seconds)
        self.is_open = False
        while self.done < self.asked:
            self.listen(0.1, time.monotonic())
        return found


def test_access_rules_and_tls_cost_little_throughput(tmp_path: Path) -> None:
    """Two fleets of one null worker each, measured in alternate turns.

    One is connected by TCP without rules, the other by TLS with the rights of roles. A
    fleet without requests is idle. Turns take one second, so that changes of the
    machine's speed affect both fleets equally.
    """
    # Both sides listen to or show these; the coordinator's own session is the hub.
    make_kit(tmp_path / "lab", head="hub", box="worker")
    head, box = (kit_files(tmp_path / "lab", name) for name in ("head", "box"))
    rules = (Certificate("head", "coordinator"), Certificate("box", "worker"))
    tls_address = free_address("tls")
    tls = Network(
        name=unique_name("head"), listen=(tls_address,), tls=head, certificates=rules
    )
    plain = Network(name=unique_name("head"), listen=("tcp/127.0.0.1:0",))
    rates: dict[str, list[float]] = {"plain": [], "tls": []}
    cpu_s: dict[str, list[float]] = {"plain": [], "tls": []}
    with ExitStack() as stack:
        fleets = {}
        for name, network in (("plain", plain), ("tls", tls)):
            stack.enter_context(network)
            agent = Agent(
                "worker", "box", network.address, tls=box if name == "tls" else None
            )
            stack.enter_context(
                ProcessPool(tests.null_workers.process, (agent,), size=1)
            )
            fleets[name] = Turns(JobRouter(network), 0)
        for turn in range(2 * PAIRS):
            name = ("plain", "tls")[(turn + turn // 2) % 2]
            found = fleets[name].turn(TURN_S)
            rates[name].append(found.per_s)
            cpu_s[name].append(found.cpu_s)
    logs = np.log(np.array(rates["tls"]) / np.array(rates["plain"]))
    ratio, error = exp(logs.mean()), stdev(logs) / PAIRS**0.5
    print(
        f"\nnull evaluations: {mean(rates['plain']):.0f}/s plain, "
        f"{mean(rates['tls']):.0f}/s with TLS and access rules; ratio "
        f"{ratio:.3f} +- {error:.3f}; coordinator {1e3 * mean(cpu_s['plain']):.3f} and "
        f"{1e3 * mean(cpu_s['tls']):.3f} ms CPU each"
    )
    # Single turns vary by a fifth; their means do not.
    assert mean(rates["tls"]) >= LEAST_RATIO * mean(rates["plain"])
