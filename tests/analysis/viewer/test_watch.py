"""Tests of recording a live run: progress and messages."""

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pytest
from msgspec.structs import replace

from analysis.viewer.live import Ended, LiveMessage
from analysis.viewer.output import Output
from analysis.viewer.watch import LiveView, watch
from schema.errors import MalformedMessage, NetworkError
from schema.experiment.file import experiment_text, read_experiment
from schema.robot.ids import BirthId
from schema.wire.arena import Advance
from schema.wire.arena_codec import Live
from schema.wire.updates import Birth, Update
from tests.coordinator.arena_world import poses


def news(sequence: int, *births: tuple[int, int]) -> Update:
    """Return news of births, by island and number."""
    born = tuple(
        Birth(BirthId(island, number), (), 1, number + 1, None, None)
        for island, number in births
    )
    return Update("a/run", 1, sequence, is_whole=False, experiment="e", births=born)


WHOLE = replace(
    news(1, (0, 0), (0, 1)),
    is_whole=True,
    document=experiment_text(read_experiment("scenario1")),
)


class Source:
    """Returns messages one by one, then stops the viewer."""

    def __init__(self, stop: threading.Event, *messages: LiveMessage) -> None:
        self._messages = list(messages)
        self._stop = stop

    def receive(self, *_: float) -> list[LiveMessage]:
        if not self._messages:
            self._stop.set()
        return [self._messages.pop(0)] if self._messages else []


def seen(file: Path, *messages: LiveMessage) -> None:
    stop = threading.Event()
    source: Any = Source(stop, *messages)
    watch(source, Output(file, None, has_window=False), None, stop)


@pytest.mark.parametrize("end", [(), (Ended(),)])
def test_progress_and_file_are_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], end: tuple[Ended, ...]
) -> None:
    file = tmp_path / "my run.rrd"
    seen(file, WHOLE, news(2, (0, 2)), *end)
    messages = capsys.readouterr()
    saved = f"saved {file}; to view: rerun '{file}'"
    assert messages.err.splitlines() == [
        "recording e-run: 2 births",
        *(["the run has ended"] if end else []),
        saved,
    ]
    assert not messages.out
    assert file.stat().st_size > 0


def test_a_stop_before_the_first_message_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a.rrd"
    seen(file)
    why = f"stopped before a run was received; {file} not written\n"
    assert capsys.readouterr().err == why
    assert not file.exists()


def test_waiting_for_a_run_is_reported_once(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    times = iter([0.0, 0.0, 1.0, 2.5, 3.0, 16.0])
    clock = SimpleNamespace(monotonic=lambda: next(times))
    monkeypatch.setattr("analysis.viewer.watch.time", clock)
    with pytest.raises(NetworkError, match="does not send a run"):
        seen(tmp_path / "a.rrd", *[news(number) for number in range(5)])
    assert capsys.readouterr().err == "waiting for the coordinator to send a run\n"


def test_births_count_once_on_every_island() -> None:
    ignored: Any = type("Show", (), {"tell": lambda *_: None})()
    view = LiveView(ignored, "a/run")
    view.tell([WHOLE, news(2, (1, 0), (0, 2)), news(2, (1, 0), (0, 2)), news(3)])
    assert view.births == 4


def test_poses_that_fit_no_robot_are_dropped() -> None:
    """They are published best effort, by any worker."""
    moved: list[int] = []

    class Fussy:
        """Show that refuses the poses of three robots."""

        def move(self, arena: int, poses: pa.Table, *, has_all: bool) -> None:
            assert has_all
            if poses.num_rows == 3:
                raise MalformedMessage("poses: must have 2 angles each")
            moved.append(arena)

    show: Any = Fussy()
    view = LiveView(show, "a/run")

    def live(shard: int, columns: bytes) -> Live:
        advance = Advance(1, bytes(32), (), (), (), columns)
        return Live("a/run", shard, advance)

    births = [BirthId(0, number) for number in range(3)]
    view.tell(
        [
            live(1, poses(births, 0.2)),
            live(2, b"\xff" * 200),
            live(3, poses(births[:2], 0.2)),
        ]
    )
    assert moved == [3]
