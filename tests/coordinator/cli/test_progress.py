"""Progress of runs for people and for programs."""

import io
import socket
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.request import urlopen

import pytest
from prometheus_client.parser import text_string_to_metric_families
from rich.console import Console

from coordinator.cli.metrics import MetricsServer
from coordinator.cli.progress import Display
from schema.errors import NetworkError
from schema.wire.status import IslandStatus, PeerFault, Queue, RunStatus, Status

_ISLAND = IslandStatus(120, 600, 0.51234, 30)


def shown(status: Status, width: int) -> list[str]:
    """Return the lines that are on the screen when the display stops."""
    file = io.StringIO()
    console = Console(
        file=file, width=width, height=25, force_terminal=True, color_system=None
    )
    scheduler: Any = SimpleNamespace(active=[], status=lambda _now_s: status)
    with Display(scheduler, quiet=False, console=console) as display:
        display.update(1.0)
    screen = file.getvalue().rpartition("\x1b[2K")[2]
    return [line.rstrip() for line in screen.splitlines() if "/" in line]


def one_run(name: str, *islands: IslandStatus) -> Status:
    return Status((RunStatus("/r", name, 0, "running", 12.3, islands),), 2, 1, 12.3)


@pytest.mark.parametrize(
    ("width", "line"),
    [
        (40, "120/600 scenario1 39 s left, best 0.512…"),
        (
            80,
            (
                "120/600 scenario1 ━━         39 s left, best 0.512, 12.3 births/s, 2 "
                "workers"
            ),
        ),
    ],
)
def test_a_bar_fits_the_terminal_and_starts_with_the_count(
    width: int, line: str
) -> None:
    assert shown(one_run("scenario1", _ISLAND), width) == [line]


@pytest.mark.parametrize("width", [40, 80, 200])
def test_no_line_is_wider_than_the_terminal(width: int) -> None:
    runs = tuple(
        RunStatus("/r", "an-experiment-with-a-very-long-name", run, "running",
                  1.0, (_ISLAND,) * 5)
        for run in range(3)
    )  # fmt: skip
    lines = shown(Status(runs, 1, 1, 3.0), width)
    assert [line.split()[0] for line in lines] == ["1800/9000", *["600/3000"] * 3]
    assert all(len(line) <= width for line in lines)
    assert "40 min" in lines[0]
    islands = shown(one_run("ring", _ISLAND, _ISLAND), width)
    assert [line.split()[0] for line in islands] == ["240/1200", "120/600", "120/600"]
    assert all(len(line) <= width for line in islands)
    assert "island 1" in islands[-1]
    assert "best 0.512" in islands[-1]


def waiting(
    capsys: pytest.CaptureFixture[str],
    *steps: tuple[float, Status],
    active: tuple[Any, ...] = (),
    **settings: Any,  # noqa: ANN401 - of Display
) -> list[str]:
    """Return what a display writes about waiting; steps are its times [s]."""
    current = steps[0][1]
    scheduler: Any = SimpleNamespace(active=active, status=lambda _now_s: current)
    with Display(scheduler, **{"quiet": False, **settings}) as display:
        for now_s, status in steps:
            current = status
            display.update(now_s)
    lines = capsys.readouterr().err.splitlines()
    return [line.partition("waiting")[2] for line in lines if "waiting" in line]


def without(workers: int, analyzers: int, **settings: Any) -> Status:  # noqa: ANN401
    run = RunStatus("/r", "a", 0, "running", 0.0, (_ISLAND,))
    return Status((run,), workers, analyzers, 0.0, **settings)


@pytest.mark.parametrize("is_quiet", [False, True])
def test_a_run_without_agents_says_how_to_start_some(
    capsys: pytest.CaptureFixture[str], *, is_quiet: bool
) -> None:
    missing = " for workers and analyzers: none is connected"
    how = (
        "; to start some on this machine: revolve worker --connect runs/a --plugins "
        "own.py, revolve analyzer --connect runs/a --plugins own.py"
    )
    for place, times_s, told in (
        ("runs/a", (0.0, 3.0, 30.0), [f"{missing}{how}"]),
        ("", (0.0, 3.0), []),
        ("", (0.0, 11.0), [missing]),
    ):
        steps = [(now_s, without(0, 0)) for now_s in times_s]
        found = waiting(capsys, *steps, quiet=is_quiet, place=place, plugins=["own.py"])
        assert found == told


def test_a_run_whose_jobs_no_worker_can_do_says_so_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = SimpleNamespace(path=Path("runs/all/a-0"))
    run = SimpleNamespace(
        lacking=["worker"], held=folder, waiting={0: ""}, recovery=None
    )
    steps = [(now_s, without(1, 1)) for now_s in (0.0, 1.0, 30.0)]
    told = waiting(capsys, *steps, active=(run,))
    assert told == [": a-0: none of the workers can do its jobs"]


def test_a_run_that_misses_others_than_before_says_so_again(
    capsys: pytest.CaptureFixture[str],
) -> None:
    refused = without(0, 1, faults=(PeerFault("refused", "w-0", 1),))
    states = [without(0, 0), without(1, 0), refused]
    steps = [(3.0 * number, states[number // 2]) for number in range(6)]
    how = "none is connected; to start some on this machine: "
    unfit = how.replace("none is connected", "none that is connected can do the jobs")
    worker, analyzer = (
        f"revolve {role} --connect runs/a" for role in ("worker", "analyzer")
    )
    assert waiting(capsys, *steps, place="runs/a") == [
        f" for workers and analyzers: {how}{worker}, {analyzer}",
        f" for analyzers: {how}{analyzer}",
        f" for workers: {unfit}{worker}",
    ]


def test_brackets_in_names_and_platforms_are_shown_as_they_are() -> None:
    """Rich reads "[/x]" as the end of a style, and fails without its start."""
    status = one_run("a[/x]", _ISLAND)
    assert "a[/x]" in shown(status, 80)[0]
    run = SimpleNamespace(
        lacking=[],
        held=SimpleNamespace(path=Path("runs/a[b]")),
        waiting={0: "evil [/x]"},
        recovery=None,
    )
    scheduler: Any = SimpleNamespace(active=[run], status=lambda _now_s: status)
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    with Display(scheduler, quiet=False, console=console) as display:
        display.update(1.0)
    file: Any = console.file
    assert "arena 0 of a[b] needs a worker of platform evil [/x];" in file.getvalue()


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
