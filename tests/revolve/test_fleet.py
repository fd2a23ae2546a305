"""A fleet from Python: order, faults, cancellation, ends."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

import revolve as rv
from coordinator.cluster.kit import ClusterKit, Kit
from coordinator.network.service import Network
from revolve.children import Workers
from schema.agent.supervisor import cores
from schema.plugins import permission
from schema.wire.calls import call_settings
from tests.system.fleet import agent_processes
from tests.system.workspace import wait_until

TOP = Path(__file__).parents[2]
pytestmark = pytest.mark.system

SHORT = rv.Experiment.from_toml('name = "short"\n[simulation]\nwindow_steps = 400\n')


def robots(count: int) -> list[rv.Robot]:
    return [rv.Robot.random(SHORT, seed=3, number=number) for number in range(count)]


def workers_of(fleet: rv.Fleet) -> list[int]:
    """Return the processes that do the jobs of a fleet's own workers."""
    (command,) = (each._process.pid for each in fleet._workers)
    return agent_processes(command)


@pytest.fixture(scope="module")
def fleet() -> Iterator[rv.Fleet]:
    with rv.Fleet(workers=2) as opened:
        yield opened


def test_results_are_in_order_and_equal_those_of_one_process(fleet: rv.Fleet) -> None:
    many = robots(12)
    results = list(fleet.evaluate(many, SHORT))
    assert results == [rv.evaluate(robot) for robot in many]
    assert len({result.fitness for result in results}) > 6
    # Their own experiment is the same one.
    assert list(fleet.evaluate(many)) == results
    assert list(fleet.evaluate(iter(()))) == []
    future = fleet.submit(many[0], SHORT)
    assert future.result(30) == results[0]
    assert future.done()


def test_trials_and_traces_equal_those_of_one_process(fleet: rv.Fleet) -> None:
    noisy = SHORT.replace(
        simulation={"actuator_noise": 0.2}, measures={"names": ["energy"]}
    )
    many = robots(3)
    flags: dict[str, Any] = {"record": ["outputs", "part_poses", "contact"]}
    results = fleet.evaluate(many, noisy, trials=[4, 0], trace=True, **flags)
    for robot in many:
        for trial in (4, 0):
            result, alone = (
                next(results),
                rv.evaluate(robot, noisy, trial=trial, **flags),
            )
            assert result == alone
            assert result.trace is not None
            assert alone.trace is not None
            assert result.trace.robot == alone.trace.robot
            assert result.trace.channels.keys() == alone.trace.channels.keys()
            for name in ("energy", *flags["record"]):
                one, other = result.trace.channels[name], alone.trace.channels[name]
                assert (one.dtype, one.tolist()) == (other.dtype, other.tolist())
    assert next(results, None) is None
    plainly, traced = (
        fleet.submit(many[0], noisy, trace=each) for each in (False, True)
    )
    assert plainly.result(60).trace is None
    assert traced.result(60).trace is not None


def test_failed_evaluation_has_its_trace(fleet: rv.Fleet) -> None:
    """The cost of transport needs gravity: there is no fitness, but a simulation."""
    weightless = SHORT.replace(
        simulation={"gravity": 0.0}, measures={"names": ["cost_of_transport"]}
    )
    (result,) = fleet.evaluate(robots(1), weightless, trace=True)
    assert "needs simulation.gravity > 0" in result.failure
    assert result.trace is not None
    assert len(result.trace.core_position) == 11


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ({"trials": []}, "trials: must be one or more numbers, got none"),
        (
            {"trials": {1, 2}},
            "trials: must be a list, or another iterable with an order",
        ),
        ({"trials": 5}, "trials: must be a list, or another iterable with an order"),
        (
            {"trials": [0, -1]},
            "trial: must be a whole number from 0 to 1000000, got -1",
        ),
        (
            {"trials": [10**7]},
            "trial: must be a whole number from 0 to 1000000, got 10000000",
        ),
        ({"trials": [1.0]}, "trial: must be a whole number from 0 to 1000000, got 1.0"),
        ({"trials": "12"}, "trial: must be a whole number from 0 to 1000000, got '1'"),
        ({"record": ["outputz"]}, "record: 'outputz' is not a channel; did you mean"),
        ({"record": "outputs"}, "record: must be a list of names, got 'outputs'"),
        ({"record": [None]}, "record: None is not a channel; channels: "),
    ],
)
def test_mistakes_of_trials_and_channels(
    fleet: rv.Fleet, words: dict[str, Any], line: str
) -> None:
    with pytest.raises(rv.RevolveError) as caught:
        fleet.evaluate(robots(1), SHORT, **words)
    assert str(caught.value).startswith(line)


