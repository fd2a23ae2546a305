"""Groups of islands read as one run, and joined to one."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.islands.events import Record
from coordinator.storage.compare import compare
from coordinator.storage.joining import join_groups
from schema.errors import RunFolderError
from schema.experiment.document import Experiment, Islands
from schema.experiment.file import experiment_text
from schema.experiment.identity import Group
from schema.tables.columns import TABLES
from schema.tables.description import RunDetails, groups_of, read_state, run_columns
from schema.tables.files import has_rows, read_table, rows_of_island
from tests.coordinator.records import make_records, write_run

ISLANDS = 5
DOCUMENT = experiment_text(
    Experiment("ring", births=8, islands=(Islands(count=ISLANDS),))
)
WHOLE = RunDetails("ring", 0, 7, DOCUMENT)
BEGAN = datetime(2026, 1, 1, tzinfo=UTC)


def group_details(number: int, of: int = 2, name: str = "a1") -> RunDetails:
    return replace(WHOLE, group=Group(number=number, of=of), archipelago=name)


def rows(islands: Sequence[int], hours: int) -> list[Record]:
    """Return rows of islands, in turns as they come, and that of a run."""
    made = [
        replace(each, row={**each.row, "island": island})
        for each in make_records(12)
        for island in islands
    ]
    times = {"start": BEGAN, "end": BEGAN + timedelta(hours=hours)}
    of_run = {"name": "ring", "run": 0, "seed": 7, "document": DOCUMENT}
    libraries = {"versions": "{}", "platform": "p", "cpu_flags": ""}
    return [
        *made,
        Record("runs", {**of_run, **times, **libraries, "state": "finished"}),
    ]


def groups(folder: Path, of: int, **last: bool) -> Path:
    """Write the groups of an archipelago, the last one differently."""
    for number in range(of):
        own = list(range(ISLANDS))[number::of]
        flags = last if number == of - 1 else {}
        details = group_details(number, of)
        write_run(folder / f"g{of - number}", rows(own, 1 + number), details, **flags)
    return folder


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    return write_run(tmp_path / "whole", rows(range(ISLANDS), 1), WHOLE)


@pytest.mark.parametrize("is_finished", [True, False])
@pytest.mark.parametrize("of", [2, 5])
def test_the_folder_of_groups_reads_as_one_run(
    tmp_path: Path, whole: Path, of: int, *, is_finished: bool
) -> None:
    folder = groups(tmp_path / "groups", of, is_finished=is_finished)
    assert compare(whole, folder) == []
    assert read_state(folder) == ("finished" if is_finished else "running")
    for name in TABLES:
        assert has_rows(folder, name) == has_rows(whole, name)
    births = read_table(folder, "births", ["record", "birth"])
    assert births["record"].to_pylist() == list(range(12 * ISLANDS))
    for island in range(ISLANDS):
        theirs, ours = (
            [
                row
                for part in rows_of_island(each, "births", island)
                for row in part["birth"]
            ]
            for each in (folder, whole)
        )
        assert ours == theirs
    (run,) = read_table(folder, "runs", ["end"]).to_pylist()
    assert run["end"] == BEGAN + timedelta(hours=of)


@pytest.mark.parametrize("is_given_each", [True, False])
def test_joined_groups_are_one_run(
    tmp_path: Path, whole: Path, *, is_given_each: bool
) -> None:
    folder, out = groups(tmp_path / "groups", 3), tmp_path / "new" / "joined"
    join_groups(sorted(folder.iterdir()) if is_given_each else [folder], out)
    assert compare(whole, out) == []
    assert run_columns(out) == run_columns(folder) == run_columns(folder / "g1")
    assert run_columns(out) != run_columns(whole)
    # Its rows have the identifiers, too.
    ids = read_table(out, "births", ["run_id"])["run_id"].unique().to_pylist()
    assert ids == [run_columns(out)["run_id"]]


@pytest.mark.parametrize(
    ("others", "story"),
    [
        ([], "group 1/3 is missing"),
        ([group_details(1, 3), group_details(1, 3)], "is group 1/3, as "),
        ([group_details(1, 3, "b2")], "must be a group of the archipelago of "),
        ([replace(group_details(1, 3), seed=8)], "must be a group of the archipelago"),
        ([group_details(0, 2)], "must be a group of the archipelago of "),
        ([WHOLE], "is no group of islands"),
    ],
)
def test_other_folders_are_refused(
    tmp_path: Path, others: list[RunDetails], story: str
) -> None:
    folder = tmp_path / "groups"
    for number, details in enumerate([group_details(0, 3), *others]):
        write_run(folder / f"g{number}", rows([], 1), details)
    with pytest.raises(RunFolderError, match=story):
        groups_of(folder)
    with pytest.raises(RunFolderError, match=story):
        join_groups([*folder.iterdir()], tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_groups_are_joined_when_all_are_finished(tmp_path: Path) -> None:
    folder = groups(tmp_path / "groups", 2, is_finished=False)
    with pytest.raises(RunFolderError, match="g1: is not finished; to continue it: "):
        join_groups([folder], tmp_path / "out")
    assert [each.name for each in tmp_path.iterdir()] == ["groups"]


def test_groups_with_other_births_are_refused(tmp_path: Path) -> None:
    longer = replace(
        group_details(1), document=DOCUMENT.replace('"births":8', '"births":9')
    )
    for number, details in enumerate([group_details(0), longer]):
        write_run(tmp_path / f"g{number}", rows([], 1), details)
    with pytest.raises(RunFolderError, match=r"g1: must have as many births as .*g0; "):
        join_groups([tmp_path], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_used_folder_is_refused(tmp_path: Path, whole: Path) -> None:
    before = sorted(whole.rglob("*"))
    with pytest.raises(RunFolderError, match="whole: not empty: choose another"):
        join_groups([groups(tmp_path / "groups", 2)], whole)
    assert sorted(whole.rglob("*")) == before
