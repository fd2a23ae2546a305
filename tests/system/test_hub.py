"""A hub of its own: coordinators and the hub come and go; what the doctor sees."""

import socket
import time
from pathlib import Path

import pytest
import zenoh

from coordinator.storage.compare import compare
from schema.agent.network import client_config
from tests.system.documents import HAMLET, SCENARIO1, SMALL_ARENA
from tests.system.fleet import kit_files, make_kit, size, tls_flags
from tests.system.machines import Running
from tests.system.test_view import check_curves
from tests.system.workspace import (
    PATIENCE_S,
    Workspace,
    address_of,
    free_address,
    runtime_directory,
    wait_until,
)

pytestmark = pytest.mark.system

PLAIN = ("coordinator", *SCENARIO1)
ARENA = ("coordinator", *HAMLET)


class Site:
    """A machine with a hub, two kinds of runs, and processes that connect to it."""

    def __init__(self, workspace: Workspace) -> None:
        self.folder = workspace.folder
        (self.folder / "hamlet.toml").write_text(SMALL_ARENA)
        self._workspace = workspace
        self._started = 0
        self.hub = self.start("hub")
        self.hub.wait_for("listening on")

    def start(self, *words: str) -> Running:
        self._started += 1
        log = self.folder / f"{self._started}-{words[0]}.log"
        place = {"XDG_RUNTIME_DIR": str(self.folder), "REVOLVE_CONNECT": ""}
        return Running(self._workspace.start(*words, environment=place, log=log), log)

    def restart_hub(self) -> None:
        self.hub.process.kill()
        self.hub.process.wait()
        self.hub = self.start("hub")
        self.hub.wait_for("listening on")

    def wait_for(self, run: str, share: float, reference: Path) -> None:
        """Wait until a run's journal has a share of the size of a reference."""
        least = share * (reference / "journal.bin").stat().st_size
        wait_until(lambda: size(self.folder / run) > least, f"{run} goes on")


@pytest.fixture
def site(workspace: Workspace) -> Site:
    return Site(workspace)


def told_of_hub(process: Running) -> tuple[int, int]:
    """Return how many times a process told that the hub was gone, and back."""
    return process.text.count("; retrying"), process.text.count("reconnected to")


@pytest.mark.long
@pytest.mark.slow
def test_coordinators_and_the_hub_come_and_go(
    site: Site, undisturbed: Path, small_arena_run: Path
) -> None:
    site.start("analyzer")
    workers = [site.start("worker", "--processes", "1") for _ in range(3)]
    # Slow, so that it outlasts the others.
    arena = site.start(*ARENA, "--speed", "0.5", "--out", "arena", "--connect", "hub")
    viewer = site.start("view", "--save", "arena.rrd")
    viewer.wait_for("recording ")
    for name in ("first", "second"):
        plain = site.start(*PLAIN, "--out", name, "--connect", "hub")
        site.wait_for(name, 0.3, undisturbed)
        assert arena.process.poll() is None
        site.restart_hub()
        plain.end()
        assert compare(site.folder / name, undisturbed) == []
    arena.end()
    assert "the run has ended" in viewer.end()
    assert compare(site.folder / "arena", small_arena_run) == []
    check_curves(site.folder / "arena.rrd", small_arena_run)
    for process in (viewer, *workers):
        assert told_of_hub(process) == (2, 2), process.text


@pytest.mark.slow
def test_printed_configuration_opens_a_hub(workspace: Workspace) -> None:
    kit = workspace.folder / "lab"
    workspace.run("cluster", "init", str(kit), "--hub", "127.0.0.1", "--workers", "a")
    address = free_address("tls")
    access = str(kit / "members" / "hub" / "access.json")
    words = ("hub", "--listen", address, "--access", access, "--print-config")
    config = workspace.run(*words, *tls_flags(kit_files(kit, "hub")))
    client = zenoh.Config.from_json5(client_config(address, kit_files(kit, "a")))
    with (
        zenoh.open(zenoh.Config.from_json5(config)) as hub,
        zenoh.open(client) as session,
    ):
        assert list(session.info.routers_zid()) == [hub.info.zid()]


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
