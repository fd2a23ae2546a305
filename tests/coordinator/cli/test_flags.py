"""Advice how to resume a run has the flags with which its agents are found again."""

import pytest

from coordinator.cli.flags import parser, resume_flags


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
        ("resume runs/a --fleet lab --connect hub", "--connect hub --fleet lab"),
        ("coordinator scenario1", "--workers 0 --listen hub"),
        (
            "coordinator scenario1 --listen tcp/0.0.0.0:7447 --access access.json",
            "--workers 0 --listen tcp/0.0.0.0:7447 --access access.json",
        ),
        ("coordinator scenario1 --connect hub", "--workers 0 --connect hub"),
    ],
)
def test_resumed_run_has_the_same_agents(line: str, expected: str) -> None:
    command, *words = line.split()
    flags = resume_flags(parser(command).parse_args(words))
    assert " ".join(flags) == expected
    # The advice can be followed.
    parser("resume").parse_args(["runs/a", *flags])
