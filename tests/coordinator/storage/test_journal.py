"""Journal after kills, damage and full disks."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.islands.events import (
    Advanced,
    Asked,
    Audited,
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
)
from coordinator.storage.journal import (
    MAGIC,
    NAME,
    Journal,
    decode_record,
    encode_event,
)
from schema.errors import RunFolderError
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.wire.arena import NO_POSES, Advance, Casualty, Judgement, Poses, Touch
from schema.wire.genome_bytes import encode_genome
from schema.wire.messages import Bred, Newborn
from tests.coordinator.sent_requests import ROBOT
from tests.schema.wire.message_examples import messages_of

FullBeyond = Callable[[int], AbstractContextManager[None]]
CORE = encode_genome(Node("Core", -1, 0, ()))
SIGNED = Provenance("w", "x", 0.25)
JUDGED = Judgement(
    BirthId(0, 3), 15.0, 0.1, 1 / 3, 0.1, is_mature=True, place=(0.1, -0.2, 0.02)
)
ADVANCE = Advance(
    6000,
    bytes(range(32)),
    (JUDGED,),
    (Casualty(BirthId(0, 2), 5999, "diverged", (0.0, 0.0, 1e9)),),
    (Touch(BirthId(0, 2), BirthId(0, 3), 0.25),),
)
ORDERS: list[Order] = [
    Pause(),
    Resume(),
    Insert(CORE),
    Insert(CORE, (0.0, -1.5)),
    Remove(BirthId(1, 2**40)),
    ReplaceBrain(
        BirthId(0, 3),
        Brain(
            (Neuron("input", "Input", 2), Neuron("output", "Simple", 4, (0.5, 1.0))),
            (Connection(0, 1, -0.5),),
        ),
    ),
]
JUDGED_TWICE = Evaluated(
    BirthId(0, 0), Evaluation(0.1 + 0.2, 1e-300, 0.3, 12.0, (0.25, -3.0)), SIGNED, 1, 2
)
EVENTS: list[JournalledEvent] = [
    Bred(BirthId(0, 0), 2, ("parts 1 and 3 intersect",), Newborn(CORE, ROBOT, 7)),
    Bred(BirthId(1, 7), 4, ("the analyzer ended its own process 3 times",)),
    JUDGED_TWICE,
    EvaluationFailed(BirthId(0, 1), "diverged at 3.2 s", SIGNED),
    Audited(JUDGED_TWICE, replace(JUDGED_TWICE, provenance=Provenance("v"))),
    Asked(BirthId(2**31, 2**40), 3, ((0.1,), (1 / 3,), (1.0,))),
    Advanced(3, 17, ADVANCE, 120, SIGNED),
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


def test_a_journal_cut_anywhere_keeps_exactly_its_whole_records(tmp_path: Path) -> None:
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
from schema.wire.messages import Bred
from coordinator.storage.journal import Journal
from schema.robot.ids import BirthId
journal = Journal.open(Path(sys.argv[1]))
for number in range(10**9):
    journal.append([Bred(BirthId(0, number), 0, ("x" * (number % 50),))])
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
    births = [one.birth.number for one in history if isinstance(one, Bred)]
    assert births == list(range(len(births)))
    assert len(births) > sure


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"something else", "not a journal"),
        (b"revolve journal 1\nand records", "of Revolve Islands 0.2: use that version"),
    ],
)
def test_a_file_that_is_no_journal_is_refused_and_unchanged(
    tmp_path: Path, data: bytes, why: str
) -> None:
    (tmp_path / NAME).write_bytes(data)
    with pytest.raises(RunFolderError, match=why) as raised:
        Journal.open(tmp_path)
    assert "\n" not in str(raised.value)
    assert (tmp_path / NAME).read_bytes() == data


@pytest.mark.parametrize("kind", get_args(JournalledEvent))
@settings(max_examples=50)
@given(data=st.data())
def test_an_event_is_read_as_it_was_written(kind: Any, data: st.DataObject) -> None:  # noqa: ANN401
    event = data.draw(messages_of(kind))
    if isinstance(event, Advanced):
        # They are stored elsewhere.
        bulk = replace(event.advance, poses=Poses(b"bulk"), snapshot=b"bulk")
        written = encode_event(replace(event, advance=bulk))
        event = replace(event, advance=replace(bulk, poses=NO_POSES, snapshot=b""))
    else:
        written = encode_event(event)
    assert decode_record(Path("journal"), written) == event
