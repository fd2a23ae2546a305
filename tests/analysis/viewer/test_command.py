"""Tests of the viewer without network and screen."""

import json
import os
import re
import socket
import sys
import threading
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pyarrow as pa
import pytest
from msgspec.structs import replace

from analysis.viewer.blueprint import layout
from analysis.viewer.body import box_model
from analysis.viewer.command import view
from analysis.viewer.entities import TimePoint
from analysis.viewer.flags import parser
from analysis.viewer.output import Output, Window, keep_serving, ways_to_view
from analysis.viewer.populations import Gallery, Lineage, spot_place
from analysis.viewer.recording import Recording, ViewerError
from analysis.viewer.resimulate import Simulators
from analysis.viewer.scene import scene_of
from analysis.viewer.show import Show
from schema.errors import RunFolderError
from schema.experiment.document import ArenaSection, Experiment
from schema.experiment.file import read_experiment
from schema.experiment.grid import Grid
from schema.mjcf.model import add_walls, ring_wall
from schema.parts import BUILT_IN
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.columns import TABLES
from schema.wire.elites import Elite
from schema.wire.updates import ArenaSample, Birth, Level, RecordedDeath, Update
from tests.coordinator.arena_world import poses
from tests.documents import parse_experiment

CORE = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
WHOLE = Update("run", 1, 4, is_whole=True, experiment="e")


class Recorded:
    """Records the calls of a recording's methods."""

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []

    def __getattr__(self, name: str) -> object:
        return lambda *words: self.calls.append((name, *words))


def test_a_ring_wall_is_where_mujoco_has_it() -> None:
    arena = ArenaSection(wall_diameter_m=3.0, wall_segments=5)
    spec = mujoco.MjSpec()
    add_walls(spec, ring_wall(arena))
    model = spec.compile()
    (walls,) = scene_of(Experiment(name="e", arena=arena)).walls
    assert len(walls) == model.ngeom == 5
    for geom, wall in enumerate(walls):
        assert wall[:3] == pytest.approx(model.geom_pos[geom], abs=1e-6)
        assert wall[3:7] == pytest.approx(model.geom_quat[geom], abs=1e-6)
        assert wall[7:] == pytest.approx(model.geom_size[geom], abs=1e-6)


def test_living_robots_keep_their_spot_and_dead_robots_free_it() -> None:
    recorded = Recorded()
    gallery = Gallery(recorded)  # type: ignore[arg-type]
    names = [BirthId(0, number) for number in range(4)]
    model = box_model(CORE, BUILT_IN, is_plain=True)
    models = dict.fromkeys(names, lambda: model)
    gallery.show(Level(0, 3, 3, 3, 0.0, 0.0, tuple(names[:3])), models)
    gallery.show(Level(0, 4, 3, 3, 0.0, 0.0, (names[0], names[2], names[3])), models)
    shown = ["log_boxes", "log_place"]
    assert [call[0] for call in recorded.calls] == shown * 3 + ["remove", *shown]
    assert recorded.calls[6][1] == "islands/0/robots/0-1"
    centres = recorded.calls[8][2]
    assert isinstance(centres, np.ndarray)
    assert centres[0, 0, :2] == pytest.approx(spot_place(1))


def test_ancestry_is_drawn_every_ten_births_with_living_robots_marked() -> None:
    recorded = Recorded()
    lineage = Lineage(recorded)  # type: ignore[arg-type]
    for number in range(12):
        one = Birth(BirthId(0, number), (), 1, number + 1, None, None)
        assert lineage.add(one)
        assert not lineage.add(one)
    assert len(recorded.calls) == 1
    lineage.keep(Level(0, 11, 2, 2, 0.0, 0.0, (BirthId(0, 3), BirthId(0, 10))))
    lineage.draw()
    _, entries, _ = recorded.calls[1]
    assert isinstance(entries, list)
    # The last one was born since.
    assert [one.birth.birth.number for one in entries if one.is_alive] == [3, 10, 11]


