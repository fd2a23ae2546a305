"""Plug-ins of a campaign: one source for all of its runs."""

from pathlib import Path

import pytest

from coordinator.cli.execute import _plan
from coordinator.storage.campaign import Campaign, campaign_plugins, write_campaign
from coordinator.storage.folder import RunFolder, forget_plugins
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Fitness
from schema.plugins import permission
from schema.plugins.permission import allow, allowed
from schema.tables.description import read_description

pytestmark = pytest.mark.usefixtures("_nothing_allowed")

CAMPAIGN = Campaign(
    (Experiment(name="mine", fitness=Fitness(function="camp_lab:far")),), 2, 5
)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an allowed file with a fitness function."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    file = tmp_path / "camp_lab.py"
    file.write_text("far = 1\n")
    allow([str(file)])
    return file


def test_all_runs_of_a_campaign_have_the_source_of_its_start(
    tmp_path: Path, lab: Path
) -> None:
    folder = tmp_path / "c"
    write_campaign(folder, CAMPAIGN)
    digests = [campaign_plugins(folder)["camp_lab"].digest]
    for path, details in CAMPAIGN.runs(folder):
        lab.write_text(f"far = '{path.name}'\n")
        with RunFolder(path, details):
            digests.append(read_description(path).plugins["camp_lab"].digest)
        assert (path / "plugins" / "camp_lab.py").read_text() == "far = 1\n"
    assert len(set(digests)) == 1
    assert allowed() == (f"camp_lab={folder}/plugins/camp_lab.py",)


def test_a_run_that_was_made_with_another_source_is_not_continued(
    tmp_path: Path, lab: Path
) -> None:
    folder = tmp_path / "c"
    (path, details), _ = CAMPAIGN.runs(folder)
    with RunFolder(path, details):
        pass
    planned, _ = _plan(folder, CAMPAIGN)
    planned[0].take().close()
    permission._copies.clear()
    lab.write_text("far = 2\n")
    planned, _ = _plan(folder, CAMPAIGN)
    with pytest.raises(ExperimentError, match=r"plug-in camp_lab: has source digest"):
        planned[0].take()
    planned[1].take().close()


def test_a_file_of_the_user_is_not_removed(tmp_path: Path, lab: Path) -> None:
    """A campaign may be in the folder of its experiment."""
    own = tmp_path / "plugins" / "camp_lab.py"
    own.parent.mkdir()
    lab.rename(own)
    permission._allowed.clear()
    allow([str(own)])
    write_campaign(tmp_path, CAMPAIGN)
    forget_plugins(tmp_path, campaign_plugins(tmp_path))
    assert own.read_text() == "far = 1\n"
