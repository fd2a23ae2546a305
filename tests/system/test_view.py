"""Tests of ``revolve view``: recordings equal the tables, viewers affect no run."""

import signal
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from rerun.chunk import RrdReader

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from schema.tables.files import read_table

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Stage = Any
Fleet = Callable[..., Any]
Until = Callable[[Callable[[], bool], str], None]

WORDS = ("hamlet.toml", "--seed", "4", "--quiet")
CENTRES, QUATERNIONS = "Boxes3D:centers", "Boxes3D:quaternions"


def batches(file: Path, path: str) -> Iterator[tuple[pa.RecordBatch, bool]]:
    """Return the data of an entity, and whether it is static."""
    for chunk in RrdReader(file).stream().filter(content=path):
        yield chunk.to_record_batch(), chunk.is_static


def paths(file: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(file).stream()}


def poses(file: Path, path: str) -> dict[int, Any]:
    """Return centres (B, 3) by time [ns] of a robot."""
    found = {}
    for batch, _ in batches(file, path):
        if CENTRES not in batch.schema.names:
            continue
        for time, row in zip(batch["sim_time"], batch[CENTRES], strict=True):
            if row.is_valid:
                found[time.value] = np.array(row.as_py())
    return found


def clears(file: Path, path: str) -> dict[int, int]:
    """Return the time at which a robot was removed [ns], and the births by then."""
    return {
        time.value: births.as_py()
        for batch, _ in batches(file, path)
        if "Clear:is_recursive" in batch.schema.names
        for time, births, row in zip(
            batch["sim_time"],
            batch["births"],
            batch["Clear:is_recursive"],
            strict=True,
        )
        if row.is_valid
    }


def last_births(file: Path, path: str) -> int:
    """Return the births by a robot's last pose."""
    columns = [
        pa.chunked_array([batch["births"]])
        for batch, _ in batches(file, path)
        if CENTRES in batch.schema.names
    ]
    return max(int(pc.max(column).as_py()) for column in columns)


def curves(file: Path, name: str) -> dict[int, tuple[float, ...]]:
    """Return an island's curve by births."""
    return {
        births.as_py(): tuple(row.as_py())
        for batch, is_static in batches(file, f"/islands/0/{name}")
        if not is_static
        for births, row in zip(batch["births"], batch["Scalars:scalars"], strict=True)
    }


def expected_curve(folder: Path) -> dict[int, tuple[float, ...]]:
    """Return mean and best fitness by births, computed by Arrow."""
    rows = read_table(folder, "population").filter(pc.field("fitness").is_valid())
    grouped = rows.group_by("births").aggregate(
        [("fitness", "mean"), ("fitness", "max")]
    )
    return {
        row["births"]: (row["fitness_mean"], row["fitness_max"])
        for row in grouped.to_pylist()
    }


def nanoseconds(time_s: float) -> int:
    return round(time_s * 1e9)


def check_curves(file: Path, folder: Path) -> None:
    shown, expected = curves(file, "fitness"), expected_curve(folder)
    assert shown.keys() == expected.keys()
    for births, values in expected.items():
        assert shown[births] == pytest.approx(values, abs=1e-12)
    sizes = Counter(read_table(folder, "population")["births"].to_pylist())
    assert {each: (float(size),) for each, size in sizes.items()} == curves(
        file, "size"
    )


@pytest.fixture(scope="session")
def replayed(once: Any, quiet_hamlet: Path) -> Path:  # noqa: ANN401 - the fixture
    """Return a recording of a run's tables."""
    words = ("view", str(quiet_hamlet), "--save", "run.rrd")
    folder: Path = once("replay", lambda stage: stage.run(*words))
    return folder / "run.rrd"


def test_a_replay_has_each_pose_of_each_robot(
    replayed: Path, quiet_hamlet: Path
) -> None:
    table = read_table(quiet_hamlet, "poses")
    for number in sorted(set(table["birth"].to_pylist())):
        rows = table.filter(pc.field("birth") == number)
        shown = poses(replayed, f"/islands/0/robots/0-{number}")
        recorded = {
            nanoseconds(row["sim_time_s"]): (row["x"], row["y"], row["z"])
            for row in rows.select(["sim_time_s", "x", "y", "z"]).to_pylist()
        }
        assert shown.keys() == recorded.keys()
        for time, place in recorded.items():
            # One of the boxes is the core, whose centre the table has.
            apart = np.linalg.norm(shown[time] - np.array(place), axis=1)
            assert apart.min() < 1e-3


def test_dead_robots_are_cleared_at_their_death(
    replayed: Path, quiet_hamlet: Path
) -> None:
    deaths = {
        row["birth"]: nanoseconds(row["sim_time_s"])
        for row in read_table(quiet_hamlet, "deaths").to_pylist()
    }
    assert deaths
    robots = [path for path in paths(replayed) if "/robots/" in path]
    assert len(robots) == read_table(quiet_hamlet, "births").num_rows
    for path in robots:
        number = int(path.rpartition("-")[2])
        if number in deaths:
            cleared = clears(replayed, path)
            assert deaths[number] in cleared
            # On the time line of births, too, no pose comes after it.
            assert cleared[deaths[number]] >= last_births(replayed, path)
        assert not any(is_static for _, is_static in batches(replayed, path))


