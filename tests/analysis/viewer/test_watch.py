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
from analysis.viewer.scene import scene_of
from analysis.viewer.watch import LiveView, received_poses, watch
from schema.errors import MalformedMessage, NetworkError
from schema.experiment.file import experiment_text, read_experiment
from schema.robot.ids import BirthId
from schema.robot.robot import Part
from schema.wire.arena import Advance, Live, Poses
from schema.wire.updates import (
    ArenaSample,
    Birth,
    Migrant,
    RecordedDeath,
    Update,
    WorkerInfo,
)
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
        self.dropped = 0

    def forget(self) -> None:
        pass

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
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    times = iter([0.0, 0.0, 1.0, 2.5, 3.0, 16.0])
    clock = SimpleNamespace(monotonic=lambda: next(times))
    monkeypatch.setattr("analysis.viewer.watch.time", clock)
    with pytest.raises(NetworkError, match="does not send a run"):
        seen(tmp_path / "a.rrd", *[news(number) for number in range(5)])
    assert capsys.readouterr().err == "waiting for the coordinator to send a run\n"


def test_updates_that_came_before_the_state_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen(tmp_path / "a.rrd", news(2, (0, 2)), WHOLE, Ended())
    assert "recording e-run: 3 births" in capsys.readouterr().err


def test_births_count_once_on_every_island() -> None:
    ignored: Any = type("Show", (), {"tell": lambda *_: None})()
    view = LiveView(ignored, "a/run", scene_of(read_experiment("archipelago-ring")))
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
    view = LiveView(show, "a/run", scene_of(read_experiment("archipelago-arenas")))

    def live(shard: int, sent: Poses) -> Live:
        advance = Advance(1, bytes(32), (), (), (), sent)
        return Live("a/run", shard, advance)

    births = [BirthId(0, number) for number in range(3)]
    view.tell(
        [
            live(1, poses(births, 0.2).message()),
            live(2, Poses(b"\xff" * 200)),
            live(3, poses(births[:2], 0.2).message()),
        ]
    )
    assert moved == [3]
    assert view.dropped == 2


CORE = Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3))


def with_body(*body: Part) -> Update:
    return replace(news(3), births=(Birth(BirthId(0, 9), (), 1, 1, None, body),))


FORGED: dict[str, Update] = {
    "unknown part": with_body(Part("Hinoe", -1, -1, -1, 0, ())),
    "two cores": with_body(CORE, CORE),
    "no core": with_body(),
    "time beyond 64 bits": replace(
        news(3), births=(Birth(BirthId(0, 9), (), 1, 1, 1e308, None),)
    ),
    "death before the start": replace(
        news(3), deaths=(RecordedDeath(0, BirthId(0, 1), 1, -1e300, "culled"),)
    ),
    "unknown island": news(3, (4_000_000_000, 0)),
    "sample of no island": replace(news(3), samples=(ArenaSample(99, 1.0),)),
    "sample beyond 64 bits": replace(news(3), samples=(ArenaSample(0, 1e308),)),
    "migrant to nowhere": replace(
        news(3), migrants=(Migrant(BirthId(0, 1), 0, 99, 1, 1, None),)
    ),
    "long text": replace(
        news(3), workers=(WorkerInfo("w" * 1_000_000, "platform", ()),)
    ),
}


@pytest.mark.parametrize("forged", FORGED.values(), ids=FORGED)
def test_a_forged_update_is_counted_and_changes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], forged: Update
) -> None:
    seen(tmp_path / "run.rrd", WHOLE, forged, news(4, (0, 2)), Ended())
    lines = capsys.readouterr().err.splitlines()
    assert lines[1:3] == [
        "dropped 1 message: malformed, or not of this run",
        "the run has ended",
    ]


@pytest.mark.parametrize(
    ("column", "place", "value"),
    [("times_s", 0, float("nan")), ("times_s", 0, 1e300), ("cores", 0, float("inf")),
     ("cores", 3, float("nan")), ("angles", 0, float("nan"))],
)  # fmt: skip
def test_poses_that_cannot_be_shown_are_dropped(
    column: str, place: int, value: float
) -> None:
    forged = poses([BirthId(0, 0)], 0.2)
    getattr(forged, column)[..., place] = value
    advance = Advance(1, bytes(32), (), (), (), forged.message())
    scene = scene_of(read_experiment("scenario3"))
    with pytest.raises(MalformedMessage):
        received_poses(Live("a/run", 0, advance), scene)


@pytest.mark.parametrize("document", ["{}", "\x00", "[" * 100_000])
def test_a_run_that_cannot_be_shown_is_passed_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], document: str
) -> None:
    forged = replace(WHOLE, run="forged", document=document)
    seen(tmp_path / "run.rrd", forged, WHOLE, Ended())
    lines = capsys.readouterr().err.splitlines()
    assert "forged: cannot be shown" in lines[0]
    assert "recording e-run: 2 births" in lines
