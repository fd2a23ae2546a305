"""Metrics for Prometheus: their values, their text, their server."""

import socket
import sys
from importlib import import_module
from urllib.request import urlopen

import pytest
from prometheus_client.parser import text_string_to_metric_families

from coordinator.cli.metrics import MetricsServer
from schema.errors import NetworkError
from schema.wire.status import IslandStatus, PeerFault, Queue, RunStatus, Status

RUNS = (
    RunStatus("/a", "scenario1", 0, "running", 2.0, (IslandStatus(10, 20, 0.5, 9),)),
    RunStatus("/b", 'odd "name"\n', 1, "waiting"),
)
STATUS = Status(
    RUNS,
    3,
    1,
    2.5,
    (PeerFault("late", "a", 3), PeerFault("late", "b", 4)),
    (Queue("worker", 5, 6), Queue("analyzer", 0, 2), Queue("arena", 1, 0)),
)


def read(server: MetricsServer) -> dict[tuple[str, ...], float]:
    """Return the values of all samples, by name and labels."""
    with urlopen(server.url, timeout=10) as answer:  # noqa: S310 - of this machine
        text = answer.read().decode("utf-8")
    return {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_the_last_snapshot_is_shown() -> None:
    with MetricsServer("127.0.0.1", 0) as server:
        assert server.url.startswith("http://127.0.0.1:")
        assert read(server)["revolve_workers",] == 0
        server.publish(STATUS, 2)
        found = read(server)
        assert found["revolve_workers",] == 3
        assert found["revolve_analyzers",] == 1
        assert found["revolve_refused_agents",] == 2
        assert found["revolve_jobs_waiting", "worker"] == 5
        assert found["revolve_jobs_assigned", "worker"] == 6
        assert found["revolve_jobs_waiting", "arena"] == 1
        assert found["revolve_births_total", "scenario1", "0"] == 10
        assert found["revolve_births_wanted", "scenario1", "0"] == 20
        assert found["revolve_births_total", 'odd "name"\n', "1"] == 0
        assert found["revolve_births_per_second",] == 2.5
        assert found["revolve_runs", "running"] == 1
        assert found["revolve_runs", "failed"] == 0
        assert found["revolve_faults_total", "late"] == 7
        assert found["revolve_faults_total", "foreign"] == 0
        server.publish(Status(RUNS, 8, 1, 2.5), 0)
        assert read(server)["revolve_workers",] == 8


def test_a_missing_package_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "coordinator.cli.metrics")
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with pytest.raises(NetworkError, match="prometheus-client"):
        import_module("coordinator.cli.metrics")


def test_a_port_in_use_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as used:
        port = used.getsockname()[1]
        with pytest.raises(NetworkError, match=rf"--metrics: .*127.0.0.1:{port}"):
            MetricsServer("127.0.0.1", port)
