"""Coordinator and agents that a test starts, stops and kills."""

import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import zenoh

from schema.agent.network import Tls, client_config
from schema.agent.topics import agents_alive
from tests.system.stage import Stage, wait_until


def size(folder: Path) -> int:
    """Return the size of a run's journal [bytes]; it may be growing."""
    journal = folder / "journal.bin"
    return journal.stat().st_size if journal.exists() else 0


def agent_processes(pid: int) -> list[int]:
    """Return the children of a command that do jobs, oldest first."""
    listing = Path(f"/proc/{pid}/task/{pid}/children").read_text("utf-8").split()
    return [int(child) for child in listing if b"spawn_main" in _command_line(child)]


def _command_line(pid: str) -> bytes:
    """Return the command line of a process; nothing if it has just ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return b""


class Fleet:
    """Coordinator and agents that can be frozen, killed and disconnected."""

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
        """Start an analyzer after so many workers have joined: births begin."""
        config = zenoh.Config.from_json5(client_config(self.address))
        with zenoh.open(config) as session:
            key = agents_alive("default", "worker")
            wait_until(
                lambda: len(list(session.liveliness().get(key))) >= workers,
                "all workers are there",
            )
        self.join("judge", "analyzer")

    def kill(self, name: str) -> None:
        """Kill an agent and the supervisor that would restart it."""
        process_pool = self.agents.pop(name)
        process_pool.send_signal(signal.SIGSTOP)
        for child in agent_processes(process_pool.pid):
            os.kill(child, signal.SIGKILL)
        process_pool.send_signal(signal.SIGKILL)

    def wait_for(self, position: float) -> None:
        """Wait until the journal has a size [bytes] or the run has ended."""
        wait_until(
            lambda: size(self.folder) > position or self.is_over,
            "the run is on its way",
        )

    def finish(self) -> None:
        """Wait for the end of the run and check its exit code."""
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
