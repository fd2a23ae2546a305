"""Orders of operators: which run and which robots they go to."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.arena.arena import Arena
from coordinator.islands.events import Commanded, Remove, ReplaceBrain
from coordinator.run.operators import _run, answer_operator, reply_to
from coordinator.run.scheduler import Planned, RunScheduler
from coordinator.storage.folder import RunFolder
from coordinator.storage.folder_status import unbegun_status
from schema.experiment.file import experiment_text
from schema.robot.ids import BirthId
from schema.tables.description import RunDetails
from schema.wire.codec import encode
from schema.wire.operator import (
    ListRobots,
    OperatorAction,
    OperatorReply,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    SetBrain,
    decode_operator_reply,
)
from tests.coordinator.archipelago_run import ARENA, migrating
from tests.coordinator.arena_world import experiment
from tests.coordinator.run.test_scheduler import local, scheduler_of

DETAILS = RunDetails("arena", 0, 1, experiment_text(experiment(30)))


def planned(path: Path, *, is_finished: bool = False) -> Planned:
    """Return the plan of a run of an arena in a folder."""
    status = unbegun_status(path, DETAILS)
    if is_finished:
        status = replace(status, state="finished")
    return Planned(status, lambda: RunFolder(path, DETAILS))


@contextmanager
def started(*runs: Planned) -> Iterator[RunScheduler]:
    """Start runs; a run starts when few requests of those before it are open."""
    scheduler = scheduler_of(list(runs), local())
    while len(scheduler.active) < sum(not run.is_finished for run in runs):
        scheduler.turn(0.0, lambda: 0.0)
    try:
        yield scheduler
    finally:
        scheduler.close()


def ask(scheduler: RunScheduler, name: str, island: int = 0) -> OperatorReply:
    request = OperatorRequest("x", island, PauseArena(), name)
    data = answer_operator(scheduler, encode(request), 0.0)
    return decode_operator_reply(data)


@pytest.mark.parametrize("given", [".", "link", "real"])
def test_a_run_is_named_by_its_folder_without_links(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str
) -> None:
    real = tmp_path / "real"
    real.mkdir()
    (tmp_path / "link").symlink_to(real)
    monkeypatch.chdir(real if given == "." else tmp_path)
    with started(planned(Path(given))) as scheduler:
        (run,) = scheduler.status(0.0).runs
        assert Path(run.folder).name == "real"
        refused = ask(scheduler, "other")
        assert refused.is_refused
        reply = ask(scheduler, "real")
        assert not reply.is_refused, reply.text
        refused = ask(scheduler, "real", 7)
        assert refused.text == "island 7: no arena of this run; arenas are [0]"


def test_a_run_is_named_by_its_whole_name_or_the_end_of_it(tmp_path: Path) -> None:
    runs = [planned(tmp_path / name) for name in ("zoo-0", "wet-zoo-0")]
    with started(*runs) as scheduler:
        for name, run in zip(("zoo-0", "t-zoo-0"), scheduler.active, strict=True):
            assert _run(name, scheduler) is run
        for name in ("o-0", ""):
            assert ask(scheduler, name).text.endswith("matching: wet-zoo-0, zoo-0")


def test_the_name_of_a_finished_run_is_not_the_end_of_another(tmp_path: Path) -> None:
    finished = planned(tmp_path / "zoo-0", is_finished=True)
    with started(finished, planned(tmp_path / "wet-zoo-0")) as scheduler:
        assert ask(scheduler, "zoo-0").text.endswith("matching: none")
        assert not ask(scheduler, "o-0").is_refused


def test_an_immigrant_is_listed_and_removed_by_its_whole_name() -> None:
    island = replace(ARENA, births=24)
    lived = migrating(island, island, handling="evict", replaced="none")
    arena = lived.islands[1]
    assert isinstance(arena, Arena)
    births: list[BirthId] = []
    while not any(birth.island == 0 for birth in births):
        lived.live(1)
        births = [one.birth for one in arena.population]
    orders: list[Commanded] = []
    loop: Any = SimpleNamespace(islands=lived.islands, order=orders.append)

    def ask(action: OperatorAction) -> OperatorReply:
        return reply_to(OperatorRequest("x", 1, action), loop)

    names = [
        f"0:{one.number}" if one.island == 0 else str(one.number) for one in births
    ]
    listing = ask(ListRobots()).arena
    assert listing is not None
    assert [one.birth for one in listing.robots] == births
    rows = {(row["island"], row["birth"]): row for row in lived.rows("births")}
    for one in listing.robots:
        row = rows[one.birth]
        parents = [(each["island"], each["birth"]) for each in row["parents"]]
        assert (one.rank, [*one.parents]) == (row["rank"], parents)
    mature = {one.birth for one in arena.judged}
    assert {one.birth for one in listing.robots if one.fitness is not None} == mature
    refused = ask(RemoveRobot(BirthId(0, 99)))
    assert refused.text == (f"birth 0:99: is not alive; alive are {', '.join(names)}")
    assert ask(RemoveRobot(BirthId(1, 99))).text.startswith("birth 99: is not alive")
    immigrant = next(one for one in births if one.island == 0)
    living = arena.living.get(immigrant)
    assert living is not None
    robot = living.robot
    assert not ask(SetBrain(immigrant, robot)).is_refused
    assert not ask(RemoveRobot(immigrant)).is_refused
    wanted = [ReplaceBrain(immigrant, robot.brain), Remove(immigrant)]
    assert [order.order for order in orders] == wanted
    for name, order in zip("ab", orders, strict=True):
        lived.tell(1, replace(order, command_id=name))
    lived.live()
    (death,) = [row for row in lived.rows("deaths") if row["reason"] == "removed"]
    assert (death["birth_island"], death["birth"]) == (0, immigrant.number)
