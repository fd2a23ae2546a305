"""Benchmarks of the viewer: its CPU time, and its effect on a run."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from analysis.viewer.blueprint import layout
from analysis.viewer.recording import Recording
from analysis.viewer.scene import scene_of
from analysis.viewer.show import Show
from analysis.viewer.watch import LiveView
from schema.experiment.document import ArenaSection, Experiment
from schema.experiment.file import read_experiment
from schema.experiment.identity import NO_IDENTITY
from schema.experiment.settings import EvaluationSettings
from schema.limits import LIVE_BYTES
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Live
from schema.wire.codec import decode, encode
from schema.wire.poses import PoseArrays
from schema.wire.updates import Birth, Update
from worker.arena.replay import alone
from worker.bench.spider import spider

pytestmark = pytest.mark.benchmark

ROBOTS, HERTZ, ADVANCE_S = 30, 5, 5
MINUTES = 3
PAIRS = 2
ARENA = """
name = "watched"
births = 25
[selection]
population = 12
[arena]
birth_interval_s = 6.0
"""


def report(line: str) -> None:
    sys.stdout.write(f"\n{line}")


def moving_spiders() -> tuple[Update, list[pa.Table]]:
    """Return the births of 30 spiders and a table of simulated poses per advance."""
    experiment = read_experiment("scenario1")
    settings = EvaluationSettings(
        space=experiment.space,
        simulation=experiment.simulation,
        fitness=experiment.fitness,
    )
    robot = spider()
    _, motion = alone(robot, settings, NO_IDENTITY)
    rng = np.random.default_rng(1)
    starts = rng.integers(0, motion.num_rows, ROBOTS)
    places = rng.uniform(-2.0, 2.0, (ROBOTS, 2)).astype(np.float32)
    births = tuple(
        Birth(BirthId(0, number), (), 1, number + 1, 0.0, robot.parts)
        for number in range(ROBOTS)
    )
    update = Update("run", 1, 1, is_whole=True, experiment="watched", births=births)
    rows = ADVANCE_S * HERTZ
    tables = []
    for first in range(0, MINUTES * 60 * HERTZ, rows):
        parts = []
        for number in range(ROBOTS):
            index = (starts[number] + first + np.arange(rows)) % motion.num_rows
            own = motion.take(index)
            times = (first + np.arange(rows)) / HERTZ
            values = {
                "birth": pa.array(np.full(rows, number)),
                "sim_time_s": pa.array(times),
                "x": pa.array(own["x"].to_numpy() + places[number, 0]),
                "y": pa.array(own["y"].to_numpy() + places[number, 1]),
            }
            for name, column in values.items():
                at = own.schema.get_field_index(name)
                own = own.set_column(at, own.schema.field(name), column)
            parts.append(own)
        tables.append(pa.concat_tables(parts))
    return update, tables


CORE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def message(poses: pa.Table) -> bytes:
    rows = poses.combine_chunks()
    angles = rows["angles"].combine_chunks()
    arrays = PoseArrays(
        islands=rows["island"].to_numpy(),
        births=rows["birth"].to_numpy(),
        times_s=rows["sim_time_s"].to_numpy(),
        cores=np.stack([rows[name].to_numpy() for name in CORE], axis=1),
        joints=angles.value_lengths().to_numpy(),
        angles=angles.flatten().to_numpy(),
    )
    advance = Advance(1, bytes(32), (), (), (), arrays.message())
    return encode(Live("run", 0, advance))


def test_viewer_of_an_arena_of_thirty_uses_at_most_a_fifth_of_a_core(
    tmp_path: Path,
) -> None:
    """Measure the viewer's CPU time per simulated second at real time."""
    update, tables = moving_spiders()
    messages = [message(poses) for poses in tables]
    file = tmp_path / "watched.rrd"
    scene = scene_of(Experiment(name="watched", arena=ArenaSection()))
    with Recording("watched", layout(scene), file=file) as recording:
        view = LiveView(Show(recording, scene.space), "run", scene)
        view.tell([update])
        began = time.process_time()
        for data in messages:
            view.tell([decode(Live, data, LIVE_BYTES)])
        recording.flush()
        used_s = time.process_time() - began
    share = used_s / (60.0 * MINUTES)
    hour_mb = file.stat().st_size * 60.0 / MINUTES / 1e6
    report(f"viewer: {100 * share:.1f} % of a core; {hour_mb:.0f} MB an hour")
    assert share <= 0.20
    assert hour_mb <= 350.0


@pytest.fixture
def arena(tmp_path: Path) -> Path:
    (tmp_path / "watched.toml").write_text(ARENA)
    return tmp_path


def start(folder: Path, core: int, *words: str) -> subprocess.Popen[bytes]:
    """Start a command and pin it and its children to one core."""
    top = str(Path(__file__).parents[2])
    process = subprocess.Popen(
        [sys.executable, "-m", "revolve", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": top},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.sched_setaffinity(process.pid, {core})
    return process


def run(folder: Path, out: str, *, is_watched: bool) -> float:
    """Return the time of a run from its first birth [s]; viewer on another core."""
    cores = sorted(os.sched_getaffinity(0))
    words = ("watched.toml", "--seed", "2", "--quiet", "--out", out)
    listen = ("--listen", "tcp/127.0.0.1:0")
    process_pool = [start(folder, cores[0], "coordinator", *words, *listen)]
    address = folder / out / "address"
    wait_for(address.exists)
    connect = ("--connect", address.read_text().split()[0])
    recording = folder / f"{out}.rrd"
    viewer: subprocess.Popen[bytes] | None = None
    if is_watched:
        viewer = start(folder, cores[-1], "view", *connect, "--save", recording.name)
        wait_for(recording.exists)
    process_pool += [
        start(folder, cores[0], role, *connect, "--processes", "1")
        for role in ("worker", "analyzer")
    ]
    journal = folder / out / "journal.bin"
    wait_for(lambda: journal.stat().st_size > 10_000)
    began = time.perf_counter()
    assert process_pool[0].wait(300) == 0
    took_s = time.perf_counter() - began
    for process in process_pool[1:]:
        process.send_signal(signal.SIGINT)
        process.wait(60)
    if viewer is not None:
        assert viewer.wait(60) == 0
        assert recording.stat().st_size > 100_000
    return took_s


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < deadline, "the run never got going"
        time.sleep(0.002)  # polling interval


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs two cores")
def test_viewer_does_not_slow_down_a_run(arena: Path) -> None:
    """Repeat the same run alternately without and with a viewer."""
    alone_s, watched_s = [], []
    for pair in range(PAIRS):
        alone_s.append(run(arena, f"alone-{pair}", is_watched=False))
        watched_s.append(run(arena, f"watched-{pair}", is_watched=True))
    ratio = min(alone_s) / min(watched_s)
    report(
        f"unwatched {', '.join(f'{each:.2f}' for each in alone_s)} s, watched "
        f"{', '.join(f'{each:.2f}' for each in watched_s)} s, speed ratio {ratio:.3f}"
    )
    assert ratio >= 0.97
