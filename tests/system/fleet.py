"""A coordinator and agents that a test starts, stops and kills."""

import os
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import zenoh

from coordinator.cluster.kit import ClusterKit, Kit, MemberRole, utc_now
from coordinator.islands.events import Advanced
from coordinator.storage.journal import NAME, Journal
from schema.agent.machine import platform_tag, wire_version
from schema.agent.network import Tls, client_config
from schema.agent.topics import FleetMember, Role, key_of_all, member_of
from schema.wire.codec import encode
from schema.wire.messages import AgentInfo, Crash
from tests.system.workspace import Process, Workspace, wait_until


def size(folder: Path) -> int:
    """Return the size of a run's journal [bytes]; it may be growing."""
    journal = folder / "journal.bin"
    return journal.stat().st_size if journal.exists() else 0


def kill_beyond(process: Process, folder: Path, position: float) -> None:
    """Kill a process when the journal of its run exceeds a size [bytes]."""
    wait_until(
        lambda: size(folder) > position or process.poll() is not None,
        "the run is on its way",
    )
    process.kill()
    output = process.communicate()
    assert size(folder) > position, output


def advances(folder: Path) -> list[Advanced]:
    """Return the advances of a run's journal, which may be growing."""
    with TemporaryDirectory() as copied:
        shutil.copy(folder / NAME, copied)
        with Journal.open(Path(copied)) as journal:
            return [event for event in journal.replay() if isinstance(event, Advanced)]


def holders(folder: Path) -> list[str]:
    """Return the name of the worker of each advance, without what a restart changes."""
    return [one.provenance.agent.partition("-")[0] for one in advances(folder)]


def agent_processes(pid: int) -> list[int]:
    """Return the agent processes of a command, oldest first."""
    return sorted(agent for server in children(pid) for agent in children(server))


def children(pid: int) -> list[int]:
    """Return the processes that a process has started; none if it has ended."""
    with suppress(FileNotFoundError, ProcessLookupError):
        listing = Path(f"/proc/{pid}/task/{pid}/children").read_text("utf-8")
        return [int(word) for word in listing.split()]
    return []


class Fleet:
    """A coordinator and agents that can be stopped, killed and disconnected."""

    def __init__(
        self,
        workspace: Workspace,
        *words: str,
        listen: str = "",
        **where: Any,  # noqa: ANN401 - as of Workspace.start
    ) -> None:
        self.workspace = workspace
        self.folder = workspace.folder / "run"
        self.address = listen or "tcp/127.0.0.1:0"
        all_words = (*words, "--out", "run", "--listen", self.address)
        self.coordinator = workspace.start("coordinator", *all_words, **where)
        wait_until(
            lambda: (self.folder / "address").exists() or self.is_over,
            "the coordinator listens",
        )
        if not listen:
            self.address = (self.folder / "address").read_text().split()[0]
        self.agents: dict[str, Process] = {}

    @property
    def is_over(self) -> bool:
        """Whether the coordinator has ended."""
        return self.coordinator.poll() is not None

    def join(self, name: str, role: str = "worker", *more: str, **where: Any) -> int:  # noqa: ANN401 - as of Workspace.start
        """Start an agent with one process and return the id of that process."""
        words = (role, "--connect", self.address, "--name", name, "--processes", "1")
        process = self.agents[name] = self.workspace.start(*words, *more, **where)
        wait_until(lambda: agent_processes(process.pid) != [], f"{name} starts")
        return agent_processes(process.pid)[0]

    def begin(self, workers: int, *, has_analyzer: bool = True) -> None:
        """Wait for this many workers; start an analyzer, so that births begin."""
        config = zenoh.Config.from_json5(client_config(self.address))
        with zenoh.open(config) as session:
            wait_until(
                lambda: len(alive(session, "worker")) >= workers,
                "all workers are there",
            )
        if has_analyzer:
            self.join("judge", "analyzer")

    @contextmanager
    def misbehaving(self, behaviour: str) -> Iterator[list[str]]:
        """Join with ``misbehaving_agent.py``; its report is in the list at the end."""
        report: list[str] = []
        agent = self.workspace.start(
            self.address, behaviour, module="tests.system.misbehaving_agent"
        )
        try:
            yield report
        finally:
            agent.terminate()
            said, _ = agent.communicate()
        report += said.split()[1:]

    def kill(self, name: str) -> None:
        """Kill an agent and the parent process that would restart it."""
        process_pool = self.agents.pop(name)
        process_pool.send_signal(signal.SIGSTOP)
        for child in agent_processes(process_pool.pid):
            os.kill(child, signal.SIGKILL)
        process_pool.send_signal(signal.SIGKILL)

    def wait_for(self, position: float) -> None:
        """Wait until the journal exceeds a size [bytes] or the run has ended."""
        wait_until(
            lambda: size(self.folder) > position or self.is_over,
            "the run is on its way",
        )

    def finish(self) -> None:
        """Wait for the end of the run; check that it succeeded."""
        wait_until(lambda: self.is_over, "the run ends")
        assert self.coordinator.returncode == 0, self.coordinator.communicate()


def make_kit(folder: Path, host: str = "127.0.0.1", **roles: MemberRole) -> Kit:
    """Make a kit with members, besides the hub, for a day."""
    kit = Kit.new(folder, ClusterKit(host, 7447, 1), utc_now)
    for name, role in roles.items():
        kit.add(name, role)
    return kit


def kit_files(kit: Path, name: str) -> Tls:
    """Return the certificate files of a member of a kit."""
    own = kit / "members" / name
    return Tls(*(str(own / file) for file in ("ca.pem", "certificate.pem", "key.pem")))


def tls_flags(tls: Tls) -> tuple[str, ...]:
    """Return the flags that name certificate files."""
    own = ("--tls-certificate", tls.certificate, "--tls-key", tls.key)
    return ("--tls-ca", tls.ca, *own)


def alive(session: zenoh.Session, role: Role) -> list[FleetMember]:
    """Return the processes of a role whose tokens a session may see, by name."""
    tokens = session.liveliness().get(key_of_all("default", role, "alive"), timeout=2.0)
    members = [member_of(str(each.ok.key_expr)) for each in tokens if each.ok]
    return sorted(members, key=lambda member: member.name)


def introduce(session: zenoh.Session, member: FleetMember, *deaths: Crash) -> Any:  # noqa: ANN401 - of Zenoh
    """Declare a queryable that says what a good agent of this machine says.

    Returns:
        The queryable, which ends with its session or with the last reference to it.
    """
    info = encode(
        AgentInfo(
            agent=member.name,
            kind=member.role,
            slots=1,
            platform=platform_tag(),
            version=wire_version(),
            deaths=deaths,
            shards=8,
        )
    )

    def tell(query: zenoh.Query) -> None:
        with query:
            query.reply(member.info, info)

    told = zenoh.handlers.Callback(tell)
    return session.declare_queryable(member.info, told, complete=True)
