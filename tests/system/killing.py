"""Program that kills the processes of runs until it has killed enough of them.

Arguments: ``instants`` or ``fleet``, numbers of coordinator and of worker kills, a
seed, and experiment documents, which take turns. A seed draws every kill. The first run
of each document is undisturbed; each other one is resumed after every kill of its
coordinator, and compared with the first when it is finished. Prints a line for each
run, and one of JSON at the end: kills by kind, kills per run, and the differences.

``instants``: coordinators without a network, killed at an instant of ``instants.py`` or
after some CPU time. Before a kill in the recovery of poses the segment is cut, as a
power loss does.

``fleet``: coordinators at a hub, with two analyzer and three worker processes that
their pools restart; arenas are divided over the workers. Kills of workers hit
analyzers, too. All kills are at sizes of the journal or times after the last kill. Some
coordinators are killed together with all agents, and some find cut poses when they
resume. Some agents are stopped instead: they keep their connection and are silent until
the next kill of an agent, which is theirs.
"""

from tests.system import warm  # first: it prepares the process before NumPy's import

# isort: split
import json
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, suppress
from itertools import islice
from math import isqrt
from pathlib import Path

import numpy as np

from tests.system.fleet import agent_processes, size
from tests.system.instants import JOURNAL, RECOVERY, Instants
from tests.system.killed_runs import (
    FLAGS,
    Reference,
    Tally,
    check,
    cut_poses,
    log_of,
    undisturbed,
    words_of,
)

WHILE_RUNNING = 10
"""Kills of a run, at most, before those at its end."""
AT_THE_END = 5
PROCESSES = 3
BY_TIME = "by CPU time"
MOST_RESTORED = 24
"""Most advances that a recovery repeats before it is killed, times eight."""
BY_JOURNAL = 0.7
"""Share of the kills of a fleet that are at a size of the journal."""
MEAN_GROWTH = 0.04
"""Mean growth of the journal between these kills, as a share of a whole one."""
TOGETHER = 0.2
"""Share of the kills of a coordinator that are of all workers, too."""
STOPPED = 0.2
"""Share of the kills of a worker that stop one."""
LONGEST_WAIT_S = 0.3
"""Longest time from a kill to one of the others [s]."""


