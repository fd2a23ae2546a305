"""Tests of ``revolve view``: recordings equal tables, viewers do not affect runs."""

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
from msgspec.structs import replace
from PIL import Image, ImageSequence
from rerun.chunk import RrdReader

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from schema.errors import rounded
from schema.tables.checksums import digest_of
from schema.tables.description import description_text, read_description
from schema.tables.files import read_table
from tests.system.workspace import Until

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Workspace = Any
Fleet = Callable[..., Any]

WORDS = ("hamlet.toml", "--seed", "4", "--quiet")
CENTRES = "Boxes3D:centers"


def batches(file: Path, path: str) -> Iterator[tuple[pa.RecordBatch, bool]]:
    """Yield the record batches of an entity, and whether each is static."""
    for chunk in RrdReader(file).stream().filter(content=path):
        yield chunk.to_record_batch(), chunk.is_static


def paths(file: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(file).stream()}


def poses(file: Path, path: str) -> dict[int, Any]:
    """Return the centres (B, 3) of a robot's boxes by time [ns]."""
    found = {}
    for batch, _ in batches(file, path):
        if CENTRES not in batch.schema.names:
            continue
        for time, row in zip(batch["sim_time"], batch[CENTRES], strict=True):
            if row.is_valid:
                found[time.value] = np.array(row.as_py())
    return found


def clears(file: Path, path: str) -> dict[int, int]:
    """Return the number of births at each removal of a robot, by time [ns]."""
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
    """Return the number of births at the last pose of a robot."""
    columns = [
        pa.chunked_array([batch["births"]])
        for batch, _ in batches(file, path)
        if CENTRES in batch.schema.names
    ]
    return max(int(pc.max(column).as_py()) for column in columns)


def curves(file: Path, name: str) -> dict[int, tuple[float, ...]]:
    """Return a curve of island 0 by number of births."""
    return {
        births.as_py(): tuple(row.as_py())
        for batch, is_static in batches(file, f"/islands/0/{name}")
        if not is_static
        for births, row in zip(batch["births"], batch["Scalars:scalars"], strict=True)
    }


def expected_curve(folder: Path) -> dict[int, tuple[float, ...]]:
    """Return mean and best fitness by births, computed with pyarrow."""
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
def replayed(once: Any, small_arena_run: Path) -> Path:  # noqa: ANN401 - the fixture
    """Return the recording of a replay of the small arena."""
    words = ("view", str(small_arena_run), "--save", "run.rrd")
    folder: Path = once("replay", lambda workspace: workspace.run(*words))
    return folder / "run.rrd"


def test_replay_contains_each_pose_of_each_robot(
    replayed: Path, small_arena_run: Path
) -> None:
    table = read_table(small_arena_run, "poses")
    for number in sorted(set(table["birth"].to_pylist())):
        rows = table.filter(pc.field("birth") == number)
        shown = poses(replayed, f"/islands/0/robots/0-{number}")
        recorded = {
            nanoseconds(row["sim_time_s"]): (row["x"], row["y"], row["z"])
            for row in rows.select(["sim_time_s", "x", "y", "z"]).to_pylist()
        }
        assert shown.keys() == recorded.keys()
        for time, position in recorded.items():
            # One of the boxes is the core, whose centre is in the table.
            distances = np.linalg.norm(shown[time] - np.array(position), axis=1)
            assert distances.min() < 1e-3


def test_dead_robots_are_cleared_at_their_death(
    replayed: Path, small_arena_run: Path
) -> None:
    deaths = {
        row["birth"]: nanoseconds(row["sim_time_s"])
        for row in read_table(small_arena_run, "deaths").to_pylist()
    }
    assert deaths
    robots = [path for path in paths(replayed) if "/robots/" in path]
    assert len(robots) == read_table(small_arena_run, "births").num_rows
    for path in robots:
        number = int(path.rpartition("-")[2])
        if number in deaths:
            cleared = clears(replayed, path)
            assert deaths[number] in cleared
            # On the timeline of births, too, no pose follows the removal.
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
    replayed: Path, small_arena_run: Path
) -> None:
    check_curves(replayed, small_arena_run)


def test_log_contains_each_birth_and_death(
    replayed: Path, small_arena_run: Path
) -> None:
    lines = [
        line.as_py()[0]
        for batch, _ in batches(replayed, "/log")
        for line in batch["TextLog:text"]
    ]
    births = read_table(small_arena_run, "births").num_rows
    deaths = read_table(small_arena_run, "deaths").num_rows
    assert sum("is born" in line for line in lines) == births
    assert sum("is gone" in line for line in lines) == deaths


