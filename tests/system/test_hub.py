"""A hub of its own: coordinators come and go, and the hub itself does."""

from pathlib import Path

import pytest
import zenoh

from coordinator.storage.compare import compare
from schema.agent.network import client_config
from tests.system.documents import HAMLET, SCENARIO1, SMALL_ARENA
from tests.system.fleet import kit_files, size, tls_flags
from tests.system.machines import Running
from tests.system.test_view import check_curves
from tests.system.workspace import Workspace, free_address, wait_until

pytestmark = [pytest.mark.system, pytest.mark.slow, pytest.mark.timeout(300)]

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
@pytest.mark.timeout(600)
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
