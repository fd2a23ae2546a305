"""Comparison of two runs, finished or not, and of campaigns."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from coordinator.islands.events import Record
from coordinator.storage.campaign import Campaign, write_campaign
from coordinator.storage.compare import compare
from schema.errors import RunFolderError
from schema.experiment.document import Experiment, Simulation
from schema.experiment.file import experiment_text
from schema.tables.files import read_table
from tests.coordinator.records import make_records, write_run

START = datetime(2026, 1, 1, tzinfo=UTC)
BIRTH = make_records(1)[0]


def changed(rows: list[Record], index: int, column: str, value: object) -> list[Record]:
    """Return rows with one value changed."""
    record = rows[index]
    new = replace(record, row={**record.row, column: value})
    return [*rows[:index], new, *rows[index + 1 :]]


def compared(
    folder: Path, one: list[Record], other: list[Record], *, is_finished: bool = True
) -> list[str]:
    """Return the differences of a finished run and another one."""
    first = write_run(folder / "a", one)
    return compare(first, write_run(folder / "b", other, is_finished=is_finished))


@pytest.mark.parametrize("is_finished", [True, False])
def test_equal_runs_have_no_difference(tmp_path: Path, *, is_finished: bool) -> None:
    first = write_run(tmp_path / "a", make_records(12))
    second = write_run(tmp_path / "b", make_records(12), is_finished=is_finished)
    ids = [read_table(run, "births")["run_id"].unique() for run in (first, second)]
    assert [len(each) for each in ids] == [1, 1]
    assert ids[0] != ids[1]
    assert compare(first, second) == []
    assert compare(second, first) == []


def test_provenance_is_no_difference(tmp_path: Path) -> None:
    other = make_records(12, "worker-9", "arm")
    assert compared(tmp_path, make_records(12), other) == []


@pytest.mark.parametrize("is_finished", [True, False])
def test_the_first_difference_of_a_table_is_named(
    tmp_path: Path, *, is_finished: bool
) -> None:
    rows = make_records(12)
    # Record 3 and, in an earlier column, record 7 of the births.
    births = [index for index, each in enumerate(rows) if each.table == "births"]
    other = changed(rows, births[3], "genome", b"\x00" * 100)
    other = changed(other, births[7], "birth", 99)
    (line,) = compared(tmp_path, rows, other, is_finished=is_finished)
    assert line.startswith(
        r"births: first at record 3, column genome: b'\x03\x03\x03' against b'\x00\x00"
    )
    assert line.endswith("...")


def test_the_smallest_change_of_a_number_is_seen(tmp_path: Path) -> None:
    rows = make_records(2)
    other = changed(rows, 3, "fitness", 0.33333333333333337)
    (line,) = compared(tmp_path, rows, other)
    assert line.endswith("fitness: 0.3333333333333333 against 0.33333333333333337")


def test_a_failed_evaluation_differs_from_one_that_is_zero(tmp_path: Path) -> None:
    rows = make_records(7)
    failed = next(
        index for index, each in enumerate(rows) if each.row.get("status") == "failed"
    )
    assert compared(tmp_path, rows, changed(rows, failed, "fitness", 0.0)) == [
        "evaluations: first at record 6, column fitness: None against 0.0"
    ]


def test_not_a_number_equals_itself(tmp_path: Path) -> None:
    rows = changed(make_records(2), 3, "fitness", float("nan"))
    assert compared(tmp_path, rows, rows) == []


def test_missing_rows_are_counted_and_the_common_ones_compared(tmp_path: Path) -> None:
    first = write_run(tmp_path / "a", make_records(12))
    second = write_run(tmp_path / "b", make_records(9), is_finished=False)
    assert compare(first, second) == [
        "births: 12 rows against 9",
        f"{second}: is not finished, so it has fewer rows",
        "evaluations: 12 rows against 9",
        "population: 12 rows against 9",
    ]


def test_islands_are_compared_one_by_one(tmp_path: Path) -> None:
    births = [each for each in make_records(12) if each.table == "births"]
    rows = [
        replace(each, row={**each.row, "island": index % 2})
        for index, each in enumerate(births)
    ]
    first = write_run(tmp_path / "a", rows)
    second = write_run(tmp_path / "b", rows[:7], is_finished=False)
    shorter = [
        "births: 12 rows against 7",
        f"{second}: is not finished, so it has fewer rows",
    ]
    assert compare(first, second) == shorter
    other = write_run(tmp_path / "c", changed(rows, 5, "rank", 40))
    assert compare(second, other)[1] == (
        "births: first at record 2 of island 1, column rank: 2 against 40"
    )
    moved = write_run(tmp_path / "d", changed(rows, 11, "island", 0))
    assert compare(first, moved) == ["births: 6 rows of island 0 against 7"]


@pytest.mark.parametrize("is_equal", [True, False])
def test_the_last_smaller_brood_of_a_shorter_run_is_named_and_left_out(
    tmp_path: Path, *, is_equal: bool
) -> None:
    """The run of 8 births has populations at 3, 6 and 8 births, the other at 9, too."""
    shorter = make_records(8)
    shorter += [replace(each, row={**each.row, "births": 8}) for each in shorter[-7:-4]]
    assert [each.table for each in shorter[-4:]] == ["evaluations", *["population"] * 3]
    if not is_equal:
        shorter = changed(shorter, 15, "fitness", 0.25)
    first = write_run(tmp_path / "a", shorter)
    second = write_run(tmp_path / "b", make_records(12))
    early = (
        f"population: not compared at 8 births of island 0, where the last brood of "
        f"{first} ends and that of the longer run goes on"
    )
    difference = "population: first at record 3, column fitness: 0.25 against 0.5"
    expected = [early] if is_equal else [early, difference]
    assert compare(first, second)[3:] == expected
    assert compare(second, first)[3] == early


def test_different_platforms_are_named_beside_a_difference(tmp_path: Path) -> None:
    other = changed(make_records(3, "w", "arm"), 1, "fitness", 9.0)
    assert compared(tmp_path, make_records(3), other) == [
        "evaluations: first at record 0, column fitness: 0.0 against 9.0",
        (
            "platforms differ: linux-x86 against arm; only runs on the same "
            "platform are guaranteed to be equal"
        ),
    ]


def test_a_run_without_a_recorded_platform_differs_from_none(tmp_path: Path) -> None:
    rows = make_records(9)
    births = [each for each in rows if each.table == "births"]
    lines = compared(tmp_path, rows, births, is_finished=False)
    assert "evaluations: 9 rows against 0" in lines
    assert not any("platform" in line for line in lines)


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    first = write_run(tmp_path / "a", make_records(3))
    with pytest.raises(RunFolderError, match=rf"holds several runs; .* as {first}$"):
        compare(first, tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RunFolderError, match="no run is there"):
        compare(first, tmp_path / "empty")


def one_birth(birth: Record = BIRTH, **row: Any) -> list[Record]:  # noqa: ANN401 - any value
    """Return the rows of a finished run of one birth."""
    whole = {
        "name": "test", "run": 0, "seed": 1, "state": "finished", "versions": "{}",
        "document": experiment_text(Experiment(name="test")), "platform": "here",
        "cpu_flags": "", "start": START, "end": START, **row,
    }  # fmt: skip
    return [birth, Record("runs", whole)]


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
    other = one_birth(document=document)
    assert compared(tmp_path, one_birth(), other) == []


def test_another_experiment_is_a_difference(tmp_path: Path) -> None:
    other = Experiment(name="test", simulation=Simulation(friction=0.5))
    rows = one_birth(document=older(other))
    (line,) = compared(tmp_path, one_birth(), rows)
    assert line.startswith("runs: first at record 0, column document:")


def test_platforms_of_arenas_are_compared(tmp_path: Path) -> None:
    other = Record("births", {**BIRTH.row, "rank": 9})
    rows = one_birth(other, platform="there")
    _, line = compared(tmp_path, one_birth(), rows)
    assert line.startswith("platforms differ: here against there; only runs on the ")


def campaign(
    folder: Path, births: dict[str, Record], experiments: str = "ab", repeats: int = 2
) -> Path:
    """Write a campaign whose finished runs have one birth each, by name of the run."""
    documents = tuple(Experiment(name=name) for name in experiments)
    folder.mkdir()
    write_campaign(folder, Campaign(documents, repeats, 1))
    for name, birth in births.items():
        write_run(folder / name, one_birth(birth))
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
