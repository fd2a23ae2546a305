"""Metrics of a coordinator for Prometheus, served over HTTP.

The main loop publishes an immutable snapshot; the server's threads read only that, so
that no request can disturb or delay a run.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import NamedTuple

from coordinator.dispatch.faults import MEANINGS
from schema.agent.extras import install_advice
from schema.errors import NetworkError
from schema.wire.status import Status

try:
    from prometheus_client import start_http_server
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
    from prometheus_client.registry import CollectorRegistry
except ImportError:
    raise NetworkError(
        f"--metrics needs the package prometheus-client: {install_advice('cluster')}"
    ) from None

_STATES = ("waiting", "running", "stopped", "finished", "failed", "damaged")


class Snapshot(NamedTuple):
    """Status of all runs, and the number of agents that may not join."""

    status: Status = Status((), 0, 0, 0.0)
    refused_agents: int = 0


Samples = Mapping[tuple[str, ...], float]
"""Values of a metric by those of its labels."""


def _states(shown: Snapshot) -> Samples:
    counts = Counter(run.state for run in shown.status.runs)
    return {(state,): counts[state] for state in {*_STATES, *counts}}


def _faults(shown: Snapshot) -> Samples:
    counts = Counter[str]()
    for fault in shown.status.faults:
        counts[fault.kind] += fault.count
    return {(kind,): counts[kind] for kind in {*MEANINGS, *counts}}


_METRICS: dict[str, tuple[str, tuple[str, ...], Callable[[Snapshot], Samples]]] = {
    "workers": ("Connected workers", (), lambda it: {(): it.status.workers}),
    "analyzers": ("Connected analyzers", (), lambda it: {(): it.status.analyzers}),
    "refused_agents": ("Agents that may not take part", (),
        lambda it: {(): it.refused_agents}),
    "jobs_waiting": ("Requests that no agent has", ("kind",),
        lambda it: {(jobs.kind,): jobs.waiting for jobs in it.status.queues}),
    "jobs_assigned": ("Requests that agents have", ("kind",),
        lambda it: {(jobs.kind,): jobs.assigned for jobs in it.status.queues}),
    "births": ("Births of a run", ("name", "run"),
        lambda it: {(run.name, str(run.run)): run.births for run in it.status.runs}),
    "births_wanted": ("Births of a run at its end", ("name", "run"),
        lambda it: {(run.name, str(run.run)): run.wanted for run in it.status.runs}),
    "births_per_second": ("Recent rate of all runs", (),
        lambda it: {(): it.status.births_per_s}),
    "runs": ("Runs by state", ("state",), _states),
    "faults": ("Messages of peers that were not used", ("kind",), _faults),
}  # fmt: skip
"""Meaning, labels and samples of each metric, by its name after ``revolve_``."""
_COUNTERS = {"births", "faults"}
"""Metrics that only grow."""


class MetricsServer(AbstractContextManager["MetricsServer"]):
    """HTTP server of the metrics at ``url``; use it in a ``with``."""

    def __init__(self, host: str, port: int) -> None:
        """Listen at a host, IPv6 in brackets; port 0 lets the system choose.

        Raises:
            NetworkError: an address that cannot be listened on.
        """
        self._snapshot = Snapshot()
        registry = CollectorRegistry()
        registry.register(self)
        try:
            self._server, self._thread = start_http_server(
                port, addr=host.strip("[]"), registry=registry
            )
        except OSError as error:
            raise NetworkError(
                f"--metrics: cannot listen on {host}:{port}: {error.strerror or error}"
            ) from None
        self.url = f"http://{host}:{self._server.server_port}/metrics"

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def publish(self, status: Status, refused_agents: int) -> None:
        """Replace what is shown; see ``Snapshot``."""
        self._snapshot = Snapshot(status, refused_agents)

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics of one snapshot."""
        shown = self._snapshot
        for name, (meaning, labels, samples) in _METRICS.items():
            kind = CounterMetricFamily if name in _COUNTERS else GaugeMetricFamily
            family = kind(f"revolve_{name}", meaning, labels=labels)
            for values, number in sorted(samples(shown).items()):
                family.add_metric(values, number)
            yield family
