"""Program that kills and stops processes of groups of islands until all have ended.

Arguments: a seed, a number of schedules, a number of groups, and ``machines`` or
nothing. A seed draws every kill. A killed coordinator is resumed after some time,
perhaps when the others have ended; one that is stopped goes on after some time; hub,
analyzer and worker are started again. With ``machines``, which needs root, hub, worker
and coordinators are on machines of their own with certificates; a coordinator is
resumed on any of them, cables are cut and mended, and a coordinator of each schedule is
stopped for a minute. Prints a line for each schedule, and exits with 1 if one does not
end or a repeatable column differs from the run of one coordinator.
"""

import signal
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from coordinator.cluster.kit import MemberRole
from coordinator.storage.compare import compare
from tests.system.documents import RING
from tests.system.fleet import kit_files, make_kit, size, tls_flags
from tests.system.machines import HOST, Machine, Network
from tests.system.workspace import Process, Workspace, free_address

BIRTHS = 34
LONGEST_S = 300.0
LONG_STOP_S = 60.0
MEAN_GROWTH = 0.2
"""Mean growth of the journals between two kills, as a share of the whole one."""
LONGEST_AWAY_S = 5.0
STOPPED = 0.25
"""Share of the kills of coordinators that stop one instead."""
OTHERS = 0.3
"""Share of the kills that are of hub, analyzer or worker."""
CUTS = 0.2
"""Share of the kills that cut the cable of a machine instead, if there are machines."""


class Schedule:
    """Groups of islands and their kills."""

    def __init__(
        self,
        workspace: Workspace,
        rng: np.random.Generator,
        of: int,
        network: ExitStack,
    ) -> None:
        """Start hub, analyzer and worker; the stack closes their network."""
        self.workspace, self.rng = workspace, rng
        self.folders = [workspace.folder / f"group-{number}" for number in range(of)]
        self.kills = self.cuts = 0
        self.hosts: tuple[Machine, ...] = ()
        self.network = network
        self.owes_long_stop = False
        self.prepare()
        self.others = {role: self.start_other(role) for role in self.words}
        self.absent: dict[str, float] = {}
        self.cut: dict[Machine, float] = {}
        self.running: dict[int, Process] = {}
        self.due_s = dict.fromkeys(range(of), 0.0)

    def prepare(self) -> None:
        """Choose the words of commands."""
        address = free_address()
        agent = ("--connect", address, "--processes", "1")
        self.words = {"hub": ("--listen", address), "analyzer": agent, "worker": agent}
        self.address = address

    def start_other(self, role: str) -> Process:
        """Start hub, analyzer or worker."""
        return self.workspace.start(role, *self.words[role])

    def place(self) -> tuple[tuple[str, ...], str]:
        """Return certificate flags for a coordinator, and its network namespace."""
        return (), ""

    def live(self, whole: int) -> bool:
        """Kill and resume until all groups have ended; return whether they have."""
        until_s = time.monotonic() + LONGEST_S
        next_size = 0.0
        while (self.running or self.due_s) and time.monotonic() < until_s:
            time.sleep(0.05)  # polling interval
            now_s = time.monotonic()
            for number in [each for each, at_s in self.due_s.items() if at_s <= now_s]:
                del self.due_s[number]
                self.start(number)
            for number, process in list(self.running.items()):
                if process.poll() is not None:
                    del self.running[number]
                    told = (self.workspace.folder / f"{number}.log").read_text()[-2000:]
                    assert process.returncode == 0, told
            for role in [each for each, at_s in self.absent.items() if at_s <= now_s]:
                del self.absent[role]
                self.others[role] = self.start_other(role)
            for host in [each for each, at_s in self.cut.items() if at_s <= now_s]:
                del self.cut[host]
                host.reconnect()
            if self.running and sum(map(size, self.folders)) >= next_size:
                until = now_s + self.rng.uniform(0.0, LONGEST_AWAY_S)
                kind = self.rng.random()
                if kind < OTHERS:
                    self.kill_other(str(self.rng.choice(sorted(self.words))), until)
                elif self.hosts and kind < OTHERS + CUTS:
                    host = self.hosts[self.rng.integers(len(self.hosts))]
                    self.cuts += 1
                    self.cut[host] = max(until, self.cut.get(host, 0.0))
                    host.cut()
                else:
                    self.kill(int(self.rng.choice(sorted(self.running))), until)
                grown = self.rng.exponential(MEAN_GROWTH * whole)
                next_size = sum(map(size, self.folders)) + grown
        return not (self.running or self.due_s)

    def start(self, number: int) -> None:
        """Start, resume or continue the coordinator of a group."""
        if (process := self.running.get(number)) is not None:
            process.send_signal(signal.SIGCONT)
            return
        folder = self.folders[number]
        flags, space = self.place()
        where = ("--connect", self.address, "--give-up-after", "200", "--quiet", *flags)
        words: tuple[str, ...] = ("resume", str(folder), *where)
        if not (folder / "run.json").exists():
            births = ("x.toml", "--seed", "3", "--births", str(BIRTHS))
            group = ("--group", f"{number}/{len(self.folders)}", "--out", str(folder))
            words = ("coordinator", *births, *group, *where)
        log = self.workspace.folder / f"{number}.log"
        self.running[number] = self.workspace.start(*words, log=log, inside=space)

    def kill_other(self, role: str, until_s: float) -> None:
        """Kill hub, analyzer or worker; it comes back at some time."""
        self.kills += 1
        self.absent[role] = until_s
        self.others[role].kill()
        self.others[role].wait()

    def kill(self, number: int, until_s: float) -> None:
        """Kill or stop a coordinator for some time."""
        self.kills += 1
        if self.owes_long_stop:
            until_s = time.monotonic() + LONG_STOP_S
        self.due_s[number] = until_s
        if self.owes_long_stop or self.rng.random() < STOPPED:
            self.owes_long_stop = False
            self.running[number].send_signal(signal.SIGSTOP)
        else:
            process = self.running.pop(number)
            process.kill()
            process.wait()


