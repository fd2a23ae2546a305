"""Machines on one switch, which network namespaces simulate.

Each machine has a network, a home directory and a runtime directory of its own; all
share the test's files. Making them needs the rights of root.
"""

import os
import re
import shutil
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import pytest

from tests.system.workspace import Workspace, runtime_directory, wait_until

DOMAIN = "example"
_NET = "10.231.78"
HOST = f"{_NET}.1"
"""Address of the first machine of a network."""
_NAMES = Path("/etc/netns")
"""Folder from which ``ip netns exec`` takes the files that replace those in /etc."""
_SOURCE = '. "$HOME/.config/revolve/env" && exec "$@"'


def ip(words: str) -> None:
    """Run ``ip``."""
    done = subprocess.run(
        ["ip", *words.split()], capture_output=True, text=True, check=False
    )
    if "not permitted" in done.stderr:
        raise PermissionError(f"ip {words}: {done.stderr.strip()}")
    assert done.returncode == 0, f"ip {words}: {done.stderr}"


@dataclass(frozen=True)
class Running:
    """A process of a machine, and the file that gets its output."""

    process: subprocess.Popen[str]
    log: Path

    @property
    def text(self) -> str:
        """Everything that the process has written."""
        return self.log.read_text("utf-8", "replace")

    def wait_for(self, text: str, times: int = 1) -> None:
        """Wait until the process has written a text."""
        wait_until(
            lambda: self.text.count(text) >= times or self.process.poll() is not None,
            f"{self.process.args!r} writes {text!r}",
        )
        assert self.text.count(text) >= times, self.text

    def end(self, code: int = 0) -> str:
        """Wait until the process ends; return what it has written."""
        wait_until(lambda: self.process.poll() is not None, f"{self.process.args!r}")
        assert self.process.returncode == code, self.text
        return self.text


@dataclass(frozen=True)
class Machine:
    """A machine that is connected to the switch.

    Attributes:
        name: its name, with ``.example`` its host name.
        space: its network namespace.
        home: home directory.
        runtime: runtime directory, by a path that is short enough for sockets.
        workspace: starts its processes.
    """

    name: str
    space: str
    home: Path
    runtime: str
    workspace: Workspace

    def start(self, *words: str, sources: bool = True) -> "Running":
        """Start ``revolve`` in a shell that has read ``~/.config/revolve/env``."""
        return self.command(*(sys.executable, "-m", "revolve", *words), sources=sources)

    def command(self, *words: str, sources: bool = False) -> "Running":
        """Start any command of this machine; see ``start``."""
        shell = ("sh", "-c", _SOURCE, "sh") if sources else ()
        home = str(self.home)
        words = tuple(re.sub("^~", home, word) for word in words)
        log = self.home / f"{len(list(self.home.glob('*.log')))}.log"
        process = self.workspace.start_command(
            *("ip", "netns", "exec", self.space, *shell, *words),
            folder=self.home,
            environment={"HOME": home, "XDG_RUNTIME_DIR": self.runtime},
            log=log,
        )
        return Running(process, log)

    def install(self, folder: Path) -> None:
        """Copy a member's folder of a kit, as docs/cluster.md says."""
        target = self.home / ".config" / "revolve"
        shutil.copytree(folder, target, dirs_exist_ok=True)

    def cut(self) -> None:
        """Disconnect the machine from the switch."""
        ip(f"-n {self.space} link set wire down")

    def reconnect(self) -> None:
        """Connect the machine to the switch again."""
        ip(f"-n {self.space} link set wire up")


class Network:
    """A switch and its machines; use it in a ``with``."""

    def __init__(self, workspace: Workspace, names: tuple[str, ...]) -> None:
        self.machines: dict[str, Machine] = {}
        self.workspace = workspace
        self._names = names
        self._switch = f"revolve-{os.getpid()}-switch"
        self._opened = ExitStack()

    def __enter__(self) -> Self:
        """Connect the machines; skip the test where the kernel does not permit it."""
        try:
            self._connect()
        except PermissionError as error:
            pytest.skip(f"the kernel refuses network namespaces: {error}")
        return self

    def _connect(self) -> None:
        with ExitStack() as opened:
            self._space(opened, self._switch)
            ip(f"-n {self._switch} link add lan type bridge")
            ip(f"-n {self._switch} link set lan up")
            hosts = "127.0.0.1 localhost\n"
            for number, name in enumerate(self._names, 1):
                hosts += f"{_NET}.{number} {name}.{DOMAIN}\n"
            for number, name in enumerate(self._names, 1):
                self.machines[name] = self._machine(opened, name, number, hosts)
            self._opened = opened.pop_all()

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def __getitem__(self, name: str) -> Machine:
        return self.machines[name]

    def slow_down(self, name: str, *, delay_s: float, loss: float) -> None:
        """Put a slow and lossy cable between a machine and the switch."""
        machine, number = self.machines[name], list(self._names).index(name) + 1
        ip(f"-n {machine.space} link del wire")
        # The kernel's own "tc netem" is not in every kernel.
        cable = self.workspace.start_command(
            sys.executable,
            str(Path(__file__).with_name("slow_cable.py")),
            *(self._switch, f"p{number}", machine.space, "wire"),
            *(str(delay_s), str(loss), "7"),
        )
        assert cable.stdout is not None
        assert cable.stdout.readline() == "connected\n"
        ip(f"-n {self._switch} link set p{number} master lan up")
        ip(f"-n {machine.space} addr add {_NET}.{number}/24 dev wire")
        ip(f"-n {machine.space} link set wire up")

    def _machine(
        self, opened: ExitStack, name: str, number: int, hosts: str
    ) -> Machine:
        space = f"revolve-{os.getpid()}-{name}"
        self._space(opened, space)
        files = _NAMES / space
        files.mkdir(parents=True)
        opened.callback(shutil.rmtree, files)
        (files / "hosts").write_text(hosts)
        ip(f"-n {self._switch} link add p{number} type veth peer wire netns {space}")
        ip(f"-n {self._switch} link set p{number} master lan up")
        ip(f"-n {space} addr add {_NET}.{number}/24 dev wire")
        ip(f"-n {space} link set wire up")
        home = self.workspace.folder / name
        home.mkdir()
        return Machine(name, space, home, runtime_directory(home), self.workspace)

    @staticmethod
    def _space(opened: ExitStack, name: str) -> None:
        ip(f"netns add {name}")
        opened.callback(ip, f"netns del {name}")
        ip(f"-n {name} link set lo up")


NEEDS_ROOT = pytest.mark.skipif(
    not (shutil.which("ip") and os.geteuid() == 0 and Path("/dev/net/tun").exists()),
    reason="makes network namespaces and TAP devices: needs ip and root",
)
