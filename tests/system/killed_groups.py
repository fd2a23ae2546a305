"""Program that kills and stops processes of groups of islands until all have ended.

Arguments: a seed, a number of schedules, and a number of groups. A seed draws every
kill. A killed coordinator is resumed after some time, perhaps when the others have
ended; one that is stopped goes on after some time; hub, analyzer and worker are
started again. A coordinator that starts without a hub ends, and is started again.
Prints a line for each schedule, and exits with 1 if one does not end or a repeatable
column differs from the run of one coordinator.
"""

import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from coordinator.storage.compare import compare
from tests.system.documents import RING
from tests.system.fleet import size
from tests.system.workspace import Process, Workspace, free_address

BIRTHS = 34
LONGEST_S = 240.0
MEAN_GROWTH = 0.2
"""Mean growth of the journals between two kills, as a share of the whole one."""
LONGEST_AWAY_S = 5.0
STOPPED = 0.25
"""Share of the kills of coordinators that stop one instead."""
OTHERS = 0.3
"""Share of the kills that are of hub, analyzer or worker."""


class Schedule:
    """Groups of islands and their kills."""

    def __init__(self, workspace: Workspace, rng: np.random.Generator, of: int) -> None:
        self.workspace, self.rng = workspace, rng
        self.folders = [workspace.folder / f"group-{number}" for number in range(of)]
        address = free_address()
        self.where = ("--connect", address, "--quiet")
        agent = ("--connect", address, "--processes", "1")
        self.words = {"hub": ("--listen", address), "analyzer": agent, "worker": agent}
        self.others = {
            role: workspace.start(role, *self.words[role]) for role in self.words
        }
        self.absent: dict[str, float] = {}
        self.running: dict[int, Process] = {}
        self.due_s = dict.fromkeys(range(of), 0.0)
        self.kills = 0

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
                    if told.rstrip().endswith(f"no hub at {self.where[1]}"):
                        self.due_s[number] = now_s + 1.0
                    else:
                        assert process.returncode == 0, told
            for role in [each for each, at_s in self.absent.items() if at_s <= now_s]:
                del self.absent[role]
                self.others[role] = self.workspace.start(role, *self.words[role])
            if self.running and sum(map(size, self.folders)) >= next_size:
                until = now_s + self.rng.uniform(0.0, LONGEST_AWAY_S)
                if self.rng.random() < OTHERS:
                    self.kill_other(str(self.rng.choice(sorted(self.words))), until)
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
        words: tuple[str, ...] = ("resume", str(folder), *self.where)
        if not (folder / "run.json").exists():
            births = ("x.toml", "--seed", "3", "--births", str(BIRTHS))
            group = ("--group", f"{number}/{len(self.folders)}", "--out", str(folder))
            words = ("coordinator", *births, *group, *self.where)
        log = self.workspace.folder / f"{number}.log"
        self.running[number] = self.workspace.start(*words, log=log)

    def kill_other(self, role: str, until_s: float) -> None:
        """Kill hub, analyzer or worker; it comes back at some time."""
        self.kills += 1
        self.absent[role] = until_s
        self.others[role].kill()
        self.others[role].wait()

    def kill(self, number: int, until_s: float) -> None:
        """Kill or stop a coordinator for some time."""
        self.kills += 1
        self.due_s[number] = until_s
        if self.rng.random() < STOPPED:
            self.running[number].send_signal(signal.SIGSTOP)
        else:
            process = self.running.pop(number)
            process.kill()
            process.wait()


def main(seed: int, schedules: int, of: int) -> int:
    """Execute schedules; return the exit code."""
    code = 0
    with tempfile.TemporaryDirectory() as name:
        whole = Workspace(Path(name)).finished(RING, BIRTHS, "whole")
        for number in range(schedules):
            rng = np.random.default_rng([seed, number])
            place = Path(name) / str(number)
            place.mkdir()
            (place / "x.toml").write_text(RING)
            workspace = Workspace(place)
            schedule = Schedule(workspace, rng, of)
            has_ended = schedule.live(size(whole))
            found = (
                compare(whole, schedule.folders[0].parent) if has_ended else ["hung"]
            )
            outcome = ", ".join(found) or "equal"
            sys.stderr.write(f"{number}: {schedule.kills} kills: {outcome}\n")
            code |= bool(found)
            if found:
                workspace.clear()
                return code
            for process, _ in workspace._started:
                process.kill()
    return code


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
