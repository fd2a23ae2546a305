"""Advice how to resume a run has the flags of its agents, limits and checks.

The address of metrics is read with the flags.
"""

import pytest

from coordinator.cli.flags import parser, resume_flags
from schema.agent.command import check_load


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
