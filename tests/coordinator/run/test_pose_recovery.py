"""Poses that are lost on disk: computed again from the journal, equal to before.

Everything but physics and network is real.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import tests.analyzers
from coordinator.dispatch.events import AgentKind, Joined
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.local import LocalAgents
from coordinator.run.session import RunSession
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunFolder
from coordinator.storage.folder_status import table_damages
from schema.agent.request_handler import Compute
from schema.errors import JobRefused
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.learning import Learning
from schema.tables.columns import TABLES
from schema.tables.description import RunDetails
from schema.tables.files import parquet_path, read_table
from schema.tables.segments import segment_path, segments_of
from tests.coordinator.arena_world import experiment
from tests.worker.fake_world import FakeWorld, OddWorld
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

ARENA = experiment(60, snapshot_interval_s=20.0)
TURNS = 100
"""Turns after which a run is stopped; it needs more than twice as many."""


def details_of(document: Experiment) -> RunDetails:
    return RunDetails(document.name, 0, 3, experiment_text(document))


def execute(
    path: Path,
    most: int | None = None,
    *,
    document: Experiment = ARENA,
    world: type = FakeWorld,
    platforms: tuple[str, ...] = ("any",),
    watch: Callable[[RunSession], None] = lambda _: None,
) -> bool:
    """Start or resume a run; stop it after some turns. Return whether it finished.

    There is one worker of each platform. An arena drifts if its own is not there.
    """
    held = RunFolder(path, None if path.exists() else details_of(document))
    agents: dict[AgentKind, Compute] = {
        "analyzer": tests.analyzers.answer,
        "worker": Jobs(Shards(world)).answer,
    }
    local = LocalAgents(agents, platforms[0])
    fleet = JobRouter(local, allows_drift=True)
    for other in platforms[1:]:
        local._agents[f"worker-{other}"] = Jobs(Shards(world)).answer
        fleet.tell(Joined(f"worker-{other}", "worker", 1, other))
    run = RunSession(held, fleet)
    try:
        run.start()
        turns = 0
        while not run.loop.is_finished:
            if turns == most:
                run.stop()
                return False
            watch(run)
            ends = fleet.listen(0.0, float(turns)).get(run.loop.client, ())
            run.act(float(turns), ends)
            turns += 1
        run.finish()
    finally:
        run.close()
    return True


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an undisturbed run."""
    path = tmp_path_factory.mktemp("recovery") / "finished"
    assert execute(path)
    assert read_table(path, "poses").num_rows > 1000
    return path


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that was stopped twice, with two segments of poses."""
    path = tmp_path_factory.mktemp("recovery") / "stopped"
    assert not execute(path, TURNS)
    assert not execute(path, TURNS)
    assert len(segments_of(path, "poses")) == 2
    return path


@pytest.fixture
def copy(tmp_path: Path, stopped: Path) -> Path:
    path = tmp_path / "run"
    shutil.copytree(stopped, path)
    return path


def flip(path: Path, share: float) -> None:
    """Flip a bit of a file, at a share of its length."""
    data = bytearray(path.read_bytes())
    data[int(share * len(data))] ^= 4
    path.write_bytes(data)


def test_flipped_bit_in_poses_is_computed_again(copy: Path, finished: Path) -> None:
    flip(segment_path(copy, "poses", 0), 0.5)
    seen: list[tuple[int, int]] = []

    def watch(run: RunSession) -> None:
        if run.recovery is not None:
            seen.append(run.recovery.progress)

    assert execute(copy, watch=watch)
    assert compare(finished, copy) == []
    assert seen[0][0] == 0
    assert seen == sorted(seen)
    assert len({total for _, total in seen}) == 1


@pytest.mark.parametrize("lost", ["both", "first", "second", "sums", "tail", "head"])
def test_lost_files_and_tails_are_computed_again(
    copy: Path, finished: Path, lost: str
) -> None:
    first, second = (segment_path(copy, "poses", number) for number in (0, 1))
    match lost:
        case "both":
            first.unlink()
            second.unlink()
        case "first":
            first.unlink()
        case "second":
            second.write_bytes(b"")
        case "sums":
            first.with_suffix(".sums").unlink()
        case "tail":
            second.write_bytes(second.read_bytes()[: second.stat().st_size // 3])
        case "head":
            flip(first, 0.0)
    assert execute(copy)
    assert compare(finished, copy) == []


def test_recovery_starts_at_the_newest_snapshot_if_it_may(
    copy: Path, finished: Path
) -> None:
    totals: set[int] = set()

    def watch(run: RunSession) -> None:
        if run.recovery is not None:
            totals.add(run.recovery.progress[1])

    whole = copy.with_name("whole")
    shutil.copytree(copy, whole)
    flip(segment_path(copy, "poses", 1), 0.999)
    assert execute(copy, watch=watch)
    (few,) = totals
    totals.clear()
    flip(segment_path(whole, "poses", 0), 0.999)
    assert execute(whole, watch=watch)
    (many,) = totals
    assert few < 20 < many
    assert compare(finished, copy) == compare(finished, whole) == []


def test_recovery_may_be_interrupted(copy: Path, finished: Path) -> None:
    flip(segment_path(copy, "poses", 0), 0.1)
    stops = 0
    while not execute(copy, 20):
        stops += 1
        assert stops < 50
    assert stops > 5
    assert compare(finished, copy) == []


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ("poses", "is lost"),
        *((name, "damaged") for name in ("births", "fitness", "poses", "runs")),
    ],
)
def test_damaged_table_of_a_finished_run_is_written_again(
    tmp_path: Path, finished: Path, table: str, problem: str
) -> None:
    path = tmp_path / "run"
    shutil.copytree(finished, path)
    assert table_damages(path) == []
    file = parquet_path(path, ARENA.name, 0, table)
    if problem == "damaged":
        flip(file, 0.4)
    else:
        file.unlink()
    (damage,) = table_damages(path)
    assert f"{table}.parquet: {problem}" in damage
    assert execute(path)
    assert table_damages(path) == []
    assert compare(finished, path) == []
    assert [each.suffix for each in file.parent.iterdir()] == [".parquet"] * len(TABLES)


def test_recovery_waits_for_a_worker_of_the_platform(
    copy: Path, finished: Path
) -> None:
    flip(segment_path(copy, "poses", 0), 0.5)
    waiting: list[dict[int, str]] = []
    assert not execute(
        copy, 60, platforms=("other",), watch=lambda run: waiting.append(run.waiting)
    )
    assert waiting[1:] == [{0: "any"}] * 59
    assert execute(copy)
    assert compare(finished, copy) == []


def test_worker_with_other_results_writes_no_poses(copy: Path, finished: Path) -> None:
    flip(segment_path(copy, "poses", 0), 0.5)
    with pytest.raises(JobRefused, match="results differ"):
        execute(copy, world=OddWorld)
    assert execute(copy)
    assert compare(finished, copy) == []


def test_random_flips_in_all_segments(
    tmp_path: Path, stopped: Path, finished: Path
) -> None:
    rng = np.random.default_rng(8)
    files = sorted((stopped / "segments").iterdir())
    for trial in range(12):
        path = tmp_path / str(trial)
        shutil.copytree(stopped, path)
        flip(path / "segments" / files[rng.integers(len(files))].name, rng.random())
        assert execute(path)
        assert compare(finished, path) == []


def test_several_arenas_recover_in_the_order_of_the_journal(tmp_path: Path) -> None:
    shipped = read_experiment("archipelago-arenas")
    assert shipped.arena is not None
    document = structs.replace(
        shipped,
        births=18,
        arena=structs.replace(shipped.arena, snapshot_interval_s=10.0),
        learning=Learning(learner="(1+1)-es", budget=2),
    )
    whole, path = tmp_path / "whole", tmp_path / "run"
    assert execute(whole, document=document)
    assert not execute(path, 140, document=document)
    first = read_table(path, "poses")
    assert len(set(first["island"].to_pylist())) == 4
    flip(segment_path(path, "poses", 0), 0.3)
    assert not execute(path, 100)
    # The newest snapshots are of infants in the middle of a trial.
    flip(segments_of(path, "poses")[-1][1], 0.999)
    assert execute(path)
    assert compare(whole, path) == []
    parquet_path(path, document.name, 0, "poses").unlink()
    assert execute(path)
    assert compare(whole, path) == []


def test_poses_from_before_and_after_a_drift_are_computed_again(tmp_path: Path) -> None:
    path, drifted = tmp_path / "run", tmp_path / "drifted"
    assert not execute(path, 90)
    assert execute(path, platforms=("other",))
    assert read_table(path, "drifts").num_rows == 1
    shutil.copytree(path, drifted)
    parquet_path(path, ARENA.name, 0, "poses").unlink()
    # Each part needs a worker of its own platform.
    assert not execute(path, 200, platforms=("other",))
    assert execute(path, platforms=("any", "other"))
    assert compare(drifted, path) == []
