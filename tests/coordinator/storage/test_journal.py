"""Journal after kills, damage and full disks."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from coordinator.islands.events import (
    Advanced,
    Asked,
    Commanded,
    Evaluated,
    EvaluationFailed,
    Insert,
    JournalledEvent,
    Order,
    Pause,
    Remove,
    ReplaceBrain,
    Resume,
    Vetted,
    VettingFailed,
)
from coordinator.storage.journal import MAGIC, NAME, Journal, decode_entry, encode_entry
from schema.errors import MalformedMessage, RunFolderError
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance, Report
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import Advance, Casualty, Judgement, Touch
from schema.wire.protobuf import encode_genome

FullBeyond = Callable[[int], AbstractContextManager[None]]
REFUSED = Report(
    is_viable=False,
    reason="parts 1 (Hinge) and 3 (FixedBrick) intersect",
    intersections=((1, 3), (2, 5)),
    lower=(-0.1, -0.2, -0.0225),
    upper=(0.1, 1 / 3, 0.0225),
    mass=0.1234,
    motors=2,
)
CORE = encode_genome(Node("Core", -1, 0, ()))
BIRTH = BirthId(2, 17)
EVALUATION = Evaluation(0.5, 0.1, 0.08, 27.5)
MEASURED = Evaluation(0.5, 0.1, 0.08, 27.5, (0.25, -3.0))
JUDGED = Judgement(
    BirthId(0, 3), 15.0, 0.1, 1 / 3, 0.1, is_mature=True, place=(0.1, -0.2, 0.02)
)
ADVANCE = Advance(
    6000,
    bytes(range(32)),
    (JUDGED,),
    (Casualty(BirthId(0, 2), 5999, "diverged", (0.0, 0.0, 1e9)),),
    (Touch(BirthId(0, 2), BirthId(0, 3), 0.25),),
    b"",
)
ORDERS: list[Order] = [
    Pause(),
    Resume(),
    Insert(CORE),
    Insert(CORE, (0.0, -1.5)),
    Insert(CORE, prevents_extinction=False),
    Remove(BirthId(1, 2**40)),
    ReplaceBrain(
        BirthId(0, 3),
        Brain(
            (Neuron("input", "Input", 2), Neuron("output", "Simple", 4, (0.5, 1.0))),
            (Connection(0, 1, -0.5),),
        ),
    ),
]
EVENTS: list[JournalledEvent] = [
    Vetted(BirthId(0, 0), 2, REFUSED),
    VettingFailed(BirthId(1, 7), 4, "three analyzers raised KeyError: 'Wheel'"),
    Evaluated(
        BirthId(0, 0), Evaluation(0.1 + 0.2, 1e-300, 0.3, 12.0), Provenance("w", "x", 2)
    ),
    EvaluationFailed(BirthId(0, 1), "diverged at 3.2 s", Provenance("w 2", "y", 0.5)),
    Vetted(BirthId(2**31, 2**40), 0, REFUSED),
    Advanced(3, 17, ADVANCE, 120, Provenance("w", "x", 0.25)),
    *(Commanded(3, f"order {index}", 6000, one) for index, one in enumerate(ORDERS)),
]


def written(folder: Path) -> list[int]:
    """Write all events one by one; return the file's size after each."""
    sizes = [len(MAGIC)]
    with Journal.open(folder) as journal:
        for event in EVENTS:
            journal.append([event])
            sizes.append((folder / NAME).stat().st_size)
    return sizes


def test_events_are_read_as_they_were_written(tmp_path: Path) -> None:
    written(tmp_path)
    with Journal.open(tmp_path) as journal:
        assert journal.replay() == EVENTS
        assert journal.dropped == 0


def test_a_batch_has_the_same_bytes_as_single_events(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "all").mkdir()
    written(tmp_path / "one")
    with Journal.open(tmp_path / "all") as journal:
        journal.append(EVENTS)
    one, all_ = (tmp_path / name / NAME for name in ("one", "all"))
    assert one.read_bytes() == all_.read_bytes()