def test_viewers_receive_everything_and_do_not_change_the_run(
    small_arena_workspace: Workspace,
    small_arena_run: Path,
    fleet_of: Fleet,
    until: Until,
) -> None:
    """Start three viewers; kill one and stop another during the run."""
    workspace = small_arena_workspace
    fleet = fleet_of(workspace, *WORDS, "--speed", "10")
    viewers = {}
    for name in ("whole", "killed", "frozen"):
        words = ("view", "--connect", fleet.address, "--save", f"{name}.rrd")
        viewers[name] = workspace.start(*words)
        file = workspace.folder / f"{name}.rrd"
        until(file.exists, f"the viewer {name} has received the run")
    fleet.join("w", "worker")
    fleet.begin(1)
    fleet.wait_for(0.4 * (small_arena_run / NAME).stat().st_size)
    assert not fleet.is_over
    viewers["killed"].kill()
    viewers["frozen"].send_signal(signal.SIGSTOP)
    fleet.finish()
    assert not compare(fleet.folder, small_arena_run)
    out, err = viewers["whole"].communicate(timeout=60)
    assert viewers["whole"].returncode == 0, out + err
    assert "the run has ended" in err
    file = workspace.folder / "whole.rrd"
    check_curves(file, fleet.folder)
    table = read_table(fleet.folder, "poses")
    shown = sum(len(poses(file, path)) for path in paths(file) if "/robots/" in path)
    # Delivery is best effort: a machine that is fast enough loses no poses.
    assert 0.9 * table.num_rows <= shown <= table.num_rows


def test_a_film_of_an_arena_has_a_picture_for_each_recorded_time(
    workspace: Workspace, small_arena_run: Path
) -> None:
    times = pc.unique(read_table(small_arena_run, "poses")["sim_time_s"]).to_pylist()
    times = [time_s for time_s in sorted(times) if 3.0 <= time_s <= 6.0]
    words = ("--save", "arena.gif", "--from", "3", "--until", "6")
    out = workspace.run("view", str(small_arena_run), *words)
    assert f"saved arena.gif: {times[0]:g} to {times[-1]:g} s at 2 times" in out
    with Image.open(workspace.folder / "arena.gif") as film:
        durations = [each.info["duration"] for each in ImageSequence.Iterator(film)]
    # Pictures that are equal are stored once.
    step_ms = 1000 * (times[1] - times[0]) / 2
    assert sum(durations) == pytest.approx(step_ms * len(times))
    assert len(durations) > len(times) // 2


def test_an_off_line_run_has_no_film(workspace: Workspace, undisturbed: Path) -> None:
    words = ("view", str(undisturbed), "--save", "robots.gif")
    done = workspace.run(*words, code=2)
    assert f"{undisturbed}: the run has no arena; for the film of a robot use: " in done


def test_resimulated_robot_of_an_arena_moves_as_recorded(
    workspace: Workspace, small_arena_run: Path
) -> None:
    words = ("view", str(small_arena_run), "--robot", "3", "--robot", "best")
    out = workspace.run(*words, "--save", "again.rrd")
    assert "0:3: moves as recorded, equal to the last bit" in out
    again = poses(workspace.folder / "again.rrd", "/motion/0-3")
    table = read_table(small_arena_run, "poses").filter(pc.field("birth") == 3)
    # Brain steps are more frequent than recorded poses.
    assert len(again) > 1.5 * table.num_rows


def test_resimulated_off_line_robot_moves_as_recorded(
    workspace: Workspace, undisturbed: Path
) -> None:
    words = ("view", str(undisturbed), "--robot", "best-ever", "--ancestry")
    out = workspace.run(*words, "--save", "again.rrd")
    best = max(
        row["fitness"] or 0.0
        for row in read_table(undisturbed, "evaluations").to_pylist()
    )
    (line,) = [one for one in out.splitlines() if one.startswith("best ever")]
    assert line == f"best ever: {line.split()[2]} fitness {rounded(best)}"
    assert "moves as recorded, equal to the last bit" in out
    assert "DIFFERS" not in out


def test_wrong_record_is_reported(workspace: Workspace, undisturbed: Path) -> None:
    folder = workspace.folder / "forged"
    subprocess.run(["cp", "-r", str(undisturbed), str(folder)], check=True)
    (file,) = folder.glob("tables/*/*/evaluations.parquet")
    table = pq.ParquetFile(file).read()
    index = table.schema.get_field_index("fitness")
    fitness = pc.add(table["fitness"], 1e-9)
    pq.write_table(table.set_column(index, table.schema.field(index), fitness), file)
    # A forger with access to the folder also replaces the digest.
    known = read_description(folder)
    digests = {**known.digests, "evaluations": digest_of(file)}
    text = description_text(replace(known, digests=digests))
    (folder / "run.json").write_text(text)
    out = workspace.run("view", str(folder), "--robot", "0:4", "--save", "a.rrd")
    assert "0:4: DIFFERS from the record: fitness" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("view", "x", "--connect", "hub"), "give either a run folder or --connect"),
        (
            ("view", "nowhere", "--save", "a.rrd"),
            "nowhere: no such folder",
        ),
        (
            ("view", "--connect", "tcp/127.0.0.1:1", "--save", "a.rrd"),
            "no hub at",
        ),
        (("view", "nowhere", "--serve", "9876"), "must be HOST:PORT"),
        (("view", "nowhere", "--follow", "x"), "must be BIRTH or ISLAND:BIRTH"),
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
    workspace: Workspace, words: tuple[str, ...], message: str
) -> None:
    out = workspace.run(*words, code=2)
    assert message in out
    assert out.count("\n") == 1
