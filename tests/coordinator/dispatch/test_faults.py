"""Counts of faults: by kind and peer, limited, in printable lines."""

from coordinator.dispatch.faults import OTHERS, PeerFaults
from schema.limits import LONGEST_REASON, MOST_PEERS, MOST_SHOWN
from schema.wire.status import PeerFault


def test_faults_are_counted_and_told_once_but_for_late_answers() -> None:
    faults = PeerFaults()
    for kind, peer in (("late", "a"), ("late", "a"), ("malformed", "a"), ("late", "b")):
        assert kind in ("late", "malformed")
        faults.note("late" if kind == "late" else "malformed", peer, "job 7")
    assert faults.counts == (
        PeerFault("late", "a", 2),
        PeerFault("late", "b", 1),
        PeerFault("malformed", "a", 1),
    )
    assert (faults.total("late"), faults.total("refused")) == (3, 0)
    lines = faults.lines()
    assert [line.split(": ")[:2] for line in lines] == [["malformed", "a"]]
    assert "(job 7)" in lines[0]
    faults.note("malformed", "a")
    assert faults.lines() == []


def test_peers_beyond_a_limit_are_counted_together() -> None:
    faults = PeerFaults()
    for number in range(10 * MOST_PEERS):
        faults.note("crowd", f"peer{number}")
        faults.note("late", f"peer{number}")
    assert len(faults.counts) == 2 * (MOST_PEERS + 1)
    assert len(faults.lines()) == MOST_PEERS + 1
    assert faults.total("crowd") == 10 * MOST_PEERS
    assert PeerFault("late", OTHERS, 9 * MOST_PEERS) in faults.counts


def test_names_and_details_are_cut_and_printable() -> None:
    faults = PeerFaults()
    faults.note("malformed", "\x1b[2J\x1b]0;x\x07\n" + "p" * 10**6, "\x9b31m" * 10**6)
    (counted,) = faults.counts
    (line,) = faults.lines()
    assert len(counted.peer) == MOST_SHOWN
    assert len(line) < MOST_SHOWN + LONGEST_REASON + 100
    assert counted.peer.isprintable()
    assert line.isprintable()
