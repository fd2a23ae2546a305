"""``revolve log`` on journals made here."""

import json
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from coordinator.cli.log import main
from coordinator.islands.events import (
    Advanced,
    Audited,
    Commanded,
    Evaluated,
    EvaluationFailed,
    Insert,
    JournalledEvent,
    Remove,
)
from coordinator.storage.journal import NAME, Journal
from revolve.command import main as revolve
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.wire.arena import Advance, Casualty, Judgement, Touch
from schema.wire.messages import Bred, Newborn
from tests.coordinator.sent_requests import ROBOT

ZERO = (0.0, 0.0, 0.0)
CHILD = Newborn(b"", ROBOT, 0)
GOOD = Evaluation(0.125, 0.5, 0.25, 30.0)
WORKER = Provenance("hal", "linux", 0.05)
OTHER = Provenance("eve", "linux", 0.06)
ADVANCE = Advance(
    6000,
    bytes(range(32)),
    (Judgement(BirthId(0, 3), 15.0, 0.1, 0.2, 0.1, is_mature=True, place=ZERO),),
    (Casualty(BirthId(0, 2), 5999, "height 1e9 m", ZERO),),
    (Touch(BirthId(0, 2), BirthId(0, 3), 0.25),),
)
FAILED = EvaluationFailed(BirthId(0, 1), "diverged\nat 3.2 s", WORKER, 2, 1)
EVENTS: list[JournalledEvent] = [
    Bred(BirthId(0, 0), 0, (), CHILD),
    Bred(BirthId(0, 0), 5, ("parts 1 and 3 intersect", "no motor"), CHILD),
    Bred(BirthId(1, 7), 0, ("a", "b", "c", "d", "e")),
    Evaluated(BirthId(0, 0), GOOD, WORKER),
    FAILED,
    Advanced(0, 17, ADVANCE, 120, WORKER),
    Commanded(0, "x", 6200, Insert(b"", (0.5, -1.0))),
    Commanded(0, "y", 6400, Remove(BirthId(0, 3))),
    Audited(FAILED, Evaluated(BirthId(0, 1), GOOD, OTHER, 2, 1)),
]
LINES = [
    "     0  bred                    0  0:0         0  viable, parts 2",
    (
        "     1  bred                    0  0:0         7  "
        "viable, parts 2, failed: parts 1 and 3 intersect and no motor"
    ),
    (
        "     2  bred                    1  1:7         4  "
        "no child, failed: a and b and c and d and e"
    ),
    (
        "     3  evaluated               0  0:0         0  "
        "fitness 0.1250, 30.0 s simulated, worker hal, in 0.050 s"
    ),
    (
        "     4  evaluation-failed       1  0:1         2  "
        "diverged at 3.2 s, worker hal, in 0.050 s"
    ),
    (
        "     5  advanced                0                 "
        "advance 17, step 6000, robots 1, diverged: 0:2, contacts 1, poses 120, "
        "state 00010203, worker hal, in 0.050 s"
    ),
    (
        "     6  operator-order          0                 "
        "insert at (0.5, -1) m, step 6200"
    ),
    "     7  operator-order          0  0:3            remove, step 6400",
    (
        "     8  audited                 1  0:1            "
        "results differ, diverged at 3.2 s and 0.125, workers hal and eve"
    ),
]
ROBOT_3 = (
    "     5  advanced                0  0:3            "
    "fitness 0.1000, age 15.0 s, advance 17, step 6000"
)
ROBOT_2 = (
    "     5  advanced                0  0:2            "
    "diverged, height 1e9 m, advance 17, step 6000"
)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return a run folder with a journal of all kinds of events."""
    with Journal.open(tmp_path, epoch=1) as journal:
        journal.append(EVENTS)
    return tmp_path


def printed(
    capsys: pytest.CaptureFixture[str], *words: object, code: int = 0
) -> list[str]:
    """Return the lines that the command prints below its header."""
    assert main(["log", *map(str, words)]) == code
    header, *lines = capsys.readouterr().out.splitlines()
    assert header.split() == ["record", "event", "island", "birth", "try", "details"]
    return lines


def test_every_event_is_one_aligned_line(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert printed(capsys, run) == LINES


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (["--island", "1"], [LINES[2], LINES[4], LINES[8]]),
        (["--birth", "0"], [LINES[0], LINES[1], LINES[3]]),
        (["--birth", "0:1"], [LINES[4], LINES[8]]),
        (["--birth", "1:1"], []),
        (["--birth", "3"], [ROBOT_3, LINES[7]]),
        (["--birth", "2", "--island", "0"], [ROBOT_2]),
        (["--birth", "2", "--island", "1"], []),
    ],
)
def test_flags_select_events(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    flags: Sequence[str],
    expected: list[str],
) -> None:
    code = main(["log", str(run), *flags])
    said = capsys.readouterr()
    assert said.out.splitlines()[1:] == expected
    assert code == (0 if expected else 1)
    assert ("no event of that birth or island" in said.err) == (not expected)


def test_json_is_one_object_per_line(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", str(run), "--json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["record"] for row in rows] == list(range(len(EVENTS)))
    assert rows[3] == {
        "record": 3, "event": "evaluated", "island": 0, "birth": "0:0", "trial": 0,
        "fitness": 0.125, "path_velocity": 0.5, "straight_velocity": 0.25,
        "simulated_s": 30.0, "measures": [], "worker": "hal", "platform": "linux",
        "wall_s": 0.05,
    }  # fmt: skip
    assert rows[5]["state"] == bytes(range(32)).hex()
    assert rows[8]["outcomes"] == ["diverged\nat 3.2 s", 0.125]


@pytest.mark.parametrize(
    ("is_cut", "code", "told"),
    [(False, 1, "(record 8)"), (True, 0, "ends with an incomplete record of")],
)
def test_damage_or_a_cut_ends_the_log_with_one_line(
    run: Path, capsys: pytest.CaptureFixture[str], told: str, code: int, *, is_cut: bool
) -> None:
    path = run / NAME
    data = bytearray(path.read_bytes())
    if is_cut:
        path.write_bytes(data[:-3])
    else:
        with Journal.open(run, epoch=1) as journal:
            journal.append(EVENTS[:1])
        whole = path.read_bytes()
        data[-5] ^= 1
        path.write_bytes(bytes(data) + whole[len(data) :])
    before = path.read_bytes()
    assert main(["log", str(run)]) == code
    out, err = capsys.readouterr()
    assert out.splitlines()[1:] == LINES[:-1]
    (line,) = err.splitlines()
    assert told in line
    assert str(path) in line
    assert path.read_bytes() == before


def test_folders_without_a_journal_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(folder: Path) -> str:
        assert revolve(["log", str(folder)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    assert refused(tmp_path / "none").endswith("none: no such folder")
    assert "no run is there (journal.bin is missing)" in refused(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    assert "the run has no journal" in refused(tmp_path)
    campaign = tmp_path / "campaign"
    (campaign / "a-0").mkdir(parents=True)
    (campaign / "campaign.toml").touch()
    assert refused(campaign).endswith("is a campaign; give one of its runs")
    (campaign / "a-0" / NAME).touch()
    assert refused(campaign).endswith(f"such as {campaign / 'a-0'}")
    (tmp_path / NAME).write_text("something else")
    assert main(["log", str(tmp_path)]) == 1
    assert "not a journal" in capsys.readouterr().err


def test_follow_prints_what_another_process_appends_until_the_run_is_finished(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.json").write_text("{}")
    looks = 0
    journal: list[Journal] = []
    rest = b""

    def pause(seconds: float) -> None:
        """Append to the journal between two reads, as another process would."""
        nonlocal looks, rest
        assert seconds >= 0.5
        looks += 1
        match looks:
            case 1:
                journal.append(Journal.open(tmp_path, epoch=1))
            case 2:
                journal[0].append(EVENTS[:2])
            case 3:
                size = (tmp_path / NAME).stat().st_size + 10
                journal[0].append(EVENTS[2:3])
                rest = (tmp_path / NAME).read_bytes()[size:]
                os.truncate(tmp_path / NAME, size)
            case 4:
                with (tmp_path / NAME).open("ab") as file:
                    file.write(rest)
            case 5:
                journal[0].append(EVENTS[3:])
                (tmp_path / "state").write_text("finished")

    monkeypatch.setattr("time.sleep", pause)
    assert printed(capsys, tmp_path, "--follow") == LINES
    assert looks == 5


def test_follow_warns_of_printed_records_that_become_void(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Journal.open(tmp_path, epoch=1) as old, Journal.open(tmp_path, epoch=2) as new:
        old.append(EVENTS[:2])

        def pause(_seconds: float) -> None:
            new.append(EVENTS[:1])
            (tmp_path / "state").write_text("finished")

        monkeypatch.setattr("time.sleep", pause)
        assert main(["log", str(tmp_path), "--follow"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1:] == [*LINES[:2], LINES[0]]
    assert "records from 0 on are void" in err