@pytest.mark.parametrize("taken", [0, 1])
def test_rest_is_dropped_when_the_iterator_is_closed(
    fleet: rv.Fleet, taken: int
) -> None:
    found = fleet.evaluate(robots(40), SHORT)
    assert len(list(islice(found, taken))) == taken
    engine = fleet._engine
    assert engine is not None
    wait_until(lambda: len(engine._open) > 10, "jobs ahead")
    found.close()  # type: ignore[attr-defined]
    wait_until(lambda: not engine._open, "no job")
    assert next(fleet.evaluate(robots(1))).failure == ""


def test_invalid_robot_raises_at_once(fleet: rv.Fleet) -> None:
    robot = robots(1)[0]
    with pytest.raises(rv.InvalidRobot):
        fleet.submit(rv.Robot(robot.parts[:1] * 2), SHORT)
    with pytest.raises(rv.ExperimentError, match="no such experiment"):
        fleet.evaluate([robot], "nothing")


def test_killed_worker_costs_no_result() -> None:
    many = robots(60)
    with rv.Fleet(workers=2) as fleet:
        results = fleet.evaluate(many, SHORT)
        found = [next(results)]
        wait_until(lambda: len(workers_of(fleet)) == 2, "two workers")
        os.kill(workers_of(fleet)[0], signal.SIGKILL)
        found += results
    assert found == [rv.evaluate(robot) for robot in many]


def test_own_modules_fail_as_results_and_are_quarantined(tmp_path: Path) -> None:
    (tmp_path / "lab_fitness.py").write_text(
        "import os, signal\n"
        "def undefined(track, fitness):\n"
        "    # Not on the short and long tracks of the check.\n"
        "    return float('nan') if len(track.core_position) == 11 else 1.0\n"
        "def crash(track, fitness):\n    os.kill(os.getpid(), signal.SIGSEGV)\n"
    )
    text = 'name = "lab"\n[simulation]\nwindow_steps = 400\n[fitness]\nfunction = '
    with rv.Fleet(workers=1) as fleet:
        # The workers have started before the module is known.
        assert next(fleet.evaluate(robots(1), SHORT)).failure == ""
        for name, expected in (
            ("undefined", "finite number"),
            ("crash", "quarantined: ended its own process 3 times, by SIGSEGV"),
        ):
            (tmp_path / "lab.toml").write_text(f'{text}"lab_fitness:{name}"\n')
            (result,) = fleet.evaluate(robots(1), tmp_path / "lab.toml")
            assert result.fitness is None
            assert expected in result.failure


