"""Kits of a lab: certificates (checked by openssl), access list, samples."""

import os
import shutil
import stat
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import yaml
from cryptography import x509

from coordinator.cluster.command import main
from coordinator.cluster.kit import ClusterKit, Kit, utc_now
from schema.agent.access import read_certificates
from schema.agent.certificate import certificate_name
from schema.errors import RevolveError


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = datetime.now(UTC).replace(microsecond=0)

    def __call__(self) -> datetime:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def kit(tmp_path: Path, clock: Clock) -> Kit:
    made = Kit.new(tmp_path / "lab", ClusterKit("hub.example", 7447, 90), clock)
    made.add("a", "worker")
    made.add("boss", "operator")
    return made


def accepted(kit: Kit) -> dict[str, str]:
    listed = read_certificates(kit.folder / "access.json")
    return {each.name: each.role for each in listed}


def expiry(file: Path) -> datetime:
    return x509.load_pem_x509_certificate(file.read_bytes()).not_valid_after_utc


def openssl(*words: str | Path) -> str:
    done = subprocess.run(
        ["openssl", *map(str, words)], check=True, capture_output=True, text=True
    )
    return done.stdout


def test_certificates_are_valid_for_both_sides(kit: Kit, clock: Clock) -> None:
    for name in ("hub", "a", "boss"):
        file = kit.folder / "members" / name / "certificate.pem"
        for purpose in ("sslclient", "sslserver"):
            openssl(
                "verify", "-purpose", purpose, "-CAfile", kit.folder / "ca.pem", file
            )
        assert certificate_name(str(file)) == name
        assert expiry(file) == clock.now + timedelta(days=90)
    text = openssl("x509", "-in", kit.folder / "members/hub/certificate.pem", "-text")
    assert "DNS:hub.example" in text
    assert "CA:FALSE" in text


def test_private_keys_are_private(kit: Kit) -> None:
    keys = [kit.folder / "ca.key", *kit.folder.glob("members/*/key.pem")]
    assert len(keys) == 4
    for key in keys:
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
        assert "BEGIN PRIVATE KEY" in key.read_text(), "PKCS#8, as the hub needs it"


def test_revoked_certificate_is_not_accepted(kit: Kit) -> None:
    assert accepted(kit) == {"a": "worker", "boss": "operator"}
    kit.revoke("a")
    assert accepted(kit) == {"boss": "operator"}
    again = Kit.read(kit.folder, kit.cluster.members[0].expires.now)
    assert again.member("a").is_revoked
    with pytest.raises(RevolveError, match="revoked"):
        again.renew("a")
    with pytest.raises(RevolveError, match="make a new kit"):
        kit.revoke("hub")
    with pytest.raises(RevolveError, match="not empty"):
        Kit.new(kit.folder, ClusterKit("h", 1, 1), utc_now)


def test_revoked_name_is_free_only_when_its_certificate_has_expired(
    kit: Kit, clock: Clock
) -> None:
    kit.revoke("a")
    with pytest.raises(RevolveError, match="would be accepted again until"):
        kit.add("a", "worker")
    clock.now += timedelta(days=91)
    kit.add("a", "worker")
    assert accepted(kit)["a"] == "worker"
    assert [member.name for member in kit.cluster.members].count("a") == 1


def test_renewal_moves_the_expiry(kit: Kit, clock: Clock) -> None:
    clock.now += timedelta(days=60)
    kit.renew("a")
    file = kit.folder / "members/a/certificate.pem"
    assert expiry(file) == clock.now + timedelta(days=90)
    assert kit.member("a").expires == clock.now + timedelta(days=90)
    assert kit.member("boss").expires == clock.now + timedelta(days=30)


def test_no_certificate_outlives_its_authority(kit: Kit, clock: Clock) -> None:
    end = clock.now + timedelta(days=3650)
    clock.now = end - timedelta(days=1)
    kit.renew("a")
    assert expiry(kit.folder / "ca.pem") == end
    assert expiry(kit.folder / "members/a/certificate.pem") == end
    assert kit.member("a").expires == end
    clock.now = end
    with pytest.raises(RevolveError, match="authority: has expired: make a new kit"):
        kit.renew("a")


@pytest.mark.parametrize("name", ["a", "a-1", "hub", "x/y", "", "-"])
def test_name_that_clashes_or_is_invalid_is_refused(kit: Kit, name: str) -> None:
    with pytest.raises(RevolveError):
        kit.add(name, "worker")
    assert accepted(kit) == {"a": "worker", "boss": "operator"}


@pytest.mark.parametrize("content", [b"", b"{", b'{"hub": 1}', b"\xff"])
def test_damaged_list_is_named(kit: Kit, clock: Clock, content: bytes) -> None:
    (kit.folder / "cluster.json").write_bytes(content)
    with pytest.raises(RevolveError, match=r"cluster\.json: cannot be read"):
        Kit.read(kit.folder, clock)