def test_boxes_are_logged_with_the_first_pose(replayed: Path) -> None:
    for path in sorted(each for each in paths(replayed) if "/robots/" in each):
        times = [
            time.value
            for batch, _ in batches(replayed, path)
            if "Boxes3D:half_sizes" in batch.schema.names
            for time, row in zip(
                batch["sim_time"], batch["Boxes3D:half_sizes"], strict=True
            )
            if row.is_valid
        ]
        assert min(times) == min(poses(replayed, path))


def test_curves_of_a_replay_equal_the_tables(
    replayed: Path, quiet_hamlet: Path
) -> None:
    check_curves(replayed, quiet_hamlet)


def test_the_log_contains_each_birth_and_death(
    replayed: Path, quiet_hamlet: Path
) -> None:
    lines = [
        line.as_py()[0]
        for batch, _ in batches(replayed, "/log")
        for line in batch["TextLog:text"]
    ]
    births = read_table(quiet_hamlet, "births").num_rows
    deaths = read_table(quiet_hamlet, "deaths").num_rows
    assert sum("is born" in line for line in lines) == births
    assert sum("is gone" in line for line in lines) == deaths


def test_viewers_receive_everything_and_do_not_change_the_run(
    hamlet_stage: Stage, quiet_hamlet: Path, fleet_of: Fleet, until: Until
) -> None:
    """One viewer shows the whole run; one is killed and one is frozen during it."""
    stage = hamlet_stage
    fleet = fleet_of(stage, *WORDS, "--speed", "10")
    viewers = {}
    for name in ("whole", "killed", "frozen"):
        words = ("view", "--connect", fleet.address, "--save", f"{name}.rrd")
        viewers[name] = stage.start(*words)
        file = stage.folder / f"{name}.rrd"
        until(file.exists, f"the viewer {name} has received the run")
    fleet.join("w", "worker")
    fleet.begin(1)
    fleet.wait_for(0.4 * (quiet_hamlet / NAME).stat().st_size)
    assert not fleet.is_over
    viewers["killed"].kill()
    viewers["frozen"].send_signal(signal.SIGSTOP)
    fleet.finish()
    assert not compare(fleet.folder, quiet_hamlet)
    out, err = viewers["whole"].communicate(timeout=60)
    assert viewers["whole"].returncode == 0, out + err
    assert "the run has ended" in err
    file = stage.folder / "whole.rrd"
    check_curves(file, fleet.folder)
    table = read_table(fleet.folder, "poses")
    shown = sum(len(poses(file, path)) for path in paths(file) if "/robots/" in path)
    # Best effort: but nothing is lost on a machine that keeps up.
    assert 0.9 * table.num_rows <= shown <= table.num_rows


def test_a_resimulated_robot_of_an_arena_moves_as_recorded(
    stage: Stage, quiet_hamlet: Path
) -> None:
    words = ("view", str(quiet_hamlet), "--robot", "0:3", "--robot", "best")
    out = stage.run(*words, "--save", "again.rrd")
    assert "0:3: moves as recorded, equal to the last bit" in out
    again = poses(stage.folder / "again.rrd", "/motion/0-3")
    table = read_table(quiet_hamlet, "poses").filter(pc.field("birth") == 3)
    # Brains tick more often than poses are recorded.
    assert len(again) > 1.5 * table.num_rows


def test_a_resimulated_off_line_robot_moves_as_recorded(
    stage: Stage, undisturbed: Path
) -> None:
    words = ("view", str(undisturbed), "--robot", "best", "--ancestry")
    out = stage.run(*words, "--save", "again.rrd")
    best = max(
        row["fitness"] or 0.0
        for row in read_table(undisturbed, "evaluations").to_pylist()
    )
    (line,) = [one for one in out.splitlines() if one.startswith("best ever")]
    assert line == f"best ever evaluated: {line.split()[3]} fitness {best:.4f}"
    assert "moves as recorded, equal to the last bit" in out
    assert "DIFFERS" not in out


def test_a_wrong_record_is_reported(stage: Stage, undisturbed: Path) -> None:
    folder = stage.folder / "forged"
    subprocess.run(["cp", "-r", str(undisturbed), str(folder)], check=True)
    (file,) = folder.glob("tables/*/*/evaluations.parquet")
    table = pq.ParquetFile(file).read()
    index = table.schema.get_field_index("fitness")
    fitness = pc.add(table["fitness"], 1e-9)
    pq.write_table(table.set_column(index, table.schema.field(index), fitness), file)
    out = stage.run("view", str(folder), "--robot", "0:4", "--save", "a.rrd")
    assert "0:4: DIFFERS from the record: fitness" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("view",), "give either a run folder or --connect"),
        (("view", "nowhere"), "no run found"),
        (("view", "--connect", "tcp/127.0.0.1:1"), "no coordinator at"),
        (("view", "nowhere", "--serve", "9876"), "must be HOST:PORT"),
        (("view", "nowhere", "--follow", "7"), "must be ISLAND:BIRTH"),
        (("view", "nowhere", "--save", "no/such/a.rrd"), "no such folder: no/such"),
        (("view", "nowhere", "--save", "a.txt"), "must end in .rrd"),
        (("view", "nowhere", "--ancestry"), "needs --robot best"),
        (
            ("view", "--connect", "tcp/127.0.0.1:1", "--robot", "best"),
            "a run folder only",
        ),
    ],
)
def test_invalid_flags_are_reported_in_one_line(
    stage: Stage, words: tuple[str, ...], message: str
) -> None:
    out = stage.run(*words, code=2)
    assert message in out
    assert out.count("\n") == 1