def test_map_calls_a_function_by_name(
    fleet: rv.Fleet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lab_of_maps.py").write_text(
        "import os\n"
        "def size(text):\n    return [len(text), os.getpid()]\n"
        "def inverse(number):\n    return 1 / number\n"
    )
    monkeypatch.chdir(tmp_path)
    items = ["a" * number for number in range(60)]
    values = list(fleet.map("lab_of_maps:size", items))
    assert [length for length, _ in values] == list(range(60))
    assert os.getpid() not in {process for _, process in values}
    found = fleet.map("lab_of_maps:inverse", [2, 0])
    assert next(found) == 0.5
    with pytest.raises(
        rv.RevolveError, match="item 1: lab_of_maps:inverse raised Zero"
    ):
        next(found)
    with pytest.raises(rv.ExperimentError, match="item 0: must be None, bool"):
        next(fleet.map("lab_of_maps:inverse", [1j]))
    with pytest.raises(rv.ExperimentError, match=r"\(of robots: Genome\.to_bytes\)"):
        next(fleet.map("lab_of_maps:inverse", robots(1)))
    with pytest.raises(rv.UnknownPlugin, match="did you mean 'lab_of_maps:size'"):
        fleet.map("lab_of_maps:sizes", items)
    with pytest.raises(rv.UnknownPlugin, match="not allowed"):
        fleet.map(os.path.getsize, items)
    with pytest.raises(rv.ExperimentError, match="workers cannot import"):
        fleet.map(lambda item: item, items)
    for unordered in ({"a"}, frozenset("a"), 3):
        with pytest.raises(rv.RevolveError, match=r"^items: must be a list, .* got "):
            fleet.map("lab_of_maps:size", unordered)  # type: ignore[arg-type]
        with pytest.raises(rv.RevolveError, match=r"^robots: must be a list, .* got "):
            fleet.evaluate(unordered)  # type: ignore[arg-type]
    other: Any = 3
    message = "^function: must be a function or 'module:attribute', got 3$"
    with pytest.raises(rv.ExperimentError, match=message):
        fleet.map(other, items)


def test_map_runs_only_what_the_owner_of_a_worker_allows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lab_of_others.py").write_text("def f(item):\n    return item\n")
    monkeypatch.chdir(tmp_path)
    place = Path(tempfile.mkdtemp(prefix="rv-"))
    listen = f"unixsock-stream/{place / 'hub'}"
    with Network(name="hub", listen=(listen,)) as hub:
        # A worker of another owner, who allows nothing.
        stranger = Workers(hub.own_address, 1, ())
        try:
            with rv.Fleet(connect=hub.own_address, give_up_after_s=2.0) as fleet:
                wait_until(lambda: fleet.workers == 1, "the worker")
                future = fleet.submit(robots(1)[0], SHORT)
                assert future.result(60).failure == ""
                permission.allow_references(["lab_of_others:f"], tmp_path)
                call = fleet._call(call_settings("lab_of_others:f"), 1, 0)
                wait_until(lambda: fleet.workers == 0, "no worker")
                (told,) = fleet._network.faults.counts
                assert (told.kind, told.count > 0) == ("refused", True)
                why = (
                    r"gave up after 2 s: 1 agent joined at .* and cannot do the jobs, "
                    rf"the last of them {told.peer}: has no plug-in 'lab_of_others'"
                )
                with pytest.raises(rv.NetworkError, match=why):
                    call.result(60)
        finally:
            stranger.end()


def test_a_fleet_without_workers_gives_up_if_it_is_told_to() -> None:
    place = Path(tempfile.mkdtemp(prefix="rv-"))
    with (
        Network(name="hub", listen=(f"unixsock-stream/{place / 'hub'}",)) as hub,
        rv.Fleet(connect=hub.own_address, give_up_after_s=1.0) as fleet,
    ):
        future = fleet.submit(robots(1)[0], SHORT)
        why = f"^gave up after 1 s: no worker is connected at {hub.own_address}$"
        with pytest.raises(rv.NetworkError, match=why):
            future.result(30)
        with pytest.raises(rv.NetworkError, match=why):
            fleet.submit(robots(1)[0], SHORT)
    with pytest.raises(rv.RevolveError, match=r"^give_up_after_s: must be > 0, got 0$"):
        rv.Fleet(give_up_after_s=0)


