"""What ``revolve status`` shows of runs: its lines, its table, its JSON document."""

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.cli.status import Source, main, show_source, status_json
from coordinator.cli.status_text import fault_lines, group_lines, part_lines, run_table
from coordinator.storage.campaign import Campaign, write_campaign
from coordinator.storage.folder import RunFolder
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.identity import Group
from schema.tables.description import RunDetails
from schema.wire.status import (
    IslandStatus,
    PartStatus,
    PeerFault,
    Queue,
    RunStatus,
    Status,
)

EXPERIMENT = read_experiment("scenario1")
DETAILS = RunDetails("scenario1", 0, 1, experiment_text(EXPERIMENT))


def second_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["status", str(folder)]) == 0
    return capsys.readouterr().out.splitlines()[2]


@pytest.mark.parametrize("is_campaign", [False, True])
def test_a_folder_names_one_in_it_that_has_a_coordinator(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], *, is_campaign: bool
) -> None:
    with RunFolder(tmp_path / "a", DETAILS):
        pass
    assert second_line(tmp_path, capsys) == "no coordinator is running"
    named, run, details = tmp_path / "b", tmp_path / "b", DETAILS
    if is_campaign:
        campaign = Campaign((EXPERIMENT,), 2, 1)
        write_campaign(named, campaign)
        run, details = campaign.runs(named)[0]
    with RunFolder(run, details):
        found = second_line(tmp_path, capsys)
        assert second_line(named, capsys) == "the coordinator does not answer"
    assert found == f"from the files; to ask a coordinator: revolve status {named}"


HALF = RunStatus(
    "/x/half", "scenario1", 1, "running", 0.5, (IslandStatus(10, 20, 0.25, 7),), 3.0
)
DONE = RunStatus(
    "/x/done", "scenario1", 0, "finished", islands=(IslandStatus(5, 5, None, 5),)
)
STATUS = Status(
    (DONE, HALF),
    2,
    1,
    0.5,
    (PeerFault("late", "a", 3),),
    (Queue("worker", 4, 2), Queue("analyzer", 0, 1), Queue("arena", 0, 0)),
    {"b": 2},
)


def test_the_document_has_these_keys_and_values() -> None:
    document = json.loads(status_json([Source(STATUS, "boss.1", "runs")]))
    assert document.keys() == {"version", "coordinators"}
    (one,) = document["coordinators"]
    done, half = one.pop("runs")
    assert one == {
        "name": "boss.1", "folder": "runs", "births": 15, "wanted": 25, "left_s": 20.0,
        "workers": 2, "analyzers": 1, "births_per_s": 0.5,
        "faults": [{"kind": "late", "peer": "a", "count": 3}],
        "queues": [
            {"kind": "worker", "waiting": 4, "assigned": 2},
            {"kind": "analyzer", "waiting": 0, "assigned": 1},
            {"kind": "arena", "waiting": 0, "assigned": 0},
        ],
        "silent": {"b": 2},
    }  # fmt: skip
    island = {"births": 10, "wanted": 20, "best": 0.25, "alive": 7}
    assert half == {
        "folder": "/x/half", "name": "scenario1", "run": 1, "state": "running",
        "births": 10, "wanted": 20, "left_s": 20.0, "births_per_s": 0.5,
        "simulated_per_s": 3.0, "group": {"number": 0, "of": 1},
        "silent_groups": [], "unserved_groups": [],
        "islands": [
            {**island, "simulated_s": None, "is_paused": False, "parts": [],
             "repeats": 0, "awaited": []}
        ],
    }  # fmt: skip
    assert (done["state"], done["left_s"]) == ("finished", 0.0)
    assert done["islands"][0]["best"] is None


def test_an_arena_in_parts_has_a_line() -> None:
    parts = (PartStatus("w0", 1, 0.25, 0), PartStatus("w1", 9, 0.75, 3))
    island = IslandStatus(10, 20, None, 10, 4.0, parts=parts, repeats=1)
    run = RunStatus("/x/a", "scenario3", 0, "running", islands=(island,))
    (line,) = part_lines(Status((run,), 2, 1, 0.0))
    assert line == (
        "arena 0: w0 1 robot (25% of the cost, 0 came), "
        "w1 9 robots (75% of the cost, 3 came); 1 repeated exchange"
    )


