"""Comparison of two runs: documents of two versions, platforms of arenas."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from coordinator.islands.events import Record
from coordinator.storage.campaign import Campaign, write_campaign
from coordinator.storage.compare import compare
from coordinator.storage.folder import RunDetails, RunFolder
from coordinator.storage.recorder import Recorder
from schema.experiment.document import Experiment, Simulation
from schema.experiment.file import experiment_text
from tests.coordinator.records import make_records

DETAILS = RunDetails("test", 0, 1, "{}")
START = datetime(2026, 1, 1, tzinfo=UTC)
BIRTH = make_records(1)[0]


def written(path: Path, birth: Record, **row: Any) -> Path:  # noqa: ANN401 - any value
    """Write a finished run of one birth."""
    whole = {
        "name": "test", "run": 0, "seed": 1, "state": "finished", "versions": "{}",
        "document": experiment_text(Experiment(name="test")), "platform": "here",
        "cpu_flags": "", "start": START, "end": START, **row,
    }  # fmt: skip
    with RunFolder(path, DETAILS):
        recorder = Recorder(path, DETAILS)
        recorder.write(birth)
        recorder.write(Record("runs", whole))
        recorder.finish()
    return path


def older(experiment: Experiment) -> str:
    """Return the document of an older version that lacks some keys."""
    document = msgspec.json.decode(experiment_text(experiment))
    del document["simulation"]["evaluation_s"]
    del document["selection"]["culling"]
    return msgspec.json.encode(document).decode()


def test_an_older_document_of_the_same_experiment_is_no_difference(
    tmp_path: Path,
) -> None:
    document = older(Experiment(name="test"))
    assert document != experiment_text(Experiment(name="test"))
    first = written(tmp_path / "a", BIRTH)
    assert compare(first, written(tmp_path / "b", BIRTH, document=document)) == []


def test_another_experiment_is_a_difference(tmp_path: Path) -> None:
    other = Experiment(name="test", simulation=Simulation(friction=0.5))
    first = written(tmp_path / "a", BIRTH)
    (line,) = compare(first, written(tmp_path / "b", BIRTH, document=older(other)))
    assert line.startswith("runs: first at record 0, column document:")


def test_platforms_of_arenas_are_compared(tmp_path: Path) -> None:
    other = Record("births", {**BIRTH.row, "rank": 9})
    first = written(tmp_path / "a", BIRTH)
    _, line = compare(first, written(tmp_path / "b", other, platform="there"))
    assert line.startswith("platforms differ: here against there; only runs on the ")


def campaign(
    folder: Path, births: dict[str, Record], experiments: str = "ab", repeats: int = 2
) -> Path:
    """Write a campaign whose finished runs have one birth each, by name of the run."""
    documents = tuple(Experiment(name=name) for name in experiments)
    folder.mkdir()
    write_campaign(folder, Campaign(documents, repeats, 1))
    for name, birth in births.items():
        written(folder / name, birth)
    return folder


def test_campaigns_are_compared_run_by_run(tmp_path: Path) -> None:
    same = dict.fromkeys(("a-0", "b-0", "a-1", "b-1"), BIRTH)
    first = campaign(tmp_path / "first", same)
    assert compare(first, campaign(tmp_path / "equal", same)) == []
    rank, other = BIRTH.row["rank"], Record("births", {**BIRTH.row, "rank": 9})
    second = campaign(tmp_path / "second", {"a-0": BIRTH, "b-0": other, "b-1": BIRTH})
    assert compare(first, second) == [
        f"b-0: births: first at record 0, column rank: {rank} against 9",
        f"a-1: {second / 'a-1'}: no such folder",
        "2 of 4 runs differ: b-0, a-1",
    ]


def test_runs_of_only_one_campaign_are_named(tmp_path: Path) -> None:
    first = campaign(tmp_path / "a", {"a-0": BIRTH}, "a", repeats=1)
    second = campaign(tmp_path / "b", {"a-0": BIRTH, "b-0": BIRTH}, "ab", repeats=1)
    for pair in ((first, second), (second, first)):
        assert compare(*pair) == [
            f"b-0: {first / 'b-0'}: no such folder",
            "1 of 2 runs differ: b-0",
        ]
