"""The command ``revolve doctor`` at real hubs."""

import socket
import time
from pathlib import Path

import pytest

from tests.system.fleet import kit_files, make_kit, tls_flags
from tests.system.workspace import (
    PATIENCE_S,
    Workspace,
    address_of,
    free_address,
    runtime_directory,
)

pytestmark = pytest.mark.system

LONGEST_S = 15.0
"""Of a command that is to take five seconds, on a loaded machine."""


def lines_of(
    workspace: Workspace, *words: str, environment: dict[str, str] | None = None
) -> tuple[int, dict[str, str]]:
    """Return exit code and lines of ``revolve doctor``, by subject."""
    process = workspace.start("doctor", *words, environment=environment)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert err == ""
    return process.returncode, {line[6:19].strip(): line for line in out.splitlines()}


def test_a_machine_without_a_hub(workspace: Workspace, tmp_path: Path) -> None:
    here = {"XDG_RUNTIME_DIR": runtime_directory(tmp_path)}
    code, lines = lines_of(workspace, environment=here)
    assert code == 0, lines
    assert lines["hub"].startswith("ok    hub           none is running: ")
    assert lines["versions"].startswith("ok")
    code, lines = lines_of(workspace, "--connect", free_address())
    assert code == 1
    assert "refused" in lines["hub"]


def test_a_hub_that_never_answers_costs_a_few_seconds(workspace: Workspace) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        began_s = time.monotonic()
        code, lines = lines_of(workspace, "--connect", address)
        assert time.monotonic() - began_s < LONGEST_S
    assert code == 1
    assert lines["hub"].startswith("fail")


def test_rights_of_certificates(workspace: Workspace) -> None:
    kit = make_kit(
        workspace.folder / "lab",
        a="worker", boss="operator", chief="coordinator", gone="worker",
    )  # fmt: skip
    kit.revoke("gone")
    address, access = free_address("tls"), ("--access", str(kit.folder / "access.json"))

    def flags(name: str) -> tuple[str, ...]:
        return tls_flags(kit_files(kit.folder, name))

    def seen(name: str, *more: str) -> tuple[int, dict[str, str]]:
        return lines_of(workspace, "--connect", address, *flags(name), *more)

    hub = workspace.start("hub", "--listen", address, *flags("hub"), *access)
    assert "listening" in hub.stderr.readline()
    code, lines = seen("a", *access)
    assert code == 0, lines
    assert "'a', worker, 0 days left" in lines["certificate"]
    assert lines["rights"].endswith("those of worker")
    code, lines = seen("gone", *access)
    assert code == 1
    assert "not in --access" in lines["certificate"]
    assert "revoked" in lines["rights"]
    chief = ("--connect", address, *flags("chief"), "--out", "run")
    run = workspace.start("coordinator", "scenario1", "--quiet", *chief)
    address_of(workspace.folder / "run")
    code, lines = seen("boss")
    assert code == 0, lines
    assert lines["rights"].endswith("those of operator")
    assert lines["coordinators"].split()[2].startswith("chief.")
    assert "round trip" in lines["hub"]
    assert lines["its clock"].startswith("ok")
    run.kill()
    (kit.folder / "members" / "a" / "key.pem").chmod(0o644)
    code, lines = seen("a")
    assert code == 1
    assert "644" in lines["key"]
