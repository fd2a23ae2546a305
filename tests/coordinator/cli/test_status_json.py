"""The document of ``revolve status --json``."""

import json
from pathlib import Path

import pytest

from coordinator.cli.status import main
from coordinator.cli.status_json import Source, status_json
from coordinator.storage.folder import RunDetails, RunFolder
from schema.experiment.file import experiment_text, read_experiment
from schema.wire.status import IslandStatus, PeerFault, Queue, RunStatus, Status

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
        "name": "boss.1",
        "folder": "runs",
        "births": 15,
        "wanted": 25,
        "left_s": 20.0,
        "workers": 2,
        "analyzers": 1,
        "births_per_s": 0.5,
        "faults": [{"kind": "late", "peer": "a", "count": 3}],
        "queues": [
            {"kind": "worker", "waiting": 4, "assigned": 2},
            {"kind": "analyzer", "waiting": 0, "assigned": 1},
            {"kind": "arena", "waiting": 0, "assigned": 0},
        ],
        "silent": {"b": 2},
    }
    assert half == {
        "folder": "/x/half",
        "name": "scenario1",
        "run": 1,
        "state": "running",
        "births": 10,
        "wanted": 20,
        "left_s": 20.0,
        "births_per_s": 0.5,
        "simulated_per_s": 3.0,
        "islands": [
            {
                "births": 10,
                "wanted": 20,
                "best": 0.25,
                "alive": 7,
                "simulated_s": None,
                "is_paused": False,
            }
        ],
    }
    assert (done["state"], done["left_s"], done["islands"][0]["best"]) == (
        "finished",
        0.0,
        None,
    )


def test_the_time_left_is_unknown_without_a_rate() -> None:
    assert RunStatus("/x", "x", 0, "running", 0.0, HALF.islands).left_s is None


def test_a_folder_without_a_coordinator_is_shown_from_disk(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = experiment_text(read_experiment("scenario1"))
    with RunFolder(tmp_path / "run", RunDetails("scenario1", 0, 1, text)):
        pass
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "run.json").write_text("{")
    (tmp_path / "damaged" / "journal.bin").write_bytes(b"")
    assert main(["status", str(tmp_path), "--json"]) == 1
    (one,) = json.loads(capsys.readouterr().out)["coordinators"]
    assert one["name"] is None
    assert one["folder"] == str(tmp_path)
    assert {Path(run["folder"]).name: run["state"] for run in one["runs"]} == {
        "damaged": "damaged",
        "run": "stopped",
    }
    assert one["queues"] == []
