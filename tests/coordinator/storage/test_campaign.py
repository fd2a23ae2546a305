"""Campaigns, and the commands that resume runs."""

import shlex
from dataclasses import replace as changed
from hashlib import sha256
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.cli.status_text import about_arenas, best_text, duration
from coordinator.run.session import RateMeter
from coordinator.storage.campaign import (
    Campaign,
    check_adopted,
    checked_experiments,
    is_campaign,
    joined_name,
    read_campaign,
    read_drafts,
    refuse_used,
    shipped_campaigns,
    write_campaign,
)
from coordinator.storage.folder import RunFolder
from coordinator.storage.hints import (
    FLAGS,
    command,
    keep_flags,
    resume_command,
    stopped,
)
from schema.errors import ExperimentError, RunFolderError
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.sweep import Sweep
from schema.tables.description import RunDetails
from schema.wire.status import IslandStatus, RunStatus

FIRST, SECOND = read_experiment("scenario1"), read_experiment("no-selection")
CAMPAIGN = Campaign((FIRST, SECOND), 3, 5)


def test_the_name_of_a_sweep_counts_once_and_a_long_name_is_cut() -> None:
    sweep = Sweep(settings={"births": (20, 30)}, chosen={"births": 20})
    points = [replace(FIRST, name=f"lhs-{i:02}", sweep=sweep) for i in range(20)]
    assert joined_name([*points, SECOND]) == "lhs+no-selection"
    assert joined_name([FIRST, SECOND]) == "scenario1+no-selection"
    long = [replace(FIRST, name=letter * 45) for letter in "abcd"]
    assert joined_name(long) == f"{'a' * 45}+{'b' * 45}+2-more"
    assert joined_name([replace(FIRST, name="x" * 200)]) == "x" * 200


def test_runs_are_ordered_repeat_by_repeat(tmp_path: Path) -> None:
    runs = CAMPAIGN.runs(tmp_path)
    assert [path.name for path, _ in runs] == [
        "scenario1-0", "no-selection-0", "scenario1-1", "no-selection-1",
        "scenario1-2", "no-selection-2",
    ]  # fmt: skip
    assert [(details.name, details.run) for _, details in runs[2:4]] == [
        ("scenario1", 1),
        ("no-selection", 1),
    ]
    assert {details.seed for _, details in runs} == {5}


def test_the_thesis_campaign_has_five_experiments() -> None:
    names = [
        experiment.name for experiment in checked_experiments(read_drafts(["thesis"]))
    ]
    assert names == list(shipped_campaigns()["thesis"])
    assert set(names) == {
        "scenario1", "scenario2", "scenario3", "no-selection", "no-reproduction",
    }  # fmt: skip


def test_a_campaign_is_read_as_it_was_written(tmp_path: Path) -> None:
    odd = replace(FIRST, name="it's \"odd\" ''' \\")
    campaign = Campaign((odd, replace(SECOND, births=77)), 3, 5)
    assert not is_campaign(tmp_path)
    write_campaign(tmp_path, campaign)
    assert is_campaign(tmp_path)
    assert read_campaign(tmp_path) == campaign


def test_later_repeats_are_runs_of_a_longer_campaign(tmp_path: Path) -> None:
    later = changed(CAMPAIGN, repeats=2, first=1)
    assert later.runs(tmp_path) == CAMPAIGN.runs(tmp_path)[2:]
    write_campaign(tmp_path, later)
    assert read_campaign(tmp_path) == later
    text = (tmp_path / "campaign.toml").read_text()
    (tmp_path / "campaign.toml").write_text(text.replace("first = 1", "first = 2"))
    with pytest.raises(RunFolderError, match="digest"):
        read_campaign(tmp_path)


def test_a_campaign_from_the_first_repeat_is_written_as_before(tmp_path: Path) -> None:
    write_campaign(tmp_path, CAMPAIGN)
    lines = (tmp_path / "campaign.toml").read_text().splitlines()
    assert lines[2:5] == ["seed = 5", "repeats = 3", ""]
    text = "\n".join(["5", "3", *map(experiment_text, CAMPAIGN.experiments)])
    assert lines[1] == f'digest = "{sha256(text.encode()).hexdigest()}"'


def test_a_used_folder_is_refused(tmp_path: Path) -> None:
    refuse_used(tmp_path, CAMPAIGN)
    write_campaign(tmp_path, CAMPAIGN)
    with pytest.raises(RunFolderError, match="revolve resume"):
        refuse_used(tmp_path, CAMPAIGN)
    with RunFolder(tmp_path / "run", RunDetails("a", 0, 1, "{}")):
        pass
    with pytest.raises(RunFolderError, match="already holds a run"):
        refuse_used(tmp_path / "run", CAMPAIGN)


