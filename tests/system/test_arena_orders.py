"""Tests of orders to a running arena and of its live stream."""

import json
import shutil
from pathlib import Path

import pytest
import zenoh
from msgspec import convert

import revolve as rv
from coordinator.islands.events import Advanced, Commanded
from coordinator.storage.compare import compare
from coordinator.storage.journal import Journal
from schema.agent.network import client_config
from schema.limits import LIVE_BYTES
from schema.tables.files import read_table
from schema.wire.arena import Live
from schema.wire.codec import decode
from schema.wire.poses import PoseArrays
from tests.system.workspace import Workspace, address_of, wait_until

pytestmark = pytest.mark.system

CRITTERS = Path(__file__).parents[1] / "plugins" / "critters_lab" / "critters"
PISTONS = """
name = "mine"
births = 20
[selection]
population = 8
[space]
part_types = ["schema.parts:CORE", "bodies:PISTON"]
[simulation]
warmup_steps = 600
window_steps = 1200
[arena]
birth_interval_s = 4.0
sample_interval_s = 2.0
"""


def test_pause_list_insert_remove_snapshot_resume(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path
) -> None:
    folder = crowded_arena_workspace.folder / "run"
    words = ("crowd.toml", "--seed", "4", "--quiet", "--out", "run")
    flags = ("--workers", "1", "--speed", "8", "--listen", "tcp/127.0.0.1:0")
    coordinator = crowded_arena_workspace.start("run", *words, *flags)
    address = address_of(folder)

    def arena(*more: str, code: int = 0) -> str:
        text = crowded_arena_workspace.run(
            "arena", *more, "--connect", address, code=code
        )
        return str(text)

    received: list[Live] = []

    def watch(sample: zenoh.Sample) -> None:
        received.append(decode(Live, sample.payload.to_bytes(), LIVE_BYTES))

    config = zenoh.Config.from_json5(client_config(address))
    with zenoh.open(config) as session:
        key = "revolve/default/w/*/arena/0/pose"
        _subscriber = session.declare_subscriber(key, watch)
        wait_until(lambda: len(received) > 10, "live poses of the arena arrive")
        assert "takes effect at" in arena("pause")
        wait_until(lambda: arena("list").startswith("paused"), "the arena pauses")
        before = arena("list")
        first = before.splitlines()[2].split()[0]
        refused = arena("remove", "999", code=1)
        assert f"arena of {folder}" in refused
        assert "is not alive" in refused
        arena("remove", first)
        crowded_arena_workspace.run(
            "robot", "convert", str(crowded_arena_run / "best.yaml"), "guest.pb"
        )
        arena("insert", "guest.pb", "--place", "0.1", "0.2")
        arena("snapshot")
        guest = rv.Robot.read(crowded_arena_run / "best.yaml")
        orders_of_python(rv.Arena(folder), guest, arena("list", "--json"))
        arena("resume")
        wait_until(lambda: coordinator.poll() is not None, "the run ends")
    assert coordinator.returncode == 0, coordinator.communicate()
    assert compare(crowded_arena_run, folder) != []
    assert "removed" in read_table(folder, "deaths")["reason"].to_pylist()
    with Journal.open(folder) as journal:
        events = journal.replay()
    orders = [type(e.order).__name__ for e in events if isinstance(e, Commanded)]
    assert orders == ["Pause", "Remove", "Insert", "Insert", "Resume"]
    births = read_table(folder, "births").to_pylist()
    (child,) = [row for row in births if (row["x"], row["y"]) == (0.3, -0.3)]
    parents = [each["birth"] for each in child["parents"]]
    ranks = [row["rank"] for row in births if row["birth"] in parents]
    assert (len(parents), child["rank"]) == (2, 1 + max(ranks))
    # Live advances equal those of the journal and the tables.
    known = {e.advance.step: e for e in events if isinstance(e, Advanced)}
    for live in received:
        event = known[live.advance.step]
        assert live.advance.digest == event.advance.digest
        assert len(PoseArrays.received(live.advance.poses).births) == event.pose_rows


def orders_of_python(arena: rv.Arena, guest: rv.Robot, document: str) -> None:
    """Compare the listing with that of the command; insert a child of two robots."""
    listing = arena.listing()
    listed = json.loads(document.partition("arena of")[0])
    assert convert(listed["robots"], tuple[rv.ListedRobot, ...]) == listing.robots
    assert (listing.is_paused, listing.wanted) == (True, 25)
    first, second = listing.robots[:2]
    for robot, parents, why in (
        (guest, (999,), "birth 999: is not alive; alive are "),
        (guest, (first, second, first), "must be at most 2 robots"),
        ("guest.yaml", (), "Robot.read reads a file"),
    ):
        with pytest.raises(rv.RevolveError, match=why):
            arena.insert(robot, parents=parents)  # type: ignore[arg-type]
    effect_s = arena.insert(guest, (0.3, -0.3), (first, second.birth.number))
    assert effect_s == listing.sim_time_s
    child = arena.robots()[-1]
    assert (child.parents, child.place) == ((first.birth, second.birth), (0.3, -0.3))


def test_robot_with_its_own_part_types_is_inserted(workspace: Workspace) -> None:
    shutil.copy(CRITTERS / "bodies.py", workspace.folder)
    (workspace.folder / "mine.toml").write_text(PISTONS)
    folder = workspace.folder / "run"
    flags = ("--workers", "1", "--speed", "8", "--listen", "tcp/127.0.0.1:0")
    coordinator = workspace.start("run", "mine.toml", "--quiet", "--out", "run", *flags)
    address_of(folder)
    words = ("robot", "random", "guest.yaml", "--experiment", "mine.toml")
    workspace.run(*words, "--seed", "3")
    assert "Piston" in (workspace.folder / "guest.yaml").read_text()
    insert = ("arena", "insert", "guest.yaml", "--connect", "run")
    assert "--experiment FILE.toml" in workspace.run(*insert, code=2)
    answer = workspace.run(*insert, "--experiment", "mine.toml")
    assert "takes effect at" in answer
    wait_until(lambda: coordinator.poll() is not None, "the run ends")
    assert coordinator.returncode == 0, coordinator.communicate()
    assert [] in read_table(folder, "births")["parents"].to_pylist()[8:]
