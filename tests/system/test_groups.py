"""Groups of islands on several coordinators have the births of one archipelago."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import zenoh

from coordinator.islands.events import Immigrated
from coordinator.islands.exchange import MigrantsReply
from coordinator.storage.compare import compare
from schema.agent.network import client_config
from schema.agent.service import session_config
from schema.agent.topics import FleetMember
from schema.limits import MIGRANTS_REQUEST_BYTES
from schema.wire.codec import decode, encode
from schema.wire.migration import MigrantsRequest
from tests.system.documents import RING
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Process, Workspace, free_address, wait_until

pytestmark = pytest.mark.system

GROUPS = ("group-0", "group-1")


def coordinator(workspace: Workspace, number: int, address: str) -> Process:
    """Start the coordinator of a group of two, as a user does by hand."""
    words = ("x.toml", "--seed", "3", "--births", "34", "--quiet")
    where = ("--connect", address, "--out", f"two/{GROUPS[number]}")
    return workspace.start("coordinator", *words, "--group", f"{number}/2", *where)


@contextmanager
def liar(address: str) -> Iterator[None]:
    """Answer all requests for migrants falsely, by the keys of a coordinator."""
    member = FleetMember("default", "coordinator", "liar.1")
    config = session_config(client_config(address), member)

    def lie(query: zenoh.Query) -> None:
        assert query.payload is not None
        request = decode(
            MigrantsRequest, query.payload.to_bytes(), MIGRANTS_REQUEST_BYTES
        )
        events = tuple(
            Immigrated(each.target, each.source, each.epoch + 1, ())
            for each in request.needed
        )
        with query:
            query.reply(member.migrants, encode(MigrantsReply(events)))

    with zenoh.open(config) as session:
        told = session.declare_queryable(member.migrants, lie, complete=True)
        yield
        told.undeclare()  # type: ignore[no-untyped-call]


def test_two_groups_have_the_births_of_one_coordinator(workspace: Workspace) -> None:
    whole = workspace.finished(RING, 34, "whole")
    address = free_address()
    workspace.start("hub", "--listen", address)
    folders = [workspace.folder / "two" / name for name in GROUPS]
    groups = [coordinator(workspace, number, address) for number in (0, 1)]
    agents = ("--connect", address, "--processes", "1")
    for role in ("analyzer", "worker"):
        workspace.start(role, *agents)
    wait_until((folders[1] / "journal.bin").exists, "the hub is there")
    with liar(address):
        kill_beyond(groups[0], folders[0], 0.25 * size(whole))
        reached = size(folders[0])
        resumed = ("resume", "two/group-0", "--connect", address, "--quiet")
        groups[0] = workspace.start(*resumed)
        told = "".join(map(end_of, groups))
    assert "migrants: liar.1: migrants that cannot be those of the archipelago" in told
    assert "got those of epoch 1" in told
    assert 0.2 * size(whole) < reached < size(folders[0])
    assert compare(whole, workspace.folder / "two") == []
    told = workspace.run("resume", "two", "--workers", "1", "--quiet")
    assert "two: already finished" in told


def end_of(process: Process) -> str:
    """Wait for the successful end of a process; return what it wrote."""
    wait_until(lambda: process.poll() is not None, "the group ends")
    out, err = process.communicate()
    assert process.returncode == 0, err
    return f"{out}{err}"


def test_one_command_runs_all_groups(workspace: Workspace) -> None:
    whole = workspace.finished(RING, 34, "whole")
    words = ("run", "x.toml", "--seed", "3", "--births", "34", "--coordinators", "3")
    started = workspace.start(*words, "--workers", "2", "--out", "three")
    folders = [workspace.folder / "three" / f"group-{number}" for number in range(3)]
    wait_until(lambda: size(folders[2]) > 0.1 * size(whole), "births")
    states = [each / "state" for each in folders]
    wait_until(lambda: all(state.exists() for state in states), "all groups run")
    started.terminate()
    started.communicate()
    assert started.returncode == 130
    assert {state.read_text() for state in states} == {"stopped"}
    told = workspace.run("status", "three")
    assert "0 of 3 runs finished" in told
    assert "to continue: revolve resume three --workers 2\n" in told
    told = workspace.run("resume", "three", "--workers", "2", "--quiet")
    assert [line.split(":")[0] for line in told.splitlines() if "births" in line] == [
        f"three/group-{number}" for number in range(3)
    ]
    assert compare(whole, workspace.folder / "three") == []