def test_command_makes_a_kit_and_lists_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = str(tmp_path / "lab")
    words = ["cluster", "init", lab, "--hub", "hub.example", "--workers", "a,b,c"]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "on a, b, c:\n  revolve worker\n" in told
    assert main(["cluster", "revoke", lab, "b"]) == 0
    assert main(["cluster", "add", lab, "viewer2", "--role", "viewer"]) == 0
    assert "restart it" in capsys.readouterr().out
    assert main(["cluster", "list", lab]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "hub at tls/hub.example:7447"
    assert [line.split()[0] for line in lines[1:]] == [
        "hub", "coordinator", "analyzer", "viewer", "operator",
        "a", "b", "c", "viewer2",
    ]  # fmt: skip
    assert next(line for line in lines if "revoked" in line).startswith("b ")
    environment = (tmp_path / "lab/members/a/env").read_text()
    assert "export REVOLVE_CONNECT=tls/hub.example:7447\n" in environment


_NO_PORT = "without a port (see --port), got"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        *((f"--hub={hub}", _NO_PORT) for hub in ("127.0.0.1:7449", "tls/h", "a b", "")),
        ("--hub h --days 3651", "--days: must be a whole number in 1..3650"),
        ("--hub h --workers a,a", "'a': two certificates"),
        ("--hub h --workers a,a-1", "names must not begin"),
        ("--hub h --workers operator", "'operator': two certificates"),
        ("--hub h --workers hub", "'hub': two certificates"),
        ("--hub h --workers b,x/y", "must be 1 to 96 letters"),
    ],
)
def test_a_kit_with_wrong_settings_is_not_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, message: str
) -> None:
    lab = tmp_path / "lab"
    given = [words] if words.startswith("--hub=") else words.split()
    with pytest.raises((SystemExit, RevolveError)) as refused:
        main(["cluster", "init", str(lab), *given])
    assert message in capsys.readouterr().err + str(refused.value)
    assert not lab.exists()


def test_a_hub_may_have_an_address_of_version_6(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = str(tmp_path / "lab")
    assert main(["cluster", "init", lab, "--hub", "2001:db8::7"]) == 0
    text = openssl("x509", "-in", f"{lab}/members/hub/certificate.pem", "-text")
    assert "IP Address:2001:DB8:0:0:0:0:0:7" in text
    capsys.readouterr()
    assert main(["cluster", "list", lab]) == 0
    assert capsys.readouterr().out.startswith("hub at tls/[2001:db8::7]:7447\n")


@pytest.fixture
def samples(tmp_path: Path) -> Path:
    main(["cluster", "init", str(tmp_path / "lab"), "--hub", "hub.example"])
    return tmp_path / "lab" / "samples"


def test_samples_have_no_gaps(samples: Path) -> None:
    names = {path.name for path in samples.iterdir()}
    assert names == {
        "revolve-hub.service", "revolve-worker.service", "workers.slurm",
        "coordinators.slurm", "compose.yaml", "Dockerfile", "worker.def",
    }  # fmt: skip
    for path in samples.iterdir():
        assert "@" not in path.read_text().replace("B:USR1@60", "").replace('"$@"', "")
    service = yaml.safe_load((samples / "compose.yaml").read_text())["services"][
        "worker"
    ]
    assert service["environment"]["REVOLVE_CONNECT"] == "tls/hub.example:7447"


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="no systemd")
def test_systemd_accepts_the_units(samples: Path, tmp_path: Path) -> None:
    for unit in samples.glob("*.service"):
        text = unit.read_text().replace("ExecStart=revolve", "ExecStart=/bin/true")
        unit.write_text(text)
        done = subprocess.run(
            ["systemd-analyze", "verify", "--user", str(unit)],
            env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")


STAND_IN = """#!/bin/sh
echo "$(basename "$0") $*" >> "$LOG"
if [ "$(basename "$0")" = srun ]; then shift; exec sleep 60; fi
"""


@pytest.mark.parametrize(
    ("signal", "code", "calls"),
    [("USR1", 0, "scontrol requeue 7_3"), ("TERM", 143, "")],
)
def test_slurm_task_stops_its_workers_and_requeues(
    samples: Path, tmp_path: Path, signal: str, code: int, calls: str
) -> None:
    ended, made = slurm_task(samples / "workers.slurm", tmp_path, signal)
    assert ended == code
    assert made[0] == "srun revolve worker --processes 4 --give-up-after 600"
    assert "".join(made[1:]) == calls


@pytest.mark.parametrize("is_begun", [False, True])
def test_slurm_task_begins_a_group_of_islands_or_resumes_it(
    samples: Path, tmp_path: Path, *, is_begun: bool
) -> None:
    out = tmp_path / "runs" / "group-3"
    if is_begun:
        out.mkdir(parents=True)
        (out / "run.json").touch()
    sample, words = samples / "coordinators.slurm", ("my ring.toml", "--seed", "1")
    ended, made = slurm_task(sample, tmp_path, "USR1", *words)
    begin = f"coordinator my ring.toml --seed 1 --group 3/8 --out {out}"
    what = f"resume {out}" if is_begun else begin
    connect = "--connect tls/hub.example:7447 --give-up-after 600"
    assert ended == 0
    assert made == [f"srun revolve {what} {connect}", "scontrol requeue 7_3"]


def slurm_task(
    sample: Path, tmp_path: Path, signal: str, *words: str
) -> tuple[int, list[str]]:
    """Send a signal to a task once it runs; return its code and the calls it made."""
    tools, log = tmp_path / "tools", tmp_path / "log"
    tools.mkdir()
    for name in ("srun", "scontrol"):
        (tools / name).write_text(STAND_IN)
        (tools / name).chmod(0o755)
    home = tmp_path / "home" / ".config" / "revolve"
    home.mkdir(parents=True)
    (home / "env").write_text("export REVOLVE_CONNECT=tls/hub.example:7447\n")
    log.touch()
    with subprocess.Popen(
        ["bash", str(sample), *words],
        env={
            "OUT": str(tmp_path / "runs"), "SLURM_ARRAY_TASK_COUNT": "8",
            "PATH": f"{tools}:{os.environ['PATH']}", "HOME": str(tmp_path / "home"),
            "LOG": str(log), "SLURM_CPUS_PER_TASK": "4",
            "SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "3",
        },
    ) as task:  # fmt: skip
        while "srun" not in log.read_text():
            assert task.poll() is None
        subprocess.run(["bash", "-c", f"kill -{signal} {task.pid}"], check=True)
        code = task.wait(30)
    return code, log.read_text().splitlines()