class InstantKills:
    """Kills of coordinators without a network."""

    def __init__(self, tally: Tally, rng: np.random.Generator) -> None:
        self._tally = tally
        self._rng = rng
        self._decks: dict[tuple[str, ...], list[str]] = {}

    def run(self, reference: Reference, folder: Path, left: Counter[str]) -> None:
        """Execute a run with kills, and compare it; see ``FleetKills.run``."""
        kills, before = 0, ""
        for kind, number in islice(self._plan(reference), left["coordinator"]):
            # A recovery that was killed is resumed, or begins again with less.
            is_new = before != RECOVERY or self._rng.random() < 0.5
            share = self._rng.uniform(0.0, 0.5)
            if kind == RECOVERY and is_new and not cut_poses(folder, share):
                continue
            before = kind
            if self._attempt(reference, folder, kind, number) is not None:
                break
            kills += 1
            left["coordinator"] -= 1
            self._tally.kills[kind] += 1
        else:
            code = self._attempt(reference, folder, "", 0)
            assert code == 0
        check(reference, folder, self._tally, kills)

    def _plan(self, reference: Reference) -> Iterator[tuple[str, int]]:
        """Draw the kind of each kill, and the number of the instant."""
        running = dict(reference.running)
        running[BY_TIME] = running[JOURNAL]
        if reference.has_poses:
            running[RECOVERY] = MOST_RESTORED
        for _ in range(WHILE_RUNNING):
            kind = self._deal(running)
            # Soon enough for the others to hit the same run.
            yield kind, 1 + int(self._rng.integers(-(-running[kind] // 8)))
        for _ in range(AT_THE_END):
            kind = self._deal(dict.fromkeys(reference.ending, 1))
            yield kind, 1 + int(self._rng.integers(reference.ending[kind]))

    def _deal(self, counts: Mapping[str, int]) -> str:
        """Return a kind from a deck in which frequent kinds occur more than once.

        So all kinds come up, which independent draws do not guarantee.
        """
        deck = self._decks.setdefault(tuple(counts), [])
        if not deck:
            deck += [kind for kind, n in counts.items() for _ in range(isqrt(n))]
            self._rng.shuffle(deck)
        return deck.pop()

    def _attempt(
        self, reference: Reference, folder: Path, kind: str, number: int
    ) -> int | None:
        """Run or resume once; return the exit code, or None if it was killed."""
        rng = self._rng
        # The ends of a change are instants of their own.
        share = float(np.clip(rng.uniform(-0.5, 1.5), 0.0, 1.0))
        instants = Instants(kind, number, share, [])
        words = [*words_of(reference.document, folder), *FLAGS]
        child = warm.start(words, log_of(folder), instants.install)
        limit_s = rng.uniform(0.0, 0.15) * reference.cpu_s
        code = None
        if kind == BY_TIME:
            while cpu_s(child) < limit_s and (code := warm.ended(child)) is None:
                time.sleep(0.0005)  # polling interval
            code = warm.kill(child) if code is None else code
        else:
            code = warm.wait(child, log_of(folder))
        assert code in (0, -signal.SIGKILL), warm.tail(log_of(folder))
        return None if code else code


def cpu_s(process: int) -> float:
    """Return the CPU time of a process [s]; see clock_getcpuclockid(3)."""
    return time.clock_gettime((~process << 3) | 2)


class FleetKills:
    """Kills of coordinators and workers at a hub."""

    def __init__(self, tally: Tally, rng: np.random.Generator) -> None:
        self._tally = tally
        self._rng = rng
        self._stack = ExitStack()
        # The path of a socket must be short.
        short = tempfile.TemporaryDirectory(prefix="hub")
        self._address = f"unixsock-stream/{self._stack.enter_context(short)}/hub"
        self._log = Path("fleet.log")
        self._stopped: int | None = None
        self._start("hub", "--listen", self._address)
        warm.wait_for("listening on ", self._log)
        flags = ("--connect", self._address, "--processes")
        self._pools = (
            self._start("analyzer", *flags, "2"),
            self._start("worker", *flags, str(PROCESSES)),
        )

    def _start(self, *words: str) -> int:
        child = warm.start(list(words), self._log)
        self._stack.callback(warm.kill, child)
        return child

    def close(self) -> None:
        if self._stopped is not None:
            self._signal(self._stopped, signal.SIGKILL)
        self._stack.close()

    def run(self, reference: Reference, folder: Path, left: Counter[str]) -> None:
        """Execute a run with kills, and compare it."""
        kills = 0
        child = self._resume(reference, folder)
        while (code := self._wait(child, reference, folder, left)) is None:
            role = self._draw(left)
            if role == "coordinator":
                code = warm.kill(child)
                if code == 0:
                    break
                assert code == -signal.SIGKILL, warm.tail(log_of(folder))
                if self._rng.random() < TOGETHER:
                    for agent in self._agents:
                        self._signal(agent, signal.SIGKILL)
                if self._rng.random() < 0.2:
                    cut_poses(folder, self._rng.uniform(0.2, 0.9))
                child = self._resume(reference, folder)
            elif not self._kill_worker():
                continue
            kills += 1
            left[role] -= 1
            self._tally.kills[role] += 1
        assert code == 0, warm.tail(log_of(folder))
        check(reference, folder, self._tally, kills)

    def _resume(self, reference: Reference, folder: Path) -> int:
        words = [*words_of(reference.document, folder), "--quiet"]
        if "[arena]" in Path(reference.document).read_text("utf-8"):
            words += ["--arena-workers", str(PROCESSES)]
        return warm.start([*words, "--connect", self._address], log_of(folder))

    @property
    def _agents(self) -> list[int]:
        return [agent for pool in self._pools for agent in agent_processes(pool)]

    def _draw(self, left: Counter[str]) -> str:
        """Return the role of the next process to kill."""
        share = left["coordinator"] / left.total()
        return "coordinator" if self._rng.random() < share else "worker"

    def _kill_worker(self) -> bool:
        """Kill or stop a worker or an analyzer; return whether there was one."""
        agents = self._agents
        if not agents:
            return False
        agent, how = agents[self._rng.integers(len(agents))], signal.SIGKILL
        if self._stopped in agents:
            agent = self._stopped
        elif self._rng.random() < STOPPED:
            self._stopped, how = agent, signal.SIGSTOP
        return self._signal(agent, how)

    @staticmethod
    def _signal(agent: int, number: signal.Signals) -> bool:
        """Send a signal to a worker process; return whether it was there."""
        with suppress(ProcessLookupError):
            os.kill(agent, number)
            return True
        return False

    def _wait(
        self, child: int, reference: Reference, folder: Path, left: Counter[str]
    ) -> int | None:
        """Wait for the next kill; return the exit code if the run ends before it."""
        if not left.total():
            return warm.wait(child, log_of(folder))
        rng, now_s = self._rng, time.monotonic()
        due_s = enough = np.inf
        if rng.random() < BY_JOURNAL:
            enough = size(folder) + rng.exponential(MEAN_GROWTH) * reference.size
        else:
            due_s = now_s + rng.uniform(0.0, LONGEST_WAIT_S)
        while time.monotonic() < due_s and size(folder) < enough:
            code = warm.ended(child)
            if code is not None:
                return code
            if time.monotonic() > now_s + warm.PATIENCE_S:
                warm.kill(child)
                raise TimeoutError(
                    f"{folder} stands still:\n{warm.tail(log_of(folder))}"
                )
            time.sleep(0.001)  # polling interval
        return None


def main(mode: str, kills: Counter[str], seed: int, documents: list[str]) -> Tally:
    """Make the kills; return the results."""
    tally, rng = Tally(), np.random.default_rng(seed)
    references = [undisturbed(document) for document in documents]
    most = {role: -(-number // len(documents)) for role, number in kills.items()}
    left = kills.copy()
    with ExitStack() as stack:
        execute = InstantKills(tally, rng).run
        if mode == "fleet":
            execute = stack.enter_context(closing(FleetKills(tally, rng))).run
        while len(tally.per_run) < len(documents) or left.total():
            number = len(tally.per_run)
            reference = references[number % len(references)]
            wanted = Counter({role: min(left[role], most[role]) for role in left})
            left -= wanted
            execute(reference, Path(f"{reference.folder}-{number}"), wanted)
            left += wanted
            sys.stdout.write(
                f"{reference.folder}-{number}: {tally.per_run[-1]} kills\n"
            )
    return tally


if __name__ == "__main__":
    began_s = time.monotonic()
    wanted = Counter(coordinator=int(sys.argv[2]), worker=int(sys.argv[3]))
    found = main(sys.argv[1], wanted, int(sys.argv[4]), sys.argv[5:])
    seconds = round(time.monotonic() - began_s, 1)
    sys.stdout.write(json.dumps({**vars(found), "seconds": seconds}) + "\n")
