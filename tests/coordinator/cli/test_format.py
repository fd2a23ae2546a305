"""Lines about faults of peers, and about runs that wait."""

import pytest

from coordinator.cli.format import fault_lines, state_of
from coordinator.cli.status import _show
from coordinator.cli.status_json import Source
from schema.errors import MalformedMessage
from schema.limits import MOST_SHOWN
from schema.wire.operator import (
    OperatorReply,
    decode_operator_reply,
    encode_operator_reply,
)
from schema.wire.status import IslandStatus, PeerFault, RunStatus, Status

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


def test_status_shows_the_faults(capsys: pytest.CaptureFixture[str]) -> None:
    status = Status((), 1, 1, 0.0, FAULTS)
    data = encode_operator_reply(OperatorReply("", status=status))
    received = decode_operator_reply(data).status
    assert received == status
    _show(Source(received, "title"))
    shown = capsys.readouterr().out
    assert all(line in shown for line in fault_lines(FAULTS))


def test_status_names_the_silent_agents(capsys: pytest.CaptureFixture[str]) -> None:
    status = Status((), 2, 1, 0.0, silent={"lab-0.1": 2, "lab-1.2": 1})
    data = encode_operator_reply(OperatorReply("", status=status))
    received = decode_operator_reply(data).status
    assert received == status
    _show(Source(received, "title"))
    line = "no answer and no progress: lab-0.1 holds 2 jobs, lab-1.2 holds 1 job\n"
    assert line in capsys.readouterr().out
    _show(Source(Status((), 2, 1, 0.0), "title"))
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
        _show(Source(Status(runs, 0, 0, 0.0), None, "/r"))
        table = capsys.readouterr().out.splitlines()[-1 - len(runs) :]
        assert table[0].split() == columns
        assert [line.split()[0] for line in table[1:]] == [
            run.folder.removeprefix("/r/") for run in runs
        ]


def test_a_status_with_a_long_name_is_malformed() -> None:
    status = Status((), 1, 1, 0.0, (PeerFault("late", "x" * (MOST_SHOWN + 1), 1),))
    data = encode_operator_reply(OperatorReply("", status=status))
    with pytest.raises(MalformedMessage):
        decode_operator_reply(data)


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
        assert state_of(running, status, is_live=True) == state
        assert state_of(stopped, status, is_live=True) == "stopped"
        assert state_of(running, status, is_live=False) == "running"