def test_a_journal_cut_anywhere_keeps_exactly_its_whole_records(
    tmp_path: Path,
) -> None:
    sizes = written(tmp_path)
    path = tmp_path / NAME
    data = path.read_bytes()
    for cut in range(len(data)):
        path.write_bytes(data[:cut])
        whole = sum(size <= cut for size in sizes[1:])
        kept = max([size for size in sizes if size <= cut], default=0)
        with Journal.open(tmp_path) as journal:
            assert journal.replay() == EVENTS[:whole]
            assert journal.dropped == cut - kept
            journal.append(EVENTS[whole:])
        assert path.read_bytes() == data


def test_a_changed_byte_is_dropped_at_the_tail_and_refused_before_it(
    tmp_path: Path,
) -> None:
    sizes = written(tmp_path)
    path = tmp_path / NAME
    data = path.read_bytes()
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 0x41
        path.write_bytes(changed)
        record = sum(size <= position for size in sizes) - 1
        if record == len(EVENTS) - 1:
            with Journal.open(tmp_path) as journal:
                assert journal.replay() == EVENTS[:-1]
                assert journal.dropped == len(data) - sizes[-2]
            continue
        story = "not a journal" if record < 0 else f"damaged at byte {sizes[record]} "
        with pytest.raises(RunFolderError, match=story):
            Journal.open(tmp_path)
        assert path.read_bytes() == changed


def test_the_remedy_for_damage_works(tmp_path: Path) -> None:
    sizes = written(tmp_path)
    path = tmp_path / NAME
    data = bytearray(path.read_bytes())
    data[sizes[2] + 20] ^= 1
    path.write_bytes(data)
    with pytest.raises(RunFolderError, match=f"truncate -s {sizes[2]} "):
        Journal.open(tmp_path)
    os.truncate(path, sizes[2])
    with Journal.open(tmp_path) as journal:
        assert journal.replay() == EVENTS[:2]


def test_a_repeated_record_is_damage(tmp_path: Path) -> None:
    sizes = written(tmp_path)
    path = tmp_path / NAME
    data = path.read_bytes()
    path.write_bytes(data[: sizes[2]] + data[sizes[1] :])
    with pytest.raises(RunFolderError, match=f"damaged at byte {sizes[2]}"):
        Journal.open(tmp_path)


def test_records_of_a_replaced_coordinator_are_void(tmp_path: Path) -> None:
    """It pauses before it writes; the other continues from the records it found."""
    with Journal.open(tmp_path, epoch=1) as old:
        old.append(EVENTS[:2])
        with Journal.open(tmp_path, epoch=2) as new:
            assert new.replay() == EVENTS[:2]
            old.append(EVENTS[2:3])
            new.append(EVENTS[3:5])
            old.append(EVENTS[5:6])
            new.append(EVENTS[6:7])
            old.append(EVENTS[7:8])
    kept = [*EVENTS[:2], *EVENTS[3:5], EVENTS[6]]
    with Journal.open(tmp_path, epoch=3) as third:
        assert third.replay() == kept
        assert third.dropped == 0
        third.append(EVENTS[8:9])
    with Journal.open(tmp_path) as journal:
        assert journal.replay() == [*kept, EVENTS[8]]


def test_a_gap_before_a_later_epoch_is_damage(tmp_path: Path) -> None:
    sizes = written(tmp_path)
    path = tmp_path / NAME
    with Journal.open(tmp_path, epoch=2) as journal:
        journal.append(EVENTS[:1])
    data = path.read_bytes()
    path.write_bytes(data[: sizes[3]] + data[sizes[-1] :])
    with pytest.raises(RunFolderError, match=f"damaged at byte {sizes[3]}"):
        Journal.open(tmp_path)


def test_a_full_disk_takes_the_whole_batch_or_nothing(
    tmp_path: Path, full_beyond: FullBeyond
) -> None:
    with Journal.open(tmp_path) as journal:
        journal.append(EVENTS[:2])
        before = (tmp_path / NAME).read_bytes()
        # Room for one event of the batch and a part of the next.
        with (
            full_beyond(len(before) + 150),
            pytest.raises(RunFolderError, match="disk full"),
        ):
            journal.append(EVENTS[2:])
        assert (tmp_path / NAME).read_bytes() == before
        journal.append(EVENTS[2:])
    with Journal.open(tmp_path) as journal:
        assert journal.replay() == EVENTS


