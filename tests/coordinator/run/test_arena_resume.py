"""Arena whose coordinator is killed at any point of its work and resumed.

Everything but the physics is real: arena, loop, shards, analyzer, journal, tables and
snapshots.
"""

import re
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import tests.analyzers
from coordinator.dispatch.events import DispatchEvent, Returned
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.local import LocalAgents
from coordinator.run.archipelago import archipelago
from coordinator.run.loop import Loop
from coordinator.run.operators import reply_to
from coordinator.run.run_context import RunContext
from coordinator.run.throttle import RealTimeThrottle
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunFolder
from coordinator.storage.journal import NAME, Journal
from coordinator.storage.recorder import Recorder
from coordinator.storage.snapshots import Snapshots
from schema.errors import JobRefused, RunFolderError
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_text
from schema.experiment.learning import Learning
from schema.robot.brain import Brain, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.description import RunDetails
from schema.tables.files import read_table
from schema.wire.arena_state import ArenaState, state_digest
from schema.wire.codec import encode
from schema.wire.operator import (
    InsertRobot,
    OperatorAction,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
)
from tests.coordinator.arena_world import experiment
from tests.worker.fake_world import FakeWorld, OddWorld
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

EXPERIMENT = experiment(30, snapshot_interval_s=20.0, wall_diameter_m=20.0)
INFANCY = replace(
    experiment(20, snapshot_interval_s=20.0),
    learning=Learning(learner="(1+1)-es", budget=2),
)
DETAILS = RunDetails("resume", 0, 3, experiment_text(EXPERIMENT))

Point = Callable[[str], None]
"""Called with the name of what is about to be done, and of what was."""


class Killed(BaseException):
    """Simulated death of the coordinator."""


class Fuse:
    """Kills the coordinator at the n-th call of one method, or of any."""

    def __init__(self, after: int, name: str = "") -> None:
        self.left = after
        self.name = name

    def __call__(self, name: str) -> None:
        if self.name in ("", name):
            self.left -= 1
            if self.left < 0:
                raise Killed


class Frail:
    """Wrapper that dies before or after each call of some methods."""

    def __init__(self, inner: object, point: Point, *names: str) -> None:
        self._inner, self._point, self._names = inner, point, names

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute
        found = getattr(self._inner, name)
        if name not in self._names:
            return found

        def call(*arguments: object) -> object:
            self._point(f"before {name}")
            result = found(*arguments)
            self._point(f"after {name}")
            return result

        return call


def frail(inner: object, point: Point, *names: str) -> Any:  # noqa: ANN401 - any class
    """Return a wrapper in place of what it wraps."""
    return Frail(inner, point, *names)


class Run:
    """One coordinator process of a run, and a worker that may outlive it."""

    def __init__(
        self,
        path: Path,
        stack: ExitStack,
        point: Point,
        **other: Any,  # noqa: ANN401 - the loop's
    ) -> None:
        document = other.pop("document", EXPERIMENT)
        details = replace(DETAILS, document=experiment_text(document))
        known = None if (path / NAME).exists() else details
        folder = stack.enter_context(RunFolder(path, known))
        journal = stack.enter_context(Journal.open(path))
        self.rows = Recorder(path, details)
        stack.callback(self.rows.close)
        shards = other.pop("shards", None) or Shards(FakeWorld)
        worker = other.pop("worker", Jobs(shards).answer)
        agents = {"analyzer": tests.analyzers.answer, "worker": worker}
        islands = archipelago(document, DETAILS.seed, DETAILS.run)
        self.arena: Any = islands[0]
        platform = other.pop("platform", "any")
        self.fleet = JobRouter(
            other.pop("agents", LocalAgents)(agents, platform),
            allows_drift=other.pop("allows_drift", False),
        )
        self.rows.poses = frail(self.rows.poses, point, "store")
        self.loop = Loop(
            islands,
            context=RunContext.of("resume", folder.epoch, document, DETAILS.origin),
            fleet=self.fleet,
            log=frail(journal, point, "append"),
            rows=self.rows,
            snapshot_store=frail(Snapshots(path), point, "write", "drop_before"),
            **other,
        )
        self.loop.start(journal.replay())

    def turn(self, now_s: float) -> None:
        ends = self.fleet.listen(0.0, now_s)
        self.loop.act(now_s, ends.get(self.loop.client, ()))

    def ask(self, action: OperatorAction, name: str = "x") -> str:
        reply = reply_to(OperatorRequest(name, 0, action), self.loop)
        return f"refused: {reply.text}" if reply.is_refused else reply.text