def test_certificates_come_from_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kit = Kit.new(tmp_path / "lab", ClusterKit("h", 1, 90), lambda: datetime.now(UTC))
    kit.add("ada", "coordinator")
    needs = r"^tls/h:1 needs \$REVOLVE_TLS_CA, \$REVOLVE_TLS_CERTIFICATE and"
    with pytest.raises(rv.NetworkError, match=needs):
        rv.Fleet(connect="tls/h:1")
    with pytest.raises(rv.NetworkError, match=needs):
        rv.run("scenario1", connect="tls/h:1", out=tmp_path / "run")
    files = {"CA": "ca", "CERTIFICATE": "certificate", "KEY": "key"}
    paths = [str(tmp_path / f"lab/members/ada/{file}.pem") for file in files.values()]
    fleets = [rv.Fleet(connect="tls/h:1", tls=tuple(paths))]  # type: ignore[arg-type]
    for name, path in zip(files, paths, strict=True):
        monkeypatch.setenv(f"REVOLVE_TLS_{name}", path)
    fleets.append(rv.Fleet(connect="tls/h:1"))
    for fleet in fleets:
        assert fleet._network._me.name.startswith("ada.")
    monkeypatch.setenv("REVOLVE_TLS_KEY", "gone")
    with pytest.raises(
        rv.NetworkError, match=r"^\$REVOLVE_TLS_KEY: no such file: gone$"
    ):
        rv.Fleet(connect="tls/h:1")
    rv.Fleet()  # which needs none


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rv.run("scenario1", workers=1000), "^workers: must be a whole number"),
        (lambda: rv.run("scenario1", births=0), "^births: must be a whole number"),
        (lambda: rv.run("scenario1", seed=-1), "^seed: must be a whole number from 0"),
        (lambda: rv.run("scenario1", connect="what"), "^connect: must be tcp/HOST:PO"),
        (lambda: rv.run("scenario1", plugins=["x"]), "^plugins: no module 'x' is inst"),
        (lambda: rv.Fleet(connect="what"), "^connect: must be tcp/HOST:PORT"),
        (lambda: rv.Fleet(plugins=["x"]), "^plugins: no module 'x' is installed"),
        (lambda: rv.Fleet(workers=0), f"from 1 to {4 * cores()}, got 0"),
        (lambda: rv.Fleet(workers=4 * cores() + 1), f"from 1 to {4 * cores()}, got "),
    ],
)
def test_errors_name_arguments_of_python(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    make: Callable[[], object],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(rv.RevolveError, match=message) as error:
        make()
    assert "--" not in str(error.value)


def test_closed_fleet_cancels_and_refuses() -> None:
    with rv.Fleet(workers=1) as fleet:
        future = fleet.submit(robots(1)[0], "scenario1")
    with pytest.raises(CancelledError):
        future.result(0)
    with pytest.raises(rv.RevolveError, match="closed"):
        fleet.submit(robots(1)[0])
    with pytest.raises(rv.RevolveError, match="use it in a 'with'"):
        rv.Fleet(workers=1).submit(robots(1)[0])


def test_workers_of_another_hub_do_the_jobs() -> None:
    address = f"unixsock-stream/{tempfile.mkdtemp(prefix='rv-')}/hub"
    with Network(name="hub", listen=(address,)) as hub:
        with pytest.raises(rv.NetworkError, match="no hub at"):
            rv.Fleet(connect=f"{address}x").__enter__()
        with rv.Fleet(workers=1, connect=hub.own_address) as fleet:
            many = robots(3)
            found = list(fleet.evaluate(many, SHORT))
            assert found == [rv.evaluate(robot) for robot in many]


_LOOP = """
import sys, revolve as rv
robots = [rv.Robot.random(number=n) for n in range(400)]
with rv.Fleet(workers=2) as fleet:
    for result in fleet.evaluate(robots, "scenario1"):
        print(fleet._workers[0]._process.pid, flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_worker_outlives_its_loop(number: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", _LOOP],
        env={**os.environ, "PYTHONPATH": str(TOP)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        command = int(process.stdout.readline())
        started = [command, *agent_processes(command)]
        assert len(started) == 3
        process.send_signal(number)
        process.communicate()
    assert process.returncode == -number
    left = (Path(f"/proc/{each}") for each in started)
    for path in left:
        wait_until(lambda path=path: not path.exists(), "all have ended")  # type: ignore[misc]
