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

DETAILS = RunDetails("test", 0, 1, "{}")
START = datetime(2026, 1, 1, tzinfo=UTC)


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
    make_records: Any,  # noqa: ANN401 - the fixture
) -> None:
    birth = make_records(1)[0]
    document = older(Experiment(name="test"))
    assert document != experiment_text(Experiment(name="test"))
    first = written(tmp_path / "a", birth)
    assert compare(first, written(tmp_path / "b", birth, document=document)) == []


def test_another_experiment_is_a_difference(
    tmp_path: Path,
    make_records: Any,  # noqa: ANN401 - the fixture
) -> None:
    birth = make_records(1)[0]
    other = Experiment(name="test", simulation=Simulation(friction=0.5))
    first = written(tmp_path / "a", birth)
    (line,) = compare(first, written(tmp_path / "b", birth, document=older(other)))
    assert line.startswith("runs: first at record 0, column document:")


def test_platforms_of_arenas_are_compared(
    tmp_path: Path,
    make_records: Any,  # noqa: ANN401 - the fixture
) -> None:
    birth = make_records(1)[0]
    other = Record("births", {**birth.row, "rank": 9})
    first = written(tmp_path / "a", birth)
    lines = compare(first, written(tmp_path / "b", other, platform="there"))
    assert lines[1:] == [
        (
            "platforms differ: here against there; only runs on the same platform are "
            "guaranteed to be equal"
        )
    ]


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


def test_campaigns_are_compared_run_by_run(
    tmp_path: Path,
    make_records: Any,  # noqa: ANN401 - the fixture
) -> None:
    birth = make_records(1)[0]
    same = dict.fromkeys(("a-0", "b-0", "a-1", "b-1"), birth)
    first = campaign(tmp_path / "first", same)
    assert compare(first, campaign(tmp_path / "equal", same)) == []
    rank, other = birth.row["rank"], Record("births", {**birth.row, "rank": 9})
    second = campaign(tmp_path / "second", {"a-0": birth, "b-0": other, "b-1": birth})
    assert compare(first, second) == [
        f"b-0: births: first at record 0, column rank: {rank} against 9",
        f"a-1: {second / 'a-1'}: no such folder",
        "2 of 4 runs differ: b-0, a-1",
    ]


def test_runs_of_only_one_campaign_are_named(
    tmp_path: Path,
    make_records: Any,  # noqa: ANN401 - the fixture
) -> None:
    birth = make_records(1)[0]
    first = campaign(tmp_path / "a", {"a-0": birth}, "a", repeats=1)
    second = campaign(tmp_path / "b", {"a-0": birth, "b-0": birth}, "ab", repeats=1)
    for pair in ((first, second), (second, first)):
        assert compare(*pair) == [
            f"b-0: {first / 'b-0'}: no such folder",
            "1 of 2 runs differ: b-0",
        ]