def run(path: Path, point: Point = lambda _: None, **other: Any) -> bool:  # noqa: ANN401 - the loop's
    """Start or resume until the end or a kill; return whether the run ended."""
    with ExitStack() as stack:
        try:
            one = Run(path, stack, point, **other)
            turns = 0
            while not one.loop.is_finished:
                one.turn(float(turns))
                turns += 1
                if turns % 7 == 0:
                    one.rows.flush()
        except Killed:
            return False
        one.rows.finish()
        return True


def test_a_run_leaves_all_its_tables(calm: Path) -> None:
    sizes = {
        name: read_table(calm, name).num_rows
        for name in ("births", "fitness", "poses", "population", "deaths")
    }
    assert min(sizes.values()) > 0, sizes
    assert sizes["births"] == EXPERIMENT.births
    kept = sorted(path.name for path in (calm / "snapshots").iterdir())
    assert len(kept) == 1


@pytest.mark.parametrize(
    "name",
    [
        "before store", "after store", "before append", "after append",
        "before write", "after write", "after drop_before",
    ],
)  # fmt: skip
def test_killed_between_any_two_steps(tmp_path: Path, calm: Path, name: str) -> None:
    path = tmp_path / "run"
    assert not run(path, Fuse(3, name))
    while not run(path, Fuse(2, name)):
        pass
    assert compare(calm, path) == []


def kill_repeatedly(path: Path, seed: int, document: Experiment) -> None:
    """Kill and resume a run to its end."""
    rng, shards, kills = np.random.default_rng(seed), Shards(FakeWorld), 0
    # A worker that outlives its coordinators, or a new one each time.
    while not run(
        path,
        Fuse(int(rng.integers(20, 120))),
        shards=shards if seed % 2 else None,
        document=document,
    ):
        kills += 1
    assert kills >= 3


@pytest.mark.parametrize("seed", range(3))
def test_killed_again_and_again(tmp_path: Path, calm: Path, seed: int) -> None:
    kill_repeatedly(tmp_path / "run", seed, EXPERIMENT)
    assert compare(calm, tmp_path / "run") == []


def test_killed_while_newborns_learn(tmp_path: Path) -> None:
    assert run(tmp_path / "calm", document=INFANCY)
    kill_repeatedly(tmp_path / "killed", 4, INFANCY)
    assert compare(tmp_path / "calm", tmp_path / "killed") == []
    rows = read_table(tmp_path / "calm", "learning")
    assert rows.num_rows >= 15 * 2
    assert rows.num_rows - rows["robot"].null_count >= 10


class Mortal(LocalAgents):
    """Workers that die at times with all their state; another one takes over."""

    left = 5

    def receive(self, timeout_s: float, pause_s: float = 0.0, /) -> list[DispatchEvent]:
        """Die after every fifth job of a worker."""
        news: list[DispatchEvent] = []
        for event in super().receive(timeout_s, pause_s):
            if isinstance(event, Returned) and event.agent == "local-worker":
                self.left -= 1
                if self.left == 0:
                    self.left = 5
                    self._agents["local-worker"] = Jobs(Shards(FakeWorld)).answer
                    news.append(Returned(event.number, event.agent, "lost"))
                    continue
            news.append(event)
        return news


