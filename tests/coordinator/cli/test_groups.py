"""Flags and folders of groups of islands: what is refused, in one line."""

from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.__main__ import main
from coordinator.cli.groups import groups_below
from coordinator.storage.folder import RunFolder, read_details
from schema.errors import RevolveError, RunFolderError
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.identity import WHOLE, Group
from schema.tables.description import RunDetails

RING = RunDetails(
    "ring", 0, 7, experiment_text(read_experiment("archipelago-ring")),
    group=Group(number=0, of=2), archipelago="name",
)  # fmt: skip
ALONE = "--group: needs --connect: no group is the hub of the others; start one"


def test_islands_of_a_group() -> None:
    assert [*Group(number=1, of=3).islands(8)] == [1, 4, 7]
    assert [*WHOLE.islands(3)] == [0, 1, 2]
    assert str(Group(number=1, of=3)) == "1/3"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("coordinator archipelago-ring --group 0/2", ALONE),
        ("coordinator archipelago-ring --group 1/9", "must be <= 8, the number of"),
        ("coordinator scenario1 --group 0/2", "scenario1 has no islands to divide"),
        ("coordinator archipelago-ring --group 0/2 --repeats 2", "not for a campaign"),
        ("coordinator archipelago-ring --archipelago a", "no effect without --group"),
        ("run archipelago-ring --coordinators 9", "--coordinators: must be <= 8"),
        ("run archipelago-ring --coordinators 2 --in-process", "--in-process: exclud"),
        ("run archipelago-ring scenario1 --coordinators 2", "not for a campaign"),
    ],
)
def test_groups_that_cannot_be_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, why: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RevolveError, match=why):
        main([*words.split(), "--quiet"])
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("group", ["2/2", "1", "-1/2", "0/0", "a/b", "1/2/3"])
def test_a_group_is_named_by_two_numbers(
    group: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["coordinator", "archipelago-ring", f"--group={group}"])
    line = f"must be K/N in whole numbers with 0 <= K < N, got {group!r}"
    assert line in capsys.readouterr().err


def write(folder: Path, details: RunDetails) -> None:
    with RunFolder(folder / f"group-{details.group.number}", details):
        pass


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            lambda one: replace(one, seed=8),
            "group-1: must be a group of the archipelag",
        ),
        (lambda one: replace(one, archipelago="other"), "group-1: must be a group of"),
        (
            lambda one: replace(one, group=Group(number=1, of=3)),
            "group-1: must be a gr",
        ),
        (lambda _one: None, "group 1/2 is missing"),
    ],
)
def test_groups_of_a_folder_are_those_of_one_archipelago(
    tmp_path: Path, change: Callable[[RunDetails], RunDetails | None], why: str
) -> None:
    other = replace(RING, group=Group(number=1, of=2))
    assert groups_below(tmp_path) == []
    write(tmp_path, RING)
    if (wrong := change(other)) is not None:
        write(tmp_path, wrong)
    with pytest.raises(RunFolderError, match=why):
        groups_below(tmp_path)


def test_a_folder_keeps_group_and_archipelago(tmp_path: Path) -> None:
    write(tmp_path, RING)
    write(tmp_path, replace(RING, group=Group(number=1, of=2)))
    first, second = groups_below(tmp_path)
    assert read_details(first) == RING
    assert read_details(second).group == Group(number=1, of=2)
