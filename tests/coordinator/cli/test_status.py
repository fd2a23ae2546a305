"""Lines of ``revolve status`` about runs whose coordinator was not asked."""

from pathlib import Path

import pytest

from coordinator.cli.status import main
from coordinator.storage.campaign import Campaign, write_campaign
from coordinator.storage.folder import RunDetails, RunFolder
from schema.experiment.file import experiment_text, read_experiment

EXPERIMENT = read_experiment("scenario1")
DETAILS = RunDetails("scenario1", 0, 1, experiment_text(EXPERIMENT))


def second_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["status", str(folder)]) == 0
    return capsys.readouterr().out.splitlines()[2]


def test_a_folder_of_runs_names_one_that_has_a_coordinator(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with RunFolder(tmp_path / "a", DETAILS):
        pass
    assert second_line(tmp_path, capsys) == "no coordinator is running"
    with RunFolder(tmp_path / "b", DETAILS):
        found = second_line(tmp_path, capsys)
        assert second_line(tmp_path / "b", capsys) == "the coordinator does not answer"
    asks = f"from the files; to ask a coordinator: revolve status {tmp_path / 'b'}"
    assert found == asks


def test_a_folder_of_campaigns_names_one_that_has_a_coordinator(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign = Campaign((EXPERIMENT,), 2, 1)
    folder = tmp_path / "both"
    write_campaign(folder, campaign)
    run, details = campaign.runs(folder)[0]
    with RunFolder(run, details):
        found = second_line(tmp_path, capsys)
        assert second_line(folder, capsys) == "the coordinator does not answer"
    asks = f"from the files; to ask a coordinator: revolve status {folder}"
    assert found == asks