@pytest.mark.parametrize(
    "other", [{"agents": Mortal}, {"throttle": RealTimeThrottle(2.0)}]
)
def test_lost_states_and_a_throttle_change_nothing(
    tmp_path: Path, calm: Path, other: dict[str, Any]
) -> None:
    path = tmp_path / "run"
    assert run(path, **other)
    assert compare(calm, path) == []


def test_worker_that_computes_other_results_stops_the_run(
    tmp_path: Path, calm: Path
) -> None:
    path = tmp_path / "run"
    assert not run(path, Fuse(150))
    with pytest.raises(JobRefused, match="results differ"):
        run(path, shards=Shards(OddWorld))
    assert run(path)
    assert compare(calm, path) == []


def test_run_resumes_without_lost_snapshots(tmp_path: Path, calm: Path) -> None:
    path = tmp_path / "run"
    assert not run(path, Fuse(200))
    for file in (path / "snapshots").iterdir():
        file.unlink()
    assert run(path)
    assert compare(calm, path) == []


def ordered(path: Path, point: Point) -> list[str]:
    """Run with an operator's orders until the end or a kill."""
    said: list[str] = []
    with ExitStack() as stack:
        try:
            one = Run(path, stack, point)
            turns = 0
            while not one.loop.is_finished:
                # By what the arena has come to, so that all runs order alike.
                living = [each.birth for each in one.arena.population]
                if one.arena.step == 12000 and not one.arena.is_paused:
                    genome = one.arena.population[1].genome
                    guest = one.arena.encoding.robot_of(genome)
                    said.append(one.ask(RemoveRobot(living[0]), "remove"))
                    said.append(one.ask(InsertRobot(guest, (0.5, 1.5)), "insert"))
                    said.append(one.ask(PauseArena(), "pause"))
                    said.append(one.ask(SaveSnapshot()))
                elif one.arena.is_paused:
                    said.append(one.ask(ResumeArena(), "resume"))
                one.turn(float(turns))
                turns += 1
        except Killed:
            return said
        one.rows.finish()
    return said


def test_orders_are_repeated_in_a_replay(tmp_path: Path, calm: Path) -> None:
    undisturbed = tmp_path / "undisturbed"
    said = ordered(undisturbed, lambda _: None)
    assert said[:3] == ["takes effect at 60 s"] * 3
    assert said[-1] == "takes effect at 60 s"
    assert (undisturbed / "tables").is_dir()
    assert compare(calm, undisturbed) != []
    deaths = read_table(undisturbed, "deaths")
    assert "removed" in deaths["reason"].to_pylist()
    births = read_table(undisturbed, "births")
    assert (0.5, 1.5) in zip(
        births["x"].to_pylist(), births["y"].to_pylist(), strict=True
    )
    killed = tmp_path / "killed"
    while not (killed / "tables").is_dir():
        ordered(killed, Fuse(60))
    assert compare(undisturbed, killed) == []


INVALID: list[tuple[OperatorAction, str]] = [
    (RemoveRobot(BirthId(0, 999)), "birth 999: is not alive"),
    (InsertRobot(Robot((Part("Barrow", -1, -1, -1, 0, ()),))), "Barrow"),
    (
        InsertRobot(Robot((Part("Core", -1, -1, -1, 0, ()),)), (8, 6)),
        "place: must be inside the wall, < 10 m from the centre, got 8 6",
    ),
]


def test_invalid_orders_are_refused_and_not_journalled(tmp_path: Path) -> None:
    with ExitStack() as stack:
        one = Run(tmp_path / "run", stack, lambda _: None)
        before = (tmp_path / "run" / NAME).stat().st_size
        for action, why in INVALID:
            for _ in range(2):
                assert re.match(f"refused: .*{why}", one.ask(action))
        assert reply_to(OperatorRequest("x", 7, PauseArena()), one.loop).is_refused
        assert (tmp_path / "run" / NAME).stat().st_size == before


