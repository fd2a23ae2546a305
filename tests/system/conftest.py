"""Whole runs as a user starts them: real processes, physics, network and disk."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from schema.network import Tls, client_config
from schema.topics import agents_alive

BIRTHS = 60
PATIENCE_S = 240.0


class Stage:
    """Starts the commands of one test in one folder and ends what is left."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._started: list[subprocess.Popen[str]] = []

    def start(
        self,
        *words: str,
        folder: Path | None = None,
        environment: dict[str, str] | None = None,
        inside: str = "",
    ) -> subprocess.Popen[str]:
        """Start ``revolve`` with these words and return at once.

        Args:
            words: of the command line.
            folder: where, instead of the stage's own.
            environment: variables besides those that are set.
            inside: a network namespace.
        """
        prefix = ("ip", "netns", "exec", inside) if inside else ()
        process = subprocess.Popen(
            [*prefix, sys.executable, "-m", "revolve", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder or self.folder,
            env={
                **os.environ,
                "PYTHONPATH": str(Path(__file__).parents[2]),
                **(environment or {}),
            },
        )
        self._started.append(process)
        return process

    def run(self, *words: str, code: int = 0) -> str:
        """Run ``revolve`` to its end; return what it printed, both streams."""
        process = self.start(*words)
        out, err = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == code, f"{words}: {process.returncode}\n{out}{err}"
        return out + err

    def clear(self) -> None:
        """Kill whatever still runs; a test that failed shows what all said."""
        for process in self._started:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            out, err = process.communicate()
            sys.stdout.write(f"{process.args!r}: {process.returncode}\n{out}{err}\n")


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Return once a condition holds; fail the test if it never does."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f"never happened: {what}"
        time.sleep(0.005)  # the interval of looking, not a wait for luck


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with ExitStack() as stack:
        made = Stage(tmp_path)
        stack.callback(made.clear)
        yield made


@pytest.fixture
def until() -> Callable[[Callable[[], bool], str], None]:
    return wait_until


@pytest.fixture(scope="session")
def births() -> int:
    return BIRTHS


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run in one process: what all others must equal."""
    stage = Stage(tmp_path_factory.mktemp("undisturbed"))
    words = ("scenario1", "--seed", "5", "--births", str(BIRTHS), "--quiet")
    stage.run("run", *words, "--in-process", "--out", "run")
    return stage.folder / "run"


def size(folder: Path) -> int:
    """Return how long a run's journal is [bytes]; it may be growing."""
    journal = folder / "journal.bin"
    return journal.stat().st_size if journal.exists() else 0


def agent_processes(pid: int) -> list[int]:
    """Return those of a command's children that do jobs, oldest first."""
    listing = Path(f"/proc/{pid}/task/{pid}/children").read_text("utf-8").split()
    return [
        int(child)
        for child in listing
        if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()
    ]


class Fleet:
    """A coordinator and agents that can be frozen, killed and cut off."""

    def __init__(
        self, stage: Stage, *words: str, listen: str = "", inside: str = ""
    ) -> None:
        self.stage = stage
        self.folder = stage.folder / "run"
        self.address = listen or "tcp/127.0.0.1:0"
        all_words = (*words, "--out", "run", "--listen", self.address)
        self.coordinator = stage.start("coordinator", *all_words, inside=inside)
        wait_until(
            lambda: (self.folder / "address").exists() or self.is_over,
            "the coordinator listens",
        )
        if not listen:
            self.address = (self.folder / "address").read_text().strip()
        self.agents: dict[str, subprocess.Popen[str]] = {}

    @property
    def is_over(self) -> bool:
        """The coordinator has ended."""
        return self.coordinator.poll() is not None

    def join(self, name: str, role: str = "worker", *more: str, **where: Any) -> int:  # noqa: ANN401 - as of Stage.start
        """Start an agent of one process and return that process's id."""
        words = (role, "--connect", self.address, "--name", name, "--processes", "1")
        process = self.agents[name] = self.stage.start(*words, *more, **where)
        wait_until(lambda: agent_processes(process.pid) != [], f"{name} starts")
        return agent_processes(process.pid)[0]

    def begin(self, workers: int) -> None:
        """Let an analyzer join as soon as so many workers are there: births begin."""
        config = zenoh.Config.from_json5(client_config(self.address))
        with zenoh.open(config) as session:
            key = agents_alive("default", "worker")
            wait_until(
                lambda: len(list(session.liveliness().get(key))) >= workers,
                "all workers are there",
            )
        self.join("judge", "analyzer")

    def kill(self, name: str) -> None:
        """Kill an agent, and whoever would revive it."""
        crew = self.agents.pop(name)
        crew.send_signal(signal.SIGSTOP)
        for child in agent_processes(crew.pid):
            os.kill(child, signal.SIGKILL)
        crew.send_signal(signal.SIGKILL)

    def wait_for(self, position: float) -> None:
        """Wait until the journal is so long [bytes] or the run has ended."""
        wait_until(
            lambda: size(self.folder) > position or self.is_over,
            "the run is on its way",
        )

    def finish(self) -> None:
        """Wait for the end, which must be a good one."""
        wait_until(lambda: self.is_over, "the run ends")
        assert self.coordinator.returncode == 0, self.coordinator.communicate()


def make_certificate(folder: Path, name: str, authority: str, host: str) -> Tls:
    """Make a certificate with openssl, signed by an authority made for it."""
    script = f"""
    set -e; cd "{folder}"; exec 2>&1
    [ -f {authority}.pem ] || openssl req -x509 -newkey rsa:2048 -nodes -days 1 \
        -keyout {authority}.key -out {authority}.pem -subj /CN={authority}
    openssl req -newkey rsa:2048 -nodes -subj /CN={name} \
        -keyout {name}.key -out {name}.csr
    printf 'subjectAltName=IP:{host},DNS:localhost\nbasicConstraints=CA:FALSE\n' \
        > {name}.ext
    openssl x509 -req -in {name}.csr -CA {authority}.pem -CAkey {authority}.key \
        -CAcreateserial -days 1 -out {name}.pem -extfile {name}.ext
    """
    subprocess.run(["sh", "-c", script], check=True, capture_output=True)
    files = (f"{authority}.pem", f"{name}.pem", f"{name}.key")
    return Tls(*(str(folder / file) for file in files))


@pytest.fixture
def certify() -> Callable[[Path, str, str, str], Tls]:
    return make_certificate


@pytest.fixture
def fleet_of() -> type[Fleet]:
    return Fleet


CROWD = """
name = "crowd"
births = 25
[selection]
population = 8
[simulation]
warmup_steps = 600
[arena]
birth_radius_m = 0.5
record_touches = true
snapshot_interval_s = 30.0
"""
"""An arena so small that its robots are in each other's way."""


@pytest.fixture
def arena_stage(stage: Stage) -> Stage:
    """Return a stage on which ``crowd.toml`` lies."""
    (stage.folder / "crowd.toml").write_text(CROWD)
    return stage


@pytest.fixture(scope="session")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an arena in one process, to which nothing happened."""
    stage = Stage(tmp_path_factory.mktemp("calm"))
    (stage.folder / "crowd.toml").write_text(CROWD)
    words = ("crowd.toml", "--seed", "4", "--quiet", "--out", "run")
    stage.run("run", *words, "--in-process", "--threads", "1")
    return stage.folder / "run"


HAMLET = """
name = "hamlet"
births = 12
[selection]
population = 5
[simulation]
warmup_steps = 200
window_steps = 800
[arena]
birth_interval_s = 4.0
cull_interval_s = 8.0
sample_interval_s = 2.0
snapshot_interval_s = 6.0
birth_radius_m = 0.4
record_touches = true
"""
"""An arena for little more than half a minute, in which all happens that can."""


@pytest.fixture(scope="session")
def hamlet_document() -> str:
    return HAMLET


@pytest.fixture
def hamlet_stage(stage: Stage) -> Stage:
    """Return a stage on which ``hamlet.toml`` lies."""
    (stage.folder / "hamlet.toml").write_text(HAMLET)
    return stage


@pytest.fixture(scope="session")
def quiet_hamlet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of such an arena to which nothing happened."""
    stage = Stage(tmp_path_factory.mktemp("hamlet"))
    (stage.folder / "hamlet.toml").write_text(HAMLET)
    words = ("hamlet.toml", "--seed", "4", "--quiet", "--out", "run")
    stage.run("run", *words, "--in-process", "--threads", "1")
    return stage.folder / "run"
