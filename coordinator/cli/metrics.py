"""Metrics of a coordinator for Prometheus, served over HTTP.

The main loop publishes an immutable snapshot; the server's threads read only that, so
that no request can disturb or delay a run.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Protocol

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
_NOTHING = Status((), 0, 0, 0.0)


class MetricsServer(AbstractContextManager["MetricsServer"]):
    """HTTP server of the metrics; use it in a ``with``.

    Attributes:
        url: where the metrics are.
    """

    def __init__(self, host: str, port: int) -> None:
        """Listen.

        Args:
            host: name or IP address, IPv6 in brackets.
            port: 0 lets the system choose.

        Raises:
            NetworkError: an address that cannot be listened on.
        """
        self._collector = _Collector()
        registry = CollectorRegistry()
        registry.register(self._collector)
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
        """Replace what is shown.

        Args:
            status: of all runs.
            refused_agents: number of agents that may not join.
        """
        self._collector.snapshot = (status, refused_agents)


class _Family(Protocol):
    """A metric whose samples have labels."""

    def add_metric(self, labels: list[str], value: float, /) -> None:
        """Add a sample."""


class _Collector:
    """Metrics of the last snapshot: status, and number of refused agents."""

    def __init__(self) -> None:
        self.snapshot: tuple[Status, int] = (_NOTHING, 0)

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics of one snapshot."""
        status, refused_agents = self.snapshot
        yield from _agents(status, refused_agents)
        yield from _queues(status)
        yield from _runs(status)
        faults = CounterMetricFamily(
            "revolve_faults", "Messages of peers that were not used", labels=["kind"]
        )
        by_kind = Counter[str](dict.fromkeys(MEANINGS, 0))
        for fault in status.faults:
            by_kind[fault.kind] += fault.count
        _fill(faults, by_kind)
        yield faults


def _agents(status: Status, refused: int) -> Iterator[Metric]:
    yield GaugeMetricFamily("revolve_workers", "Connected workers", status.workers)
    yield GaugeMetricFamily(
        "revolve_analyzers", "Connected analyzers", status.analyzers
    )
    yield GaugeMetricFamily(
        "revolve_refused_agents", "Agents that may not take part", refused
    )


def _queues(status: Status) -> Iterator[Metric]:
    waiting = GaugeMetricFamily(
        "revolve_jobs_waiting", "Requests that no agent has", labels=["kind"]
    )
    assigned = GaugeMetricFamily(
        "revolve_jobs_assigned", "Requests that agents have", labels=["kind"]
    )
    for queue in status.queues:
        waiting.add_metric([queue.kind], queue.waiting)
        assigned.add_metric([queue.kind], queue.assigned)
    yield waiting
    yield assigned


def _runs(status: Status) -> Iterator[Metric]:
    births = CounterMetricFamily(
        "revolve_births", "Births of a run", labels=["name", "run"]
    )
    wanted = GaugeMetricFamily(
        "revolve_births_wanted", "Births of a run at its end", labels=["name", "run"]
    )
    for run in status.runs:
        births.add_metric([run.name, str(run.run)], run.births)
        wanted.add_metric([run.name, str(run.run)], run.wanted)
    yield births
    yield wanted
    yield GaugeMetricFamily(
        "revolve_births_per_second", "Recent rate of all runs", status.births_per_s
    )
    states = GaugeMetricFamily("revolve_runs", "Runs by state", labels=["state"])
    by_state = Counter(dict.fromkeys(_STATES, 0))
    by_state.update(run.state for run in status.runs)
    _fill(states, by_state)
    yield states


def _fill(family: _Family, counts: Counter[str]) -> None:
    for label, value in sorted(counts.items()):
        family.add_metric([label], value)