class OnMachines(Schedule):
    """Groups of islands on machines of their own."""

    def prepare(self) -> None:
        """Connect machines, and give them certificates."""
        names = [f"c{number}" for number in range(len(self.folders) + 1)]
        network = Network(self.workspace, ("hub", "w", *names))
        self.machines = self.network.enter_context(network)
        roles: dict[str, MemberRole] = {
            "worker": "worker", "analyzer": "analyzer",
            **dict.fromkeys(names, "coordinator"),
        }  # fmt: skip
        kit = make_kit(self.workspace.folder / "lab", HOST, **roles).folder
        self.flags = {name: tls_flags(kit_files(kit, name)) for name in ("hub", *roles)}
        self.address = f"tls/{HOST}:7447"
        agent = ("--connect", self.address, "--processes", "1")
        access = ("--access", str(kit / "access.json"))
        self.words = {
            "hub": ("--listen", self.address, *access, *self.flags["hub"]),
            "analyzer": (*agent, *self.flags["analyzer"]),
            "worker": (*agent, *self.flags["worker"]),
        }
        self.spaces = {"hub": "hub", "analyzer": "hub", "worker": "w"}
        self.coordinators = names
        self.hosts = tuple(self.machines[name] for name in ("w", *names))
        self.owes_long_stop = True

    def start_other(self, role: str) -> Process:
        space = self.machines[self.spaces[role]].space
        return self.workspace.start(role, *self.words[role], inside=space)

    def place(self) -> tuple[tuple[str, ...], str]:
        name = str(self.rng.choice(self.coordinators))
        return self.flags[name], self.machines[name].space


def main(seed: int, schedules: int, of: int, *where: str) -> int:
    """Execute schedules; return the exit code."""
    code = 0
    kind = OnMachines if where == ("machines",) else Schedule
    with tempfile.TemporaryDirectory() as name:
        whole = Workspace(Path(name)).finished(RING, BIRTHS, "whole")
        for number in range(schedules):
            rng = np.random.default_rng([seed, number])
            place = Path(name) / str(number)
            place.mkdir()
            (place / "x.toml").write_text(RING)
            workspace = Workspace(place)
            with ExitStack() as network, ExitStack() as told:
                told.callback(workspace.clear)
                schedule = kind(workspace, rng, of, network)
                has_ended = schedule.live(size(whole))
                groups = schedule.folders[0].parent
                found = compare(whole, groups) if has_ended else ["hung"]
                if not found:
                    told.pop_all()
                    for process, _ in workspace._started:
                        process.kill()
                        process.wait()
            outcome = ", ".join(found) or "equal"
            counts = f"{schedule.kills} kills, {schedule.cuts} cuts"
            sys.stderr.write(f"{number}: {counts}: {outcome}\n")
            code |= bool(found)
            if found:
                return code
    return code


if __name__ == "__main__":
    seed, schedules, of = map(int, sys.argv[1:4])
    sys.exit(main(seed, schedules, of, *sys.argv[4:]))
