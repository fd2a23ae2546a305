"""Workers that never answer, and arenas that share workers."""

import sys
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any, cast

import pytest

import analyzer.service
import worker.serve.service
from coordinator.dispatch.events import AgentKind
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.service import Network
from coordinator.run.session import RunSession
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunFolder
from schema.experiment.file import experiment_text, read_experiment
from schema.limits import ADVANCE_REQUEST_BYTES
from schema.tables.description import RunDetails
from schema.wire.arena import AdvanceShard
from schema.wire.codec import decode
from schema.wire.messages import Request
from tests.benchmarks.dispatch_bench import Body, real_fleet
from tests.system.documents import HAMLET
from tests.system.fleet import Fleet, advances
from tests.system.silent_agents import silent_agents
from tests.system.workspace import Workspace

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]


def test_arena_of_a_silent_worker_continues_on_an_idle_one(
    small_arena_workspace: Workspace, small_arena_run: Path
) -> None:
    fleet = Fleet(small_arena_workspace, *HAMLET)
    with fleet.misbehaving("silent") as report:
        fleet.join("one")
        fleet.begin(workers=2)
        fleet.finish()
    # It sent its late answer when the job was cancelled.
    assert report == ["1"]
    assert compare(small_arena_run, fleet.folder) == []
    agents = [each.provenance.agent[:3] for each in advances(fleet.folder)]
    first = agents.index("one")
    assert first >= 3
    assert agents == ["odd"] * first + ["one"] * (len(agents) - first)
    said = fleet.coordinator.stderr.read()
    assert said.count("has not answered for") == 1
    assert "takes its job" in said


FORTY = """
name = "forty"
births = 6
[selection]
population = 5
[simulation]
warmup_steps = 200
window_steps = 400
[arena]
birth_interval_s = 4.0
cull_interval_s = 8.0
sample_interval_s = 4.0
snapshot_interval_s = 100.0
[[islands]]
count = 40
"""


# One birth at a time, so that each waits for its own jobs.
LIVELY = """
name = "lively"
births = 30
[selection]
population = 1
parents = "none"
window = 1
"""


def bodies(workers: int) -> dict[AgentKind, tuple[Body, int]]:
    """Return what the processes of a fleet with one analyzer run."""
    return {
        "worker": (worker.serve.service.process, workers),
        "analyzer": (analyzer.service.process, 1),
    }


def longest_stall_s(folder: Path, document: str, fleet: JobRouter) -> float:
    """Run an experiment to its end; return the longest time without a birth [s]."""
    (folder / "mine.toml").write_text(document)
    experiment = read_experiment(str(folder / "mine.toml"))
    details = RunDetails(experiment.name, 0, 1, experiment_text(experiment))
    run = RunSession(RunFolder(folder / "run", details), fleet)
    longest_s, births = 0.0, -1
    run.start()
    changed_s = began_s = time.monotonic()
    while not run.loop.is_finished:
        now_s = time.monotonic()
        assert now_s - began_s < 200.0
        ends = fleet.listen(0.2, now_s)
        run.loop.act(now_s, ends.get(run.loop.client, ()))
        now_s, born = time.monotonic(), run.status(0.0).births
        longest_s = max(longest_s, now_s - changed_s)
        if born != births:
            births, changed_s = born, now_s
    run.close()
    return longest_s


@pytest.mark.parametrize(
    ("workers", "analyzers", "most_s"), [(4, 0, 10.0), (0, 2, 5.0)]
)
def test_each_silent_agent_costs_an_offline_run_a_small_delay(
    workers: int, analyzers: int, most_s: float, tmp_path: Path
) -> None:
    lines: list[str] = []
    with ExitStack() as stack:
        fleet = stack.enter_context(real_fleet(bodies(workers=1)))
        fleet._warn = lines.append
        address = cast("Network", fleet._agents).own_address
        taken = stack.enter_context(silent_agents(address, workers))
        vets = stack.enter_context(silent_agents(address, analyzers, "analyzer"))
        while fleet.dispatch.agents("worker") < 1 + workers or (
            fleet.dispatch.agents("analyzer") < 1 + analyzers
        ):
            fleet.listen(0.1, time.monotonic())
        stall_s = longest_stall_s(tmp_path, LIVELY, fleet)
    # The first job went to each of them in turn.
    assert (len(taken) >= workers, len(vets) >= analyzers) == (True, True)
    assert 1.0 < stall_s <= most_s
    assert lines
    assert all("has not answered for" in each for each in lines)
    assert all(each.startswith("a-silent-") for each in lines)


class Counting:
    """Agents of a fleet; counts the advances that rebuild a state."""

    def __init__(self, fleet: JobRouter) -> None:
        self.rebuilt = 0
        self._agents = fleet._agents
        fleet._agents = self

    def send(self, number: int, agent: str, payload: bytes, wait_s: float, /) -> None:
        work = decode(Request, payload, ADVANCE_REQUEST_BYTES).work
        if isinstance(work, AdvanceShard):
            self.rebuilt += work.rebuild is not None and work.from_step > 0
        self._agents.send(number, agent, payload, wait_s)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - of the real one
        return getattr(self._agents, name)


def test_forty_arenas_on_two_workers_are_never_rebuilt(tmp_path: Path) -> None:
    with real_fleet(bodies(workers=2)) as fleet:
        agents = Counting(fleet)
        longest_stall_s(tmp_path, FORTY, fleet)
    made = advances(tmp_path / "run")
    assert len(made) >= 3 * 40
    assert agents.rebuilt == 0
    arenas = Counter(
        agent for _, agent in {(e.island, e.provenance.agent) for e in made}
    )
    assert sorted(arenas.values()) == [20, 20]
