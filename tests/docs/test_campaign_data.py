"""Tests of the rows of docs/data and the script that collects and checks them."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pytest

from analysis.comparison.claims import CLAIMS
from analysis.comparison.comparison import Outcomes, comparison
from analysis.comparison.findings import findings
from analysis.comparison.outcomes import outcome
from analysis.comparison.progression import progression
from analysis.measures.load import read_runs
from analysis.measures.study import concatenated, measure_run
from docs import campaign, campaign_rows
from docs.campaign_check import check
from docs.campaign_data import (
    DATA,
    TABLES,
    KeptOutcomes,
    Part,
    kept,
    parquet,
    path_of,
    read_rows,
)
from schema.agent.platform_tag import platform_tag
from schema.experiment.document import body_space
from schema.experiment.file import experiment_from_text
from schema.robot.genome import develop
from schema.wire.protobuf import decode_genome

BIRTHS = 30
MARK = 15
OFF_LINE = """
name = "{name}"
births = 60
[selection]
children = {children}
[simulation]
window_steps = 400
"""
"""Two seconds of each robot's life; the number of births is the campaign's."""
ARENA = """
name = "scenario3"
births = 60
[selection]
population = 15
[simulation]
warmup_steps = 200
window_steps = 400
[arena]
birth_interval_s = 2.0
cull_interval_s = 4.0
sample_interval_s = 1.0
"""
COMMIT = "0123abc"

Parts = tuple[Part, ...]
Files = dict[str, bytes]


@pytest.fixture(autouse=True)
def _early_mark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign_rows, "MARKS", (MARK,))


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with three experiments, and a campaign of them in it."""
    folder = tmp_path_factory.mktemp("campaign")
    for name, children in (("scenario2", 1), ("scenario1", 15)):
        text = OFF_LINE.format(name=name, children=children)
        (folder / f"{name}.toml").write_text(text)
    (folder / "scenario3.toml").write_text(ARENA)
    assert campaign.run(folder, _parts(folder), 1, folder / "none") == 0
    return folder


def _parts(folder: Path) -> Parts:
    names = ("scenario2", "scenario1")
    off_line = tuple(str(folder / f"{name}.toml") for name in names)
    return (
        Part("off-line", "some", off_line, 2, BIRTHS, 3),
        Part("arena", "arenas", (str(folder / "scenario3.toml"),), 1, BIRTHS, 3),
    )


@pytest.fixture
def parts(place: Path) -> Parts:
    return _parts(place)


@pytest.fixture
def data(place: Path, parts: Parts, tmp_path: Path) -> Path:
    """Return a folder with the rows of the campaign."""
    assert campaign.collect(place, tmp_path / "data", COMMIT, parts) == 0
    return tmp_path / "data"


def _files(data: Path) -> Files:
    return {
        path.relative_to(data).as_posix(): path.read_bytes()
        for path in sorted(data.rglob("*"))
        if path.is_file()
    }


pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


def test_rows_of_a_run_are_the_same_bytes_every_time(
    place: Path, parts: Parts, data: Path, tmp_path: Path
) -> None:
    assert campaign.collect(place, tmp_path / "again", COMMIT, parts) == 0
    names = {f"{table}/{name}-{number:02}.parquet" for table in TABLES
             for name, count in (("scenario2", 2), ("scenario1", 2), ("scenario3", 1))
             for number in range(count)
             if table != "variability" or name == "scenario3"}  # fmt: skip
    assert set(_files(data)) == names
    assert _files(data) == _files(tmp_path / "again")
    assert check(data, parts) == 0


def test_rows_name_the_commit_that_began_the_campaign(
    place: Path, parts: Parts, tmp_path: Path
) -> None:
    (tmp_path / "runs").symlink_to(place / "runs")
    (tmp_path / campaign.COMMIT).write_text(f"{COMMIT}\n")
    assert campaign.collect(tmp_path, tmp_path / "data", None, parts[:1]) == 0
    rows = kept(tmp_path / "data", "runs")
    assert rows["commit"].to_pylist() == [COMMIT] * 4
    assert rows["births"].to_pylist() == [BIRTHS] * 4
    assert set(rows["platform"].to_pylist()) == {platform_tag()}


