"""Studies of docs/: each from its runs to its rows, and from its rows to its page."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from analysis.comparison.comparison import comparison, outcomes_of
from analysis.comparison.findings import findings
from analysis.comparison.outcomes import outcome
from analysis.comparison.progression import progression
from analysis.measures.load import read_runs
from analysis.measures.study import concatenated, measure_run
from docs.studies import (
    ablation,
    arena_settings,
    equal_evaluations,
    learners,
    tasks,
    tasks_pictures,
)
from docs.studies.pages import ROOT, csv_rows, with_parts
from docs.studies.thesis import campaign
from docs.studies.thesis import rows as campaign_rows
from docs.studies.thesis.check import check
from docs.studies.thesis.data import (
    DATA,
    TABLES,
    Part,
    kept,
    kept_outcomes,
    parquet,
    path_of,
    read_rows,
)
from docs.studies.thesis.pictures import digest_in, digests
from docs.studies.thesis.results import tables_of
from schema.experiment.file import read_draft, shipped_experiments
from tests.analysis.drawn import table
from tests.docs.page_runner import blocks_of

STUDIES = ("ablation", "arena_settings", "diversity.results", "ecosystem.results",
           "equal_evaluations", "learners", "learning.results", "suite", "tasks",
           "thesis.results")  # fmt: skip
BIRTHS, MARK, COMMIT = 30, 15, "0123abc"
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

pytestmark = pytest.mark.system


@pytest.mark.parametrize("study", STUDIES)
def test_pages_are_those_of_the_rows(study: str) -> None:
    main = import_module(f"docs.studies.{study}").main
    assert main(["page", "--check"]) == 0, f"run python -m docs.studies.{study} page"


def test_pictures_are_those_of_the_rows() -> None:
    stale = [path.name for path, digest in digests(tables_of(DATA)).items()
             if digest_in(path) != digest]  # fmt: skip
    assert stale == [], "run python -m docs.studies.thesis.results page"


def test_kept_rows_are_whole() -> None:
    assert check(DATA) == 0
    names = {arena_settings.GRID, arena_settings.CHECK, arena_settings.LIMIT}
    for name in names:
        found = arena_settings.kept(name)
        points = read_draft(str(arena_settings.ROWS / f"{name}.toml")).checked()
        for point in points:
            assert point.sweep is not None
            chosen = point.sweep.chosen
            own = found[(found[list(chosen)] == [*chosen.values()]).all(axis=1)]
            assert (len(own), set(own["births"])) == (3, {point.births})
        assert len(found) == 3 * len(points)
    keys = [(row["task"], row["search"], int(row["seed"])) for row in tasks.rows()]
    assert len(set(keys)) == len(keys)
    assert {shipped for shipped, _ in tasks.TASKS.values()} <= {*shipped_experiments()}
    for best in learners.courses().values():
        assert (best[:, :, 0] == best[:1, :, 0]).all()
        assert (best[:, :, 1:] >= best[:, :, :-1]).all()


def test_a_page_without_a_part_is_refused() -> None:
    page = "<!-- begin: ends -->\nold\n<!-- end -->\n"
    assert with_parts(page, {"ends": ["new"]}) == page.replace("old", "new")
    with pytest.raises(ValueError, match=re.escape("must have parts ['runs']")):
        with_parts(page, {"runs": ["new"]})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with three experiments, and a campaign of them in it."""
    folder = tmp_path_factory.mktemp("campaign")
    for name, children in (("scenario2", 1), ("scenario1", 15)):
        text = OFF_LINE.format(name=name, children=children)
        (folder / f"{name}.toml").write_text(text)
    (folder / "scenario3.toml").write_text(ARENA)
    assert campaign.run(folder, parts_of(folder), 1, folder / "none") == 0
    return folder


def parts_of(folder: Path) -> tuple[Part, ...]:
    off_line = tuple(
        str(folder / f"{name}.toml") for name in ("scenario2", "scenario1")
    )
    return (
        Part("off-line", "some", off_line, 2, BIRTHS, 3),
        Part("arena", "arenas", (str(folder / "scenario3.toml"),), 1, BIRTHS, 3),
    )


def files(data: Path) -> dict[str, bytes]:
    return {
        path.relative_to(data).as_posix(): path.read_bytes()
        for path in sorted(data.rglob("*.parquet"))
    }


def changed(
    data: Path, table_name: str, change: Callable[[pa.Table], pa.Table]
) -> None:
    made = change(read_rows(data, table_name, "scenario2-00"))
    path_of(data, table_name, "scenario2-00").write_bytes(parquet(made))


