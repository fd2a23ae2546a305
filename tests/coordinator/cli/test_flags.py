"""Flags that a resumed run has, and the source of its plug-ins."""

from pathlib import Path

import pytest

from coordinator.cli.execute import _plan
from coordinator.cli.flags import parser, resume_flags
from coordinator.storage.campaign import Campaign, campaign_plugins, write_campaign
from coordinator.storage.folder import RunFolder, forget_plugins
from schema.agent.command import check_load
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Fitness
from schema.plugins import permission
from schema.plugins.permission import allow, allowed
from schema.tables.description import read_description

pytestmark = pytest.mark.usefixtures("_nothing_allowed")


@pytest.fixture(autouse=True)
def _no_certificates(monkeypatch: pytest.MonkeyPatch) -> None:
    for word in ("CA", "CERTIFICATE", "KEY"):
        monkeypatch.delenv(f"REVOLVE_TLS_{word}", raising=False)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("run scenario1", ""),
        ("run scenario1 --workers 2 --quiet", "--workers 2"),
        ("run scenario1 --in-process", "--in-process"),
        ("run scenario3 --speed 2 --listen hub", "--listen hub --speed 2"),
        ("run scenario3 --arena-workers 3", "--arena-workers 3"),
        ("resume runs/a --fleet lab --connect hub", "--connect hub --fleet lab"),
        ("coordinator scenario1", "--workers 0 --listen hub"),
        (
            "coordinator scenario1 --listen tcp/0.0.0.0:7447 --access access.json",
            "--workers 0 --listen tcp/0.0.0.0:7447 --access access.json",
        ),
        ("coordinator scenario1 --connect hub", "--workers 0 --connect hub"),
        (
            "coordinator scenario1 --wait-limit 1234567.5 --fsync",
            "--workers 0 --listen hub --wait-limit 1234567.5 --fsync",
        ),
        (
            "run scenario3 --workers 9999 --oversubscribe --threads 2 --allow-drift",
            "--workers 9999 --threads 2 --allow-drift --oversubscribe",
        ),
        (
            "resume runs/a --cpu-limit 7200 --wait-limit 0.5 --fsync --in-process",
            "--cpu-limit 7200 --wait-limit 0.5 --in-process --fsync",
        ),
        ("resume runs/a --audit 0.1", "--audit 0.1"),
        (
            "run scenario1 --give-up-after 600 --on-quarantine pause --audit 1",
            "--give-up-after 600 --audit 1 --on-quarantine pause",
        ),
        ("run scenario1 --on-quarantine go-on --audit 0", ""),
    ],
)
def test_resumed_run_has_the_same_agents_and_limits(line: str, expected: str) -> None:
    command, *words = line.split()
    flags = resume_flags(parser(command).parse_args(words))
    assert " ".join(flags) == expected
    # The advice can be followed, and gives the same advice again.
    resume = parser("resume")
    options = resume.parse_args(["runs/a", *flags])
    check_load(resume, "--workers", options.workers or 0, options)
    assert resume_flags(options) == flags


def test_resumed_run_has_the_certificates_of_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("REVOLVE_TLS_CA", "ca.pem")
    run = parser("run")
    shared = run.parse_args(["scenario1", "--connect", "hub", "--tls-key", "key.pem"])
    expected = "--connect hub --tls-ca ca.pem --tls-key key.pem"
    assert " ".join(resume_flags(shared)) == expected
    alone = run.parse_args(["scenario1", "--in-process"])
    assert resume_flags(alone) == ["--in-process"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("9100", ("127.0.0.1", 9100)),
        ("h:0", ("h", 0)),
        ("[::1]:65535", ("[::1]", 65535)),
    ],
)
def test_an_address_of_metrics_is_host_and_port(
    text: str, expected: tuple[str, int]
) -> None:
    options = parser("run").parse_args(["scenario1", "--metrics", text])
    assert options.metrics == expected


@pytest.mark.parametrize(
    "text", ["", "x", ":1", "a:b", "1:2:3", "70000", "h:70000", "\u0663"]
)
def test_an_invalid_address_of_metrics_is_refused(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parser("run").parse_args(["scenario1", "--metrics", text])
    assert "--metrics: must be PORT or HOST:PORT, got" in capsys.readouterr().err


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