def test_the_last_population_is_kept_with_its_genomes(data: Path) -> None:
    rows = kept(data, "final").filter(pc.field("experiment") == "scenario1")
    document = kept(data, "runs")["document"][0].as_py()
    space = body_space(experiment_from_text(document).space)
    genomes = [decode_genome(genome) for genome in rows["genome"].to_pylist()]
    robots = [develop(genome, space) for genome in genomes]
    assert [len(robot.parts) for robot in robots] == rows["parts"].to_pylist()
    assert {len(parents) for parents in rows["parents"].to_pylist()} == {0, 2}
    last = kept(data, "populations").filter(pc.field("births") == BIRTHS)
    for name in ("scenario1-00", "scenario1-01"):
        mine = rows.filter(pc.field("folder") == name)
        mean = last.filter(pc.field("folder") == name)["fitness"][0].as_py()
        assert pc.mean(mine["fitness"]).as_py() == pytest.approx(mean)


def test_collecting_twice_writes_only_missing_rows(
    place: Path, parts: Parts, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    complete = _files(data)
    before = {name: (data / name).stat().st_mtime_ns for name in complete}
    path_of(data, "runs", "scenario1-01").unlink()
    path_of(data, "final", "scenario3-00").write_bytes(b"PAR1")
    capsys.readouterr()
    assert campaign.collect(place, data, COMMIT, parts) == 0
    assert "2 repeats collected, 0 failed" in capsys.readouterr().out
    assert _files(data) == complete
    touched = {
        name for name in complete if (data / name).stat().st_mtime_ns != before[name]
    }
    assert {Path(name).stem for name in touched} == {"scenario1-01", "scenario3-00"}


def test_only_finished_runs_of_the_campaign_are_collected(
    place: Path, parts: Parts, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(place / "runs" / "some", tmp_path / "runs" / "some")
    (tmp_path / "runs" / "some" / "scenario2-00" / "scenario2-0" / "state").write_text(
        "running"
    )
    lost = tmp_path / "runs" / "some" / "scenario2-00" / "scenario2-1" / "tables"
    next(lost.rglob("evaluations.parquet")).unlink()
    fewer = Part("off-line", "some", parts[0].experiments, 1, BIRTHS, 3)
    assert campaign.collect(tmp_path, tmp_path / "data", COMMIT, (fewer,)) == 0
    assert {Path(name).stem for name in _files(tmp_path / "data")} == {"scenario1-00"}
    assert "scenario2-1: not a run of the campaign" in capsys.readouterr().out
    assert campaign.collect(tmp_path, tmp_path / "data", COMMIT, parts[:1]) == 1
    assert "scenario2-01: table evaluations: missing" in capsys.readouterr().out


def test_a_lost_run_is_repeated(
    place: Path, parts: Parts, data: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(place / "runs" / "some", folder / "runs" / "some")
    shutil.rmtree(folder / "runs" / "some" / "scenario1-00" / "scenario1-0")
    assert campaign.run(folder, parts[:1], 1, tmp_path / "none") == 0
    assert campaign.collect(folder, tmp_path / "again", COMMIT, parts[:1]) == 0
    again = _files(tmp_path / "again")
    assert again == {name: _files(data)[name] for name in again}
    assert "outcomes/scenario1-00.parquet" in again


def test_kept_repeats_are_not_run_again(
    parts: Parts, data: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "new"
    assert campaign.run(folder, parts, 1, data) == 0
    assert not (folder / "runs").exists()
    before = _files(data)
    for path in data.glob("*/scenario1-01.parquet"):
        path.unlink()
    assert campaign.run(folder, parts[:1], 1, data) == 0
    names = {path.parent.name for path in folder.glob("runs/some/*/*/run.json")}
    assert names == {"scenario1-1"}
    assert campaign.collect(folder, data, COMMIT, parts) == 0
    assert _files(data) == before


def test_batches_have_folders_of_their_own(
    parts: Parts, data: Path, tmp_path: Path
) -> None:
    folder, kept = tmp_path / "new", tmp_path / "kept"
    for path in data.glob("*/scenario1-00.parquet"):
        copy = kept / path.relative_to(data)
        copy.parent.mkdir(parents=True)
        shutil.copy(path, copy)
    scenario1 = parts[0].experiments[1:]
    ones = replace(parts[0], experiments=scenario1, repeats=3, batch=2)
    assert campaign.run(folder, [ones], 1, kept) == 0
    runs = sorted(path.parent for path in folder.glob("runs/some/*/*/run.json"))
    names = [str(run.relative_to(folder / "runs" / "some")) for run in runs]
    assert names == ["scenario1-00/scenario1-1", "scenario1-02/scenario1-2"]


def _two_platforms(data: Path) -> None:
    rows = read_rows(data, "runs", "scenario2-00")
    index = rows.schema.get_field_index("platform")
    other = rows.set_column(
        index, "platform", pa.array(["linux-x86_64_v1 linux-x86_64_v4"])
    )
    path_of(data, "runs", "scenario2-00").write_bytes(parquet(other))


def _no_rank(data: Path) -> None:
    rows = read_rows(data, "final", "scenario2-00").drop_columns("rank")
    path_of(data, "final", "scenario2-00").write_bytes(parquet(rows))


def _flipped(data: Path) -> None:
    path = path_of(data, "populations", "scenario2-00")
    content = bytearray(path.read_bytes())
    content[len(content) // 4] ^= 0x10
    path.write_bytes(content)


def _exchanged(data: Path) -> None:
    other = path_of(data, "outcomes", "scenario2-01")
    shutil.copy(other, path_of(data, "outcomes", "scenario2-00"))


DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "flipped": (_flipped, "populations/scenario2-00.parquet: cannot be read: "),
    "cut": (
        lambda data: path_of(data, "final", "scenario3-00").write_bytes(b"PAR1"),
        "final/scenario3-00.parquet: cannot be read: ",
    ),
    "missing": (
        lambda data: path_of(data, "final", "scenario3-00").unlink(),
        "final/scenario3-00.parquet: missing",
    ),
    "columns": (_no_rank, "final/scenario2-00.parquet: unexpected columns"),
    "exchanged": (
        _exchanged,
        "scenario2-00.parquet: must have rows of scenario2-00 only",
    ),
    "platform": (
        _two_platforms,
        "runs/scenario2-00.parquet: must have one platform, got 2",
    ),
    "stray": (
        lambda data: (data / "final" / "scenario2-07.parquet").write_bytes(b""),
        "final/scenario2-07.parquet: unexpected file",
    ),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_damage_is_found(
    name: str, parts: Parts, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damage, message = DAMAGES[name]
    damage(data)
    capsys.readouterr()
    assert check(data, parts) == 1
    lines = capsys.readouterr().out.splitlines()
    damaged = [line for line in lines if line.startswith("damaged: ")]
    assert len(damaged) == 1
    assert message in damaged[0]


def test_missing_repeats_are_no_damage(
    parts: Parts, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in data.glob("*/scenario1-01.parquet"):
        path.unlink()
    capsys.readouterr()
    assert check(data, parts) == 0
    assert "scenario1: 1 of 2 repeats, missing: 1\n" in capsys.readouterr().out


def test_kept_outcomes_give_the_same_comparison(
    place: Path, parts: Parts, data: Path
) -> None:
    runs, _ = read_runs([place / "runs" / part.folder for part in parts])
    measured = [measure_run(run, "parent") for run in runs]
    rows = kept(data, "outcomes")
    ours, theirs = KeptOutcomes(rows), Outcomes(measured)
    names = ["scenario1", "scenario2", "scenario3"]
    assert ours.experiments == theirs.experiments == names
    assert comparison(ours) == comparison(theirs)
    assert comparison(ours).num_rows > 40
    assert findings(ours) == findings(theirs)
    assert findings(ours)["effect"].null_count < len(CLAIMS)
    early = KeptOutcomes(rows, MARK)
    assert early.births("scenario1", "scenario3") == MARK
    for one in ("scenario1", "scenario2"):
        found = [
            outcome(each.tables, MARK, each.run.islands)["parts_change"]
            for each in measured
            if each.run.experiment == one
        ]
        assert early.values(one, "parts_change", MARK).tolist() == found


def test_progression_of_kept_rows_equals_that_of_the_runs(
    place: Path, parts: Parts, data: Path
) -> None:
    runs, _ = read_runs([place / "runs" / part.folder for part in parts])
    measured = [measure_run(run, "parent") for run in runs]
    complete = progression(concatenated(measured)["populations"])
    ours = progression(kept(data, "populations"))
    is_kept = pc.is_in(complete["births"], pa.array([MARK, BIRTHS]))
    assert ours == complete.filter(is_kept)
    assert complete.num_rows > ours.num_rows > 40


def test_committed_rows_pass_the_check() -> None:
    assert check(DATA) == 0


def test_code_of_the_readme_runs() -> None:
    page = (DATA / "README.md").read_text("utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        words = [sys.executable, "-W", "error", "-c", block]
        subprocess.run(words, cwd=campaign.ROOT, check=True)