def flipped(data: Path) -> None:
    path = path_of(data, "populations", "scenario2-00")
    content = bytearray(path.read_bytes())
    content[len(content) // 4] ^= 0x10
    path.write_bytes(content)


def two_platforms(rows: pa.Table) -> pa.Table:
    index = rows.schema.get_field_index("platform")
    return rows.set_column(index, "platform", pa.array(["linux-v1 linux-v4"]))


DAMAGES: list[tuple[Callable[[Path], object], str]] = [
    (flipped, "populations/scenario2-00.parquet: cannot be read: "),
    (lambda data: path_of(data, "final", "scenario3-00").write_bytes(b"PAR1"),
     "final/scenario3-00.parquet: cannot be read: "),
    (lambda data: path_of(data, "final", "scenario3-00").unlink(),
     "final/scenario3-00.parquet: missing"),
    (lambda data: changed(data, "final", lambda rows: rows.drop_columns("rank")),
     "final/scenario2-00.parquet: unexpected columns"),
    (lambda data: shutil.copy(path_of(data, "outcomes", "scenario2-01"),
                              path_of(data, "outcomes", "scenario2-00")),
     "scenario2-00.parquet: must have rows of scenario2-00 only"),
    (lambda data: changed(data, "runs", two_platforms),
     "runs/scenario2-00.parquet: must have one platform, got 2"),
    (lambda data: (data / "final" / "scenario2-07.parquet").write_bytes(b""),
     "final/scenario2-07.parquet: unexpected file"),
]  # fmt: skip


def test_campaign_of_the_thesis(
    place: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(campaign_rows, "MARKS", (MARK,))
    parts, data = parts_of(place), tmp_path / "data"
    assert campaign.collect(place, data, COMMIT, parts) == 0
    assert check(data, parts) == 0
    names = {f"{name}/{experiment}-{number:02}.parquet" for name in TABLES
             for experiment, count in (("scenario2", 2), ("scenario1", 2),
                                       ("scenario3", 1))
             for number in range(count)
             if name != "variability" or experiment == "scenario3"}  # fmt: skip
    complete = files(data)
    assert set(complete) == names
    # Rows are measures of the runs, and compared alike.
    runs, _ = read_runs([place / "runs" / part.folder for part in parts])
    measured = [measure_run(run, "parent") for run in runs]
    ours, theirs = kept_outcomes(kept(data, "outcomes")), outcomes_of(measured)
    assert comparison(ours) == comparison(theirs)
    assert comparison(ours).num_rows > 40
    assert findings(ours) == findings(theirs)
    early = kept_outcomes(kept(data, "outcomes"), MARK)
    assert early.births("scenario1", "scenario3") == MARK
    mine = [one for one in measured if one.run.experiment == "scenario2"]
    assert early.values("scenario2", "parts_change", MARK).tolist() == [
        outcome(one.tables, MARK, one.run.islands)["parts_change"] for one in mine
    ]
    whole = progression(concatenated(measured)["populations"])
    is_kept = pc.is_in(whole["births"], pa.array([MARK, BIRTHS]))
    assert progression(kept(data, "populations")) == whole.filter(is_kept)
    # What is lost is made again, and the same bytes; the rest is not.
    for path in data.glob("*/scenario1-01.parquet"):
        path.unlink()
    path_of(data, "final", "scenario3-00").write_bytes(b"PAR1")
    capsys.readouterr()
    again = tmp_path / "again"
    shutil.copytree(place / "runs" / "arenas", again / "runs" / "arenas")
    assert campaign.run(again, parts[:1], 1, data) == 0
    made = {path.parent.name for path in again.glob("runs/some/*/*/run.json")}
    assert made == {"scenario1-1"}
    assert campaign.collect(again, data, COMMIT, parts) == 0
    assert "2 repeats collected, 0 failed" in capsys.readouterr().out
    assert files(data) == complete
    for damage, message in DAMAGES:
        shutil.rmtree(again)
        shutil.copytree(data, again)
        damage(again)
        capsys.readouterr()
        assert check(again, parts) == 1
        lines = capsys.readouterr().out.splitlines()
        (line,) = [line for line in lines if line.startswith("damaged: ")]
        assert message in line


def test_campaign_collects_only_its_own_finished_runs(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (part, _) = parts_of(place)
    some = tmp_path / "runs" / "some"
    shutil.copytree(place / "runs" / "some", some)
    (tmp_path / campaign.COMMIT).write_text(f"{COMMIT}\n")
    (some / "scenario2-00" / "scenario2-0" / "state").write_text("running")
    next((some / "scenario2-00" / "scenario2-1").rglob("evaluations.parquet")).unlink()
    fewer = Part("off-line", "some", part.experiments, 1, BIRTHS, 3)
    assert campaign.collect(tmp_path, tmp_path / "data", None, (fewer,)) == 0
    assert kept(tmp_path / "data", "runs")["commit"].to_pylist() == [COMMIT]
    assert "scenario2-1: not a run of the campaign" in capsys.readouterr().out
    assert campaign.collect(tmp_path, tmp_path / "data", None, (part,)) == 1
    assert "scenario2-01: table evaluations: missing" in capsys.readouterr().out


def patched(
    monkeypatch: pytest.MonkeyPatch, study: ModuleType, **values: object
) -> None:
    for name, value in values.items():
        monkeypatch.setattr(study, name, value)


def test_ablation(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = place / "runs" / "some" / "scenario1-00" / "scenario1-0"
    words = ["ablate", str(run), "--robots", "1", "--brains", "1", "--workers", "1"]
    command = [sys.executable, "-m", "revolve", *words, "--out", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)
    changes = tmp_path / "changes.parquet"
    patched(monkeypatch, ablation, DATA=tmp_path, CHANGES=changes)
    ablation.main(["keep", str(tmp_path / "ablation.parquet")])
    ablation.main(["changes", str(run)])
    assert [*ablation.kept()] == [("scenario1", BIRTHS)]
    assert pq.read_table(changes).num_rows == 1
    (parts,) = ablation.pages().values()
    winners = [*parts["winners"]]
    assert winners[2].startswith("| scenario1-0 | ")
    assert len(winners) == 3


def test_equal_evaluations(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    patched(monkeypatch, equal_evaluations, ROWS=tmp_path / "rows.csv")
    runs = place / "runs" / "some"
    for _ in range(2):  # rows of the same experiment are replaced
        equal_evaluations.main(
            ["keep", *(str(runs / "scenario1-00" / f"scenario1-{n}") for n in range(2))]
        )
    found = csv_rows(tmp_path / "rows.csv")
    assert [row["evaluations"] for row in found] == ["30", "30"]
    for row in found:
        assert float(row["best"]) == pytest.approx(float(row["without changes"]))


def test_tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.nice", lambda _: None)
    robots, searched = tmp_path / "robots", {"locomotion": ("scenario1", "m/s")}
    patched(monkeypatch, tasks, ROBOTS=robots, ROWS=robots / "rows.csv", BIRTHS=16,
            SEEDS=(1,), TASKS=searched, SEARCHED=searched)  # fmt: skip
    tasks.main(["run", str(tmp_path / "runs")])
    assert [row["search"] for row in tasks.rows()] == ["evolution", "random"]
    *_, line = tasks.table(tasks.rows())
    assert re.fullmatch(r"\| locomotion \| 1 \| .* \| too few seeds \|", line)
    patched(monkeypatch, tasks_pictures, PICTURES=tmp_path / "pictures")
    assert tasks_pictures.main() == 0
    assert (tmp_path / "pictures" / "locomotion.png").stat().st_size > 1000


def test_learners(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first trials of the first searches, within the last digits."""
    kept = {name: csv_rows(learners.DATA / f"{name}.csv") for name in learners.SETS}
    patched(monkeypatch, learners, DATA=tmp_path, BODIES=1, SEEDS=1, BUDGET=3)
    for _ in range(2):  # the second finds nothing to do
        learners.main(["run"])
    for name, rows in kept.items():
        found = csv_rows(tmp_path / f"{name}.csv")
        assert [row["learner"] for row in found] == [*learners.LEARNERS]
        for row in found:
            names = {key: row[key] for key in ("body", "learner", "seed")}
            (same,) = (each for each in rows if names.items() <= each.items())
            for trial in ("best_0", "best_1", "best_2"):
                assert float(row[trial]) == pytest.approx(float(same[trial]), rel=1e-6)


def test_arena_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = [f"{tmp_path}/runs/s-{number}" for number in range(3)]
    made = {
        "sweeps": [{"experiment": "s", "folder": folder, "setting": key, "value": "",
                    "number": number}
                   for folder, numbers in zip(folders, ((10.0, 0.2), (20.0, 0.2),
                                                        (10.0, 0.6)), strict=True)
                   for key, number in zip((arena_settings.INTERVAL,
                                           arena_settings.SHARE), numbers,
                                          strict=True)],
        "outcomes": [{"folder": folder, "births": 40, "fitness": 1.0 + number,
                      "fitness_best": 0.5, "diversity": 8.0, "late_gain": 0.25,
                      "size": 9.0, "size_mean": 9.0}
                     for number, folder in enumerate(folders[:2])],
        "runs": [{"folder": folder, "simulated_s": 400.0} for folder in folders],
        "populations": [{"folder": folder, "births": births, "size": size}
                        for folder in folders
                        for births, size in ((5, 1), (20, 7), (40, 9))],
    }  # fmt: skip
    (tmp_path / "measures").mkdir()
    for name, rows in made.items():
        pq.write_table(table(name, rows), tmp_path / "measures" / f"{name}.parquet")
    patched(monkeypatch, arena_settings, ROWS=tmp_path)
    arena_settings.main(["keep", str(tmp_path)])
    found = arena_settings.kept("s")
    assert found.index.tolist() == ["s-0", "s-1"]  # the third is not finished
    assert found["birth_s"].tolist() == [10.0, 10.0]
    assert found["size_least"].tolist() == [7, 7]
    *_, line = arena_settings.setting_lines(found, arena_settings.INTERVAL)
    assert line.startswith("| 20 | 1 | 2.0000 (nan to nan) | ")


def test_code_of_the_readme_runs() -> None:
    blocks = blocks_of(DATA / "README.md", "python")
    assert len(blocks) == 2
    for block in blocks:
        words = [sys.executable, "-W", "error", "-c", block]
        subprocess.run(words, cwd=ROOT, check=True)