def test_orders_that_stop_the_run_or_have_no_effect_are_refused(tmp_path: Path) -> None:
    """A robot outside ``[space]``, a place too far away, the brain of another body."""
    with ExitStack() as stack:
        one = Run(tmp_path / "run", stack, lambda _: None, document=experiment(30))
        while len(one.arena.population) < 5:
            one.turn(0.0)
        births = [each.birth for each in one.arena.population]
        living = [each.robot for each in one.arena.living]
        first = living[0]
        other = next(
            each for each in living if each.brain.neurons != first.brain.neurons
        )
        output = next(each for each in first.brain.neurons if each.layer == "output")
        hidden = Neuron("hidden", output.kind, 0, output.parameters)
        least = [each for each in first.brain.neurons if each.layer != "hidden"]
        fat = Robot(first.parts, Brain((*least, *[hidden] * 11)))
        before = (tmp_path / "run" / NAME).stat().st_size
        most = "refused: robot: the robot has 11 hidden, outside space.max_hidden = 10"
        assert one.ask(InsertRobot(fat)) == most
        assert one.ask(SetBrain(births[0], fat)) == most
        far = "refused: place: must be < 1e+06 m from the centre, got 1e+11 0"
        assert one.ask(InsertRobot(first, (1e11, 0.0))) == far
        misfit = one.ask(SetBrain(births[0], other))
        assert misfit.startswith("refused: brain: ")
        assert (tmp_path / "run" / NAME).stat().st_size == before
        near = InsertRobot(first, (9e5, 0.0))
        assert one.ask(near, "near").startswith("takes effect")
        brain = SetBrain(births[0], first)
        assert one.ask(brain, "brain").startswith("takes effect")


def test_missing_snapshot_is_named(tmp_path: Path) -> None:
    snapshots = Snapshots(tmp_path)
    five, nine, two, other = (
        encode(ArenaState(bytes(32), step, (), (), ())) for step in (5, 9, 2, 7)
    )
    snapshots.write(0, 5, five)
    snapshots.write(0, 9, nine)
    snapshots.write(1, 2, two)
    snapshots.write(1, 3, two[:-1])
    snapshots.drop_before(0, 9)
    again = Snapshots(tmp_path)
    kept = [(0, 5, five), (0, 9, nine), (1, 2, two), (1, 2, other), (1, 3, two)]
    found = [again.has(shard, step, state_digest(data)) for shard, step, data in kept]
    assert found == [False, True, True, False, False]
    assert again.read(0, 9) == nine
    with pytest.raises(RunFolderError, match=r"island-0-5\.bin: is missing: resume"):
        again.read(0, 5)


def test_another_platform_continues_an_arena_if_allowed(
    tmp_path: Path, calm: Path
) -> None:
    """Each death is recorded once, in every continuation."""
    path = tmp_path / "run"
    assert not run(path, Fuse(60))
    other: dict[str, Any] = {"platform": "other", "allows_drift": True}
    lives = 0
    while not run(path, Fuse(100), shards=Shards(OddWorld), **other):
        lives += 1
    assert lives > 1
    unequal = ["record", "seed", "run_id"]
    (drift,) = read_table(path, "drifts").drop_columns(unequal).to_pylist()
    assert drift.pop("step") > 0
    words = {"before": "any", "after": "other", "worker": "local-worker"}
    assert drift == {"island": 0, **words}
    births = read_table(path, "births")["birth"].to_pylist()
    assert sorted(births) == list(range(EXPERIMENT.births))
    assert "births" in {line.partition(":")[0] for line in compare(calm, path)}


def test_drift_that_is_not_in_the_journal_has_no_effect(
    tmp_path: Path, calm: Path
) -> None:
    """The snapshot exists, and the old platform reaches that step later."""
    path = tmp_path / "run"
    assert not run(path, Fuse(60))
    other: dict[str, Any] = {"platform": "other", "allows_drift": True}
    assert not run(path, Fuse(0, "after write"), shards=Shards(OddWorld), **other)
    assert len(list((path / "snapshots").iterdir())) == 1
    # Each life has to rebuild the state.
    while not run(path, Fuse(5, "after append")):
        pass
    assert compare(calm, path) == []