def test_a_group_of_islands_says_what_it_waits_for() -> None:
    first_island = IslandStatus(10, 20, None, 10, awaited=(0, 2))
    islands = (first_island, replace(first_island, awaited=(3, 5)))
    half = RunStatus(
        "/x/a", "ring", 0, "running", islands=islands, group=Group(number=1, of=3),
        silent_groups=(2,), unserved_groups=(0, 2),
    )  # fmt: skip
    first = "group 1/3: islands 1, 4 wait for islands 0, 3 of group 0/3"
    second = (
        "group 1/3: islands 1, 4 wait for islands 2, 5 of group 2/3, which does not "
        "answer"
    )
    assert group_lines(half) == [first, second]
    assert group_lines(half, only_silent=True) == [second]
    assert group_lines(replace(half, state="finished", islands=())) == [
        "group 1/3: finished; keeps its migrants for group 0/3",
        "group 1/3: finished; keeps its migrants for group 2/3, which does not answer",
    ]


def test_a_damaged_run_is_shown_beside_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with RunFolder(tmp_path / "run", DETAILS):
        pass
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "run.json").write_text("{")
    (tmp_path / "damaged" / "journal.bin").write_bytes(b"")
    assert main(["status", str(tmp_path), "--json"]) == 1
    (one,) = json.loads(capsys.readouterr().out)["coordinators"]
    assert (one["name"], one["folder"], one["queues"]) == (None, str(tmp_path), [])
    assert {Path(run["folder"]).name: run["state"] for run in one["runs"]} == {
        "damaged": "damaged",
        "run": "stopped",
    }


FAULTS = (
    PeerFault("late", "a", 1),
    PeerFault("late", "b", 3),
    *(PeerFault("malformed", f"peer{number}", 2) for number in range(8)),
)


def test_faults_are_summed_by_kind_with_the_most_frequent_peers() -> None:
    late, malformed = fault_lines(FAULTS)
    assert late == (
        "not used: 4 late: b 3, a 1 (answers to jobs that were already done or "
        "withdrawn, dropped; since the start)"
    )
    assert malformed == (
        "not used: 16 malformed: peer0 2, peer1 2, peer2 2, peer3 2, peer4 2 and 3 "
        "more (malformed messages, dropped; since the start)"
    )
    (other,) = fault_lines((PeerFault("newer", "a", 1),))
    assert other == "not used: 1 newer: a 1 (since the start)"
    assert fault_lines(()) == []


def test_status_names_faults_and_silent_agents(
    capsys: pytest.CaptureFixture[str],
) -> None:
    silent = {"lab-0.1": 2, "lab-1.2": 1}
    show_source(Source(Status((), 1, 1, 0.0, FAULTS, silent=silent), "title"))
    shown = capsys.readouterr().out.splitlines()
    quiet = "no answer and no progress: lab-0.1 holds 2 jobs, lab-1.2 holds 1 job"
    assert shown[3:6] == [quiet, *fault_lines(FAULTS)]
    show_source(Source(Status((), 2, 1, 0.0), "title"))
    assert "no answer" not in capsys.readouterr().out


def test_status_leaves_out_empty_columns(capsys: pytest.CaptureFixture[str]) -> None:
    islands = (IslandStatus(3, 10, 0.5, 2),)
    slow = RunStatus("/r/slow", "a", 0, "finished", 0.0, islands)
    fast = RunStatus("/r/fast", "a", 1, "running", 2.5, islands)
    damaged = RunStatus("/r/bad", "a", 2, "damaged")
    best = ["best", "of", "population,", "arenas"]
    for runs, columns in (
        ((slow, damaged), ["run", "state", "births", *best]),
        ((fast,), ["run", "state", "births", "births/s", *best]),
        ((damaged,), ["run", "state"]),
    ):
        show_source(Source(Status(runs, 0, 0, 0.0), None, "/r"))
        table = capsys.readouterr().out.splitlines()[-1 - len(runs) :]
        assert table[0].split() == columns
        assert [line.split()[0] for line in table[1:]] == [
            run.folder.removeprefix("/r/") for run in runs
        ]


def test_a_run_without_agents_waits_for_them_if_its_coordinator_says_so() -> None:
    running = RunStatus("/runs/a", "a", 0, "running")
    stopped = RunStatus("/runs/b", "b", 0, "stopped")
    for workers, analyzers, state in (
        (0, 0, "waiting for workers and analyzers"),
        (0, 1, "waiting for workers"),
        (2, 0, "waiting for analyzers"),
        (2, 1, "running"),
    ):
        status = Status((running, stopped), workers, analyzers, 0.0)
        for is_live, shown in ((True, state), (False, "running")):
            table = run_table(status, lambda run: run.name, is_live=is_live)
            assert [*table.columns[1].cells] == [shown, "stopped"]