@pytest.mark.parametrize("text", ["", "seed = 1", "seed = ", "experiments = 3"])
def test_a_damaged_campaign_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "campaign.toml").write_text(text)
    with pytest.raises(RunFolderError, match=r"campaign\.toml: damaged: "):
        read_campaign(tmp_path)


@pytest.mark.parametrize(
    "sources", [["scenario1", "scenario1"], ["thesis", "scenario3"]]
)
def test_names_must_differ(sources: list[str]) -> None:
    with pytest.raises(ExperimentError, match="must have different names"):
        checked_experiments(read_drafts(sources))


WANTED = RunDetails("scenario1", 1, 5, experiment_text(FIRST))


@pytest.mark.parametrize("births", [FIRST.births, 600])
def test_a_run_of_any_number_of_births_is_adopted(tmp_path: Path, births: int) -> None:
    document = experiment_text(replace(FIRST, births=births))
    check_adopted(tmp_path, replace(WANTED, document=document), WANTED)


@pytest.mark.parametrize(
    "other",
    [
        replace(WANTED, run=2),
        replace(WANTED, seed=6),
        replace(
            WANTED,
            document=experiment_text(
                replace(FIRST, selection=replace(FIRST.selection, children=9))
            ),
        ),
    ],
    ids=["another repeat", "another seed", "another experiment"],
)
def test_another_run_is_refused(tmp_path: Path, other: RunDetails) -> None:
    with pytest.raises(RunFolderError, match="must be run 1 of seed 5"):
        check_adopted(tmp_path, other, WANTED)


def test_a_rate_covers_the_last_seconds() -> None:
    meter = RateMeter()
    assert meter.per_s == 0.0
    meter.note(0.0, 1000)
    assert meter.per_s == 0.0
    for second in range(1, 131):
        meter.note(
            float(second), 1000 + (50 if second <= 70 else 50 + 3 * (second - 70))
        )
    assert meter.per_s == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (None, "?"),
        (0.0, "0 s"),
        (59.4, "59 s"),
        (61.0, "1 min 01 s"),
        (3600.0 + 5 * 60, "1 h 05 min"),
        (3 * 86400.0 + 7200, "3 d 2 h"),
    ],
)
def test_durations_in_words(seconds: float | None, said: str) -> None:
    assert duration(seconds) == said


def test_a_command_can_be_pasted() -> None:
    said = command("resume", Path("runs/it's mine"))
    assert shlex.split(said) == ["revolve", "resume", "runs/it's mine"]


def test_the_best_fitness_of_few_islands_is_shown_per_island() -> None:
    islands = (IslandStatus(1, 9, 0.25, 3), IslandStatus(0, 9, None, 0))
    run = RunStatus("a", "a", 0, "running", islands=islands)
    assert best_text(islands) == "best 0.250 -"
    assert best_text(islands[1:]) == "best -"
    assert about_arenas(run) == ""
    arena = IslandStatus(1, 9, 0.5, 4, simulated_s=20.0, is_paused=True)
    both = replace(run, islands=(*islands, arena))
    assert about_arenas(both) == ", 20 s simulated, 4 alive, paused"


def test_the_kept_flags_give_the_same_command_as_the_message(tmp_path: Path) -> None:
    flags = ["--workers", "0", "--listen", "hub", "--tls-ca", "my files/ca.pem"]
    keep_flags(tmp_path, flags)
    assert stopped(tmp_path, flags) == f"stopped; to resume: {resume_command(tmp_path)}"
    assert resume_command(tmp_path).endswith("--listen hub --tls-ca 'my files/ca.pem'")
    keep_flags(tmp_path, [])
    assert resume_command(tmp_path) == f"revolve resume {tmp_path}"


def test_a_missing_or_damaged_file_gives_no_flags(tmp_path: Path) -> None:
    alone = f"revolve resume {tmp_path}"
    assert resume_command(tmp_path) == alone
    (tmp_path / FLAGS).write_bytes(b"\xff")
    assert resume_command(tmp_path) == alone
    (tmp_path / FLAGS).write_bytes(b"x" * 5000)
    assert resume_command(tmp_path) == alone
    (tmp_path / FLAGS).write_text("a\x1b[2J\n")
    assert resume_command(tmp_path) == f"{alone} 'a [2J'"