def test_a_death_has_as_many_births_as_the_last_pose() -> None:
    recorded: Any = Recorded()
    show = Show(recorded, BUILT_IN)
    first, second = (Birth(BirthId(0, n), (), 1, n + 1, 10.0 * n, CORE.parts)
                     for n in range(2))  # fmt: skip
    # At 10 s the second is born and the first dies: one birth, says the table.
    death = RecordedDeath(0, first.birth, 1, 10.0, "cull")
    show.tell(replace(WHOLE, births=(first, second), deaths=(death,)))
    rows = [
        {"record": n, "island": 0, "birth": 0, "sim_time_s": 9.0 + n, "angles": [],
         "x": 0.0, "y": 0.0, "z": 0.0, "qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
        for n in range(2)
    ]  # fmt: skip
    show.move(0, pa.Table.from_pylist(rows, TABLES["poses"]))
    (births,) = [call[3] for call in recorded.calls if call[0] == "log_poses"]
    assert births.tolist() == [1, 2]
    (gone,) = [call[2] for call in recorded.calls if call[0] == "remove"]
    assert gone == TimePoint(10.0, 2)


def test_archive_maps_show_the_fittest_of_each_cell() -> None:
    """3 by 2 cells over two of three measures, the first row at the bottom."""
    recorded: Any = Recorded()
    grid = Grid(("a", "b", "c"), bounds=((0, 1),) * 3, bins=(3, 2, 5))
    show = Show(recorded, BUILT_IN, grid)
    elites = [
        Elite(0, births, cell, BirthId(0, births - 1), fitness)
        for births, cell, fitness in (
            (1, (0, 0, 0), 1.0), (2, (2, 1, 0), 3.0), (2, (2, 1, 4), 2.0),
            (2, (9, 0, 0), 9.0),
        )
    ]  # fmt: skip
    show.tell(replace(WHOLE, elites=tuple(elites)))
    calls = [call[1:] for call in recorded.calls if call[0] == "archive"]
    assert [when for _, _, when in calls] == [TimePoint(None, n) for n in (1, 2)]
    island, pixels, _ = calls[-1]
    assert (island, pixels.shape) == (0, (2, 3, 3))
    dark, pale, white = pixels[0, 2], pixels[1, 0], pixels[0, 0]
    assert dark.tolist() < pale.tolist() < white.tolist() == [255, 255, 255]
    assert (pixels == 255).all(axis=2).sum() == 4


def test_the_layout_has_a_map_of_a_grid() -> None:
    text = 'name = "e"\n[measures]\nnames = ["height"]\n[grid]\n'
    text += 'measures = ["height"]\nbounds = [[0, 1]]\nbins = [2]\n'
    blueprint: Any = layout(scene_of(parse_experiment(text, "e.toml")))
    _, panels = blueprint.root_container.contents
    (view,) = panels.contents[2].contents
    assert view.name == "Archive: height"


def test_views_of_a_mixed_archipelago_name_arenas_and_populations() -> None:
    scene = scene_of(read_experiment("archipelago-mixed"))
    assert scene.islands == (0, 1, 2, 3, 4, 5)
    assert scene.arenas == {4, 5}
    blueprint: Any = layout(scene)
    scenes, _ = blueprint.root_container.contents
    names = [view.name for view in scenes.contents]
    assert names == [*(f"Population of island {n}" for n in range(4)),
                     "Arena 4", "Arena 5"]  # fmt: skip


@pytest.mark.skipif(sys.platform == "darwin", reason="there is always a screen")
def test_a_window_needs_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(ViewerError, match=r"no screen here .*--save .*--serve"):
        Output.of(None, None)
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert Output.of(None, None).has_window


def test_a_server_tells_how_to_view_it_from_elsewhere() -> None:
    """The address of the page is what ``rerun --serve-web`` itself writes."""
    output = Output(None, ("127.0.0.1", 9877), has_window=False)
    here, far, browser = ways_to_view(output)
    assert here == "serving; to view: rerun --connect rerun+http://127.0.0.1:9877/proxy"
    assert re.search(r"ssh -N -L 9877:127\.0\.0\.1:9877 \S+@\S+, and there", far)
    assert "?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9877%2Fproxy" in browser
    assert "-L 9090:127.0.0.1:9090" in browser
    open_to_all = ways_to_view(Output(None, ("192.0.2.1", 9877), has_window=False))
    assert not any("ssh" in line or "SSH" in line for line in open_to_all)


@pytest.mark.parametrize("error", [KeyError("uid not found"), OSError("no user name")])
def test_a_user_without_a_name_can_serve(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """The type of the error depends on the version of Python."""

    def nobody() -> str:
        raise error

    monkeypatch.setattr("getpass.getuser", nobody)
    _, far, _ = ways_to_view(Output(None, ("127.0.0.1", 9877), has_window=False))
    assert f"127.0.0.1:9877 {socket.gethostname()}, and there" in far


@pytest.mark.parametrize("value", ["0", "off"])
def test_a_recording_is_written_though_rerun_is_turned_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    monkeypatch.setenv("RERUN", value)
    scene = scene_of(Experiment(name="a"))
    with Recording("a", layout(scene), file=tmp_path / "a.rrd") as recording:
        recording.add_scene(scene)
    assert (tmp_path / "a.rrd").stat().st_size > 0


@pytest.mark.parametrize(
    ("file", "address", "message"),
    [
        ("a.txt", None, r"must end in \.rrd"),
        ("no/a.rrd", None, "no such folder"),
        (None, "9876", "must be HOST:PORT"),
        (None, "127.0.0.1:", "must be HOST:PORT"),
        (None, "127.0.0.1:99999", "must be HOST:PORT"),
        (None, ":x", "must be HOST:PORT"),
    ],
)
def test_invalid_files_and_addresses_are_refused(
    tmp_path: Path, file: str | None, address: str | None, message: str
) -> None:
    with pytest.raises(ViewerError, match=message):
        Output.of(tmp_path / file if file else None, address)


def choose_statistics(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the user have chosen whether Rerun sends statistics."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(folder))
    (folder / "rerun").mkdir()
    (folder / "rerun" / "analytics.json").write_text('{"analytics_enabled": true}')


@pytest.mark.parametrize("has_chosen", [False, True])
def test_usage_statistics_are_off_unless_the_user_has_chosen(
    *,
    has_chosen: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    if has_chosen:
        choose_statistics(tmp_path, monkeypatch)
    for screen in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(screen, raising=False)
    monkeypatch.setattr("analysis.viewer.output._WINDOW_S", 60.0)
    with pytest.raises(ViewerError, match="cannot open a window"):
        Window(Output(None, ("127.0.0.1", 1), has_window=True))
    chosen = json.loads((tmp_path / "rerun" / "analytics.json").read_text())
    assert chosen["analytics_enabled"] == has_chosen
    assert ("no usage statistics" in capsys.readouterr().err) != has_chosen


def test_a_window_that_fails_late_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\nread -r _ < {tmp_path}/go\nexit 1\n")
    program.chmod(0o755)
    os.mkfifo(tmp_path / "go")
    choose_statistics(tmp_path, monkeypatch)
    monkeypatch.setattr("sys.executable", str(program))
    monkeypatch.setattr("analysis.viewer.output._WINDOW_S", 0.1)
    output = Output(None, ("127.0.0.1", 1), has_window=True)
    window = Window(output)
    assert not window.was_closed
    (tmp_path / "go").write_text("now\n")
    recorded: Any = Recorded()
    with pytest.raises(ViewerError, match="cannot open a window"):
        keep_serving(output, window, recorded, threading.Event())


def test_plug_ins_of_a_running_run_are_those_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    options = parser().parse_args(["--connect", str(tmp_path), "--save", "a.rrd"])
    with pytest.raises(RunFolderError, match=r"run\.json: damaged"):
        view(options, Simulators(*[NotImplemented] * 3))


BODY = (Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),)


def news(sequence: int, *numbers: int) -> Update:
    """Return news of births in an arena, of which number N is born at 10 N seconds."""
    births = tuple(
        Birth(BirthId(0, each - 1), (), 1, each, 10.0 * each, BODY) for each in numbers
    )
    return Update("r", 1, sequence, is_whole=False, experiment="e", births=births)


def test_births_so_far_are_right_after_a_lost_message() -> None:
    """Births 3 and 4 are requested again, and arrive after 5."""
    recording = MagicMock()
    show = Show(recording, BUILT_IN)
    for update in (news(1, 1, 2), news(3, 5), news(4, 1, 2, 3, 4, 5), news(5, 6)):
        show.tell(update)
    first = BirthId(0, 0)
    times_s = (5.0, 10.0, 25.0, 35.0, 45.0, 55.0, 65.0)
    rows = poses([first], *times_s, joints={first: 0})
    show.move(0, rows.rows())
    births = recording.log_poses.call_args.args[2]
    assert births.tolist() == [0, 1, 2, 3, 4, 5, 6]


def test_robots_are_painted_when_they_appear_and_at_samples() -> None:
    recording = MagicMock()
    show = Show(recording, BUILT_IN)
    first, second = BirthId(0, 0), BirthId(0, 1)
    stores = ((first, 4.0), (second, 2.0))
    samples = (
        ArenaSample(0, 20.4, "energy", stores),
        ArenaSample(0, 21.0, "energy", stores),
    )
    show.tell(replace(news(1, 1, 2), samples=samples))
    for times_s in ((20.0, 20.2, 20.4, 20.6), (20.8, 21.0, 21.2)):
        rows = poses([first, second], *times_s, joints={first: 0, second: 0})
        show.move(0, rows.rows())
    painted = [call.args for call in recording.paint.call_args_list]
    times = [when.sim_time_s for _, _, when in painted]
    assert sorted(times) == [20.4] * 2 + [20.8] * 2 + [21.0] * 2
    assert {path for path, _, _ in painted} == {
        f"islands/0/robots/0-{n}" for n in (0, 1)
    }
    shown = [call.args for call in recording.overlay.call_args_list]
    assert [when.sim_time_s for *_, when in shown] == [
        20.0, 20.2, 20.4, 20.6, 20.8, 21.0, 21.2
    ]  # fmt: skip
    texts = [text for _, _, text, _ in shown]
    assert texts == [""] * 2 + ["energy: blue 0, yellow 4"] * 5
