"""CPU time of the coordinators that share an archipelago, without physics.

``python -m tests.benchmarks.group_cost`` runs a ring of eight islands on one, two and
four coordinators, beside one hub, one analyzer and workers that answer at once. It
prints the CPU time per birth of all coordinators together: the difference between a
long run and a short one, so that their start does not count. While they run it asks
for their progress, and prints how often each group worked, or waited for migrants.
"""

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from coordinator.network.client_service import asking
from coordinator.storage.compare import compare
from schema.agent.address import new_socket
from schema.agent.network import DEFAULT_FLEET, Agent
from schema.agent.supervisor import ProcessPool, prepare_process
from schema.errors import NetworkError
from schema.wire.codec import encode
from schema.wire.operator import GetStatus, OperatorRequest, decode_operator_reply
from tests import analyzers, null_workers
from tests.system.workspace import Process, Workspace

RING = """
name = "ring"
births = {births}
[selection]
population = 15
children = 15
[[islands]]
count = 8
[migration]
topology = "ring"
epoch = 60
"""
SHORT, LONG = 90, 690
"""Births of each of the eight islands."""
_LOOK_S = 0.1
# How to ask whether a process has ended, so that its CPU time can be read later.
_ALIVE = os.WEXITED | os.WNOHANG | os.WNOWAIT

_say = partial(print, flush=True)


def run(place: Path, births: int, groups: int) -> tuple[float, list[str]]:
    """Run the ring; return the coordinators' CPU time [s], and lines of a trace."""
    place.mkdir()
    (place / "ring.toml").write_text(RING.format(births=births))
    address = new_socket()
    with ExitStack() as stack:
        workspace = Workspace(place)
        hub = workspace.start("hub", "--listen", address, log=place / "hub.log")
        stack.callback(hub.wait)
        stack.callback(hub.terminate)
        agent = Agent("worker", "null", address)
        judge = Agent("analyzer", "judge", address)
        coordinators = [
            # New interpreters, as only a child's CPU time can be waited for.
            workspace.start_command(
                *(sys.executable, "-m", "revolve"),
                *("coordinator", "ring.toml", "--seed", "1", "--quiet"),
                *("--group", f"{number}/{groups}", "--out", f"all/group-{number}"),
                *("--connect", address, "--give-up-after", "60"),
                log=place / f"{number}.log",
            )
            for number in range(groups)
        ]
        for body, own in (
            (null_workers.process, agent),
            (analyzers.process, judge),
        ):
            stack.enter_context(ProcessPool(body, (own,), size=1, role=own.role))
        trace = watch(address, coordinators)
        cpu_s = sum(ended(each) for each in coordinators)
    return cpu_s, trace


def ended(process: Process) -> float:
    """Wait for a process; return its CPU time [s]."""
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_utime + used.ru_stime


def watch(address: str, processes: list[Process]) -> list[str]:
    """Ask for the progress of groups until they have ended; return what they did."""
    seen: dict[int, Counter[str]] = {}
    question = encode(OperatorRequest("trace", 0, GetStatus()))
    with ExitStack() as stack:
        ask = None
        while any(os.waitid(os.P_PID, each.pid, _ALIVE) is None for each in processes):
            time.sleep(_LOOK_S)  # interval of the trace
            try:
                if ask is None:
                    asker = asking(address, fleet=DEFAULT_FLEET, tls=None)
                    ask = stack.enter_context(asker)
                answers = ask(question)
            except NetworkError:
                continue
            for data in answers.values():
                status = decode_operator_reply(data).status
                for one in () if status is None else status.runs:
                    left = [each for each in one.islands if each.births < each.wanted]
                    done = "finished islands"
                    if left:
                        waits = all(each.awaited for each in left)
                        done = "waits for migrants" if waits else "works"
                    seen.setdefault(one.group.number, Counter())[done] += 1
    return [f"group {number}: {dict(seen[number])}" for number in sorted(seen)]


def main(turns: int, most: int) -> None:
    """Measure in turns; print the results."""
    with tempfile.TemporaryDirectory() as name:
        for turn in range(turns):
            costs: dict[int, float] = {}
            for groups in [each for each in (1, 2, 4) if each <= most]:
                cpu_s, trace = dict[int, float](), list[str]()
                for births in (SHORT, LONG):
                    place = Path(name) / f"{turn}-{groups}-{births}"
                    cpu_s[births], trace = run(place, births, groups)
                costs[groups] = (cpu_s[LONG] - cpu_s[SHORT]) / (8 * (LONG - SHORT))
                whole = Path(name) / f"{turn}-1-{LONG}" / "all" / "group-0"
                assert groups == 1 or compare(whole, place / "all") == []
                _say(
                    f"{groups} groups: {1e3 * costs[groups]:.3f} ms CPU per birth, "
                    f"{costs[groups] / costs[1]:.2f} x one group"
                )
                for line in trace:
                    _say(f"  {line}")


if __name__ == "__main__":
    flags = argparse.ArgumentParser(description=__doc__)
    flags.add_argument("--turns", type=int, default=3)
    flags.add_argument("--most", type=int, default=4)
    prepare_process()  # before the first session is opened
    main(**vars(flags.parse_args()))