def test_a_killed_process_loses_no_confirmed_record(tmp_path: Path) -> None:
    program = """
import sys
from pathlib import Path
from coordinator.islands.events import VettingFailed
from coordinator.storage.journal import Journal
from schema.wire.arena import Advance, Casualty, Judgement, Touch
from schema.robot.ids import BirthId
from schema.robot.brain import Brain, Connection, Neuron
journal = Journal.open(Path(sys.argv[1]))
for number in range(10**9):
    journal.append([VettingFailed(BirthId(0, number), 0, "x" * (number % 50))])
    print(number, flush=True)
"""
    with subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        for _ in range(200):
            last = int(child.stdout.readline())
        child.send_signal(signal.SIGKILL)
        said = child.stdout.read().split(b"\n")[:-1]
    sure = int(said[-1]) if said else last
    with Journal.open(tmp_path) as journal:
        history = journal.replay()
    births = [one.birth.number for one in history if isinstance(one, VettingFailed)]
    assert births == list(range(len(births)))
    assert len(births) > sure


def test_a_file_that_is_no_journal_is_refused_and_unchanged(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"something else")
    with pytest.raises(RunFolderError, match="not a journal"):
        Journal.open(tmp_path)
    assert (tmp_path / NAME).read_bytes() == b"something else"


@pytest.mark.parametrize("event", EVENTS)
def test_an_entry_round_trips(event: JournalledEvent) -> None:
    assert decode_entry(encode_entry(event)) == event


def test_poses_are_not_journalled() -> None:
    event = Advanced(0, 1, replace(ADVANCE, poses=b"bulk"), 4, Provenance("w", "x", 1))
    kept = decode_entry(encode_entry(event))
    assert kept == structs.replace(event, advance=ADVANCE)


@given(st.binary(max_size=80))
def test_any_bytes_are_an_entry_or_malformed(data: bytes) -> None:
    try:
        event = decode_entry(data)
    except MalformedMessage:
        return
    assert decode_entry(encode_entry(event)) == event


@pytest.mark.parametrize("trial", [0, 1, 200])
def test_trials_are_read_as_they_were_written(trial: int) -> None:
    for event in (
        Evaluated(BIRTH, EVALUATION, Provenance("w", "p", 0.5), trial),
        Evaluated(BIRTH, MEASURED, Provenance("w", "p", 0.5), trial),
        EvaluationFailed(BIRTH, "diverged", Provenance("w", "p", 0.5), trial),
    ):
        assert decode_entry(encode_entry(event)) == event


def test_a_first_trial_has_the_bytes_of_older_versions() -> None:
    first = encode_entry(Evaluated(BIRTH, EVALUATION, Provenance("w", "p", 0.5)))
    second = encode_entry(Evaluated(BIRTH, EVALUATION, Provenance("w", "p", 0.5), 1))
    # Field 12, a varint: its key is 12 << 3.
    assert second == first + bytes([12 << 3, 1])


@pytest.mark.parametrize("points", [((0.5, 0.25),), ((0.1,), (1 / 3,), (1.0,))])
def test_answers_of_learners_are_read_as_they_were_written(
    points: tuple[tuple[float, ...], ...],
) -> None:
    event = Asked(BIRTH, 3, points)
    assert decode_entry(encode_entry(event)) == event


@pytest.mark.parametrize(
    ("points", "values"), [(2, [0.5] * 3), (0, [0.5]), (2, []), (1, [float("nan")])]
)
def test_points_without_equally_many_values_are_refused(
    points: int, values: list[float]
) -> None:
    asked = pb.LearnerEntry(points=points, values=values)
    with pytest.raises(MalformedMessage, match=r"asked|points must have"):
        decode_entry(pb.Entry(asked=asked).SerializeToString())
