"""Tests of ``revolve view``: recordings equal tables, viewers do not affect runs."""

import signal
import subprocess
from collections import Counter
from collections.abc import Iterator
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
from tests.system.fleet import Fleet
from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system


WORDS = ("hamlet.toml", "--seed", "4", "--quiet")
CENTRES = "Boxes3D:centers"


def chunks(file: Path, path: str) -> Iterator[Any]:
    """Return the chunks of an entity."""
    yield from RrdReader(file).stream().filter(content=path)


def rows(file: Path, path: str, component: str) -> Iterator[tuple[int, int, Any]]:
    """Yield time [ns], births and value of each row of an entity with a component."""
    for chunk in chunks(file, path):
        batch = chunk.to_record_batch()
        if chunk.is_static or component not in batch.schema.names:
            continue
        columns = [
            batch[name].cast(pa.int64()).to_pylist()
            if name in batch.schema.names
            else [0] * batch.num_rows
            for name in ("sim_time", "births")
        ]
        for time, births, value in zip(
            *columns, batch[component].to_pylist(), strict=True
        ):
            if value is not None:
                yield time, births, value


def paths(file: Path) -> set[str]:
    return {str(chunk.entity_path) for chunk in RrdReader(file).stream()}


def poses(file: Path, path: str) -> dict[int, Any]:
    """Return the centres (B, 3) of a robot's boxes by time [ns]."""
    return {time: np.array(centres) for time, _, centres in rows(file, path, CENTRES)}


def curves(file: Path, name: str) -> dict[int, tuple[float, ...]]:
    """Return a curve of island 0 by number of births."""
    found = rows(file, f"/islands/0/{name}", "Scalars:scalars")
    return {births: tuple(values) for _, births, values in found}


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
        own = table.filter(pc.field("birth") == number)
        path = f"/islands/0/robots/0-{number}"
        shown = poses(replayed, path)
        times = [round(time_s * 1e9) for time_s in own["sim_time_s"].to_pylist()]
        assert [*shown] == times
        for time, *position in zip(times, *(own[axis].to_pylist() for axis in "xyz"),
                                   strict=True):  # fmt: skip
            # One of the boxes is the core, whose centre is in the table.
            distances = np.linalg.norm(shown[time] - np.array(position), axis=1)
            assert distances.min() < 1e-3
        sizes = rows(replayed, path, "Boxes3D:half_sizes")
        assert min(time for time, _, _ in sizes) == times[0]


def test_curves_of_a_replay_equal_the_tables(
    replayed: Path, small_arena_run: Path
) -> None:
    check_curves(replayed, small_arena_run)


def test_log_contains_each_birth_and_death(
    replayed: Path, small_arena_run: Path
) -> None:
    lines = [text for _, _, (text,) in rows(replayed, "/log", "TextLog:text")]
    for table, word in (("births", "is born"), ("deaths", "is gone")):
        count = read_table(small_arena_run, table).num_rows
        assert sum(word in line for line in lines) == count


def test_viewers_receive_everything_and_do_not_change_the_run(
    small_arena_workspace: Workspace, small_arena_run: Path
) -> None:
    """Start three viewers; kill one and stop another during the run."""
    workspace = small_arena_workspace
    fleet = Fleet(workspace, *WORDS, "--speed", "10")
    viewers = {}
    for name in ("whole", "killed", "frozen"):
        words = ("view", "--connect", fleet.address, "--save", f"{name}.rrd")
        viewers[name] = workspace.start(*words)
        file = workspace.folder / f"{name}.rrd"
        wait_until(file.exists, f"the viewer {name} has received the run")
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
