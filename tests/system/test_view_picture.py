"""Tests of screenshots of a headless viewer, live and in a replay.

They need a Vulkan driver (Debian: mesa-vulkan-drivers) and are skipped without one.
"""

import io
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow.compute as pc
import pytest
from PIL import Image
from rerun.experimental import ViewerClient

from schema.tables.files import read_table
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

Floats = npt.NDArray[np.float64]

PICTURE_TIME_S = 12.0
"""Time at which all founders are alive [s]."""
FIELD_OF_VIEW = np.radians(55.0)
EYE = 1.2 * 1.3 * 0.4 * np.array([0.35, -1.0, 0.8])
"""Position of the camera that the layout defines for an arena of 0.4 m."""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@pytest.fixture
def viewer() -> Iterator[ViewerClient]:
    program = str(Path(sys.executable).parent / "rerun")
    try:
        client = ViewerClient.spawn(
            headless=True,
            port=free_port(),
            hide_welcome_screen=True,
            executable_path=program,
        )
        client.take_screenshot()
    except Exception as error:  # noqa: BLE001 - the library raises many types
        pytest.skip(f"no viewer without a Vulkan driver: {type(error).__name__}")
    with client:
        yield client


def screenshot(viewer: ViewerClient, source: str) -> Floats:
    """Check all views and return a picture of the arena (H, W, 3)."""
    viewer.open(source)
    deadline = time.monotonic() + 60.0
    while viewer.get_state().loading or not viewer.get_state().views:
        assert time.monotonic() < deadline, "the viewer never has the recording"
        time.sleep(0.1)
    time.sleep(1.0)  # the viewer does not report when a recording is active
    viewer.set_time("sim_time", duration=PICTURE_TIME_S, play_state="paused")
    time.sleep(2.0)  # nor when data loaded on demand is drawn
    views = {view.name: view for view in viewer.get_state().views}
    assert {"Arena 0", "Fitness", "Population", "Ancestry", "Workers"} <= views.keys()
    assert [view.reports for view in views.values() if view.reports] == []
    image = viewer.take_screenshot(view_id=views["Arena 0"].view_id)
    return np.asarray(Image.open(io.BytesIO(image)).convert("RGB"), dtype=np.float64)


def pixels(positions: Floats, height: int, width: int) -> Floats:
    """Project points (N, 3) to columns and rows (N, 2) of a picture."""
    forward = -EYE / np.linalg.norm(EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    relative = positions - EYE
    scale = 0.5 * height / np.tan(0.5 * FIELD_OF_VIEW) / (relative @ forward)
    across, up = relative @ right * scale, relative @ np.cross(right, forward) * scale
    return np.stack([0.5 * width + across, 0.5 * height - up], axis=1)


def check_robots(picture: Floats, folder: Path) -> None:
    """Check that most cores are visible in their colours at the recorded positions."""
    rows = read_table(folder, "poses")
    rows = rows.filter(
        pc.less(pc.abs(pc.subtract(rows["sim_time_s"], PICTURE_TIME_S)), 1e-6)
    )
    colours = {
        row["birth"]: np.array(row["body"][0]["params"][-3:]) * 255.0
        for row in read_table(folder, "births").to_pylist()
    }
    positions = np.stack([rows[axis].to_numpy() for axis in "xyz"], axis=1)
    height, width, _ = picture.shape
    found = []
    for birth, (column, row) in zip(
        rows["birth"].to_pylist(), pixels(positions, height, width), strict=True
    ):
        x, y = round(column), round(row)
        if not (2 <= x < width - 2 and 2 <= y < height - 2):
            continue
        shown = picture[y - 2 : y + 3, x - 2 : x + 3].reshape(-1, 3)
        # Light and shade change the brightness of a face, not its hue.
        faces = [_hue(colours[birth]) @ _hue(each) for each in shown]
        found.append(max(faces) > 0.995)
    assert len(found) >= 3
    assert np.mean(found) >= 0.75


def _hue(colour: Floats) -> Floats:
    return np.asarray(colour / max(float(np.linalg.norm(colour)), 1e-9))


def test_replay_shows_robots_at_their_recorded_positions(
    viewer: ViewerClient, workspace: Workspace, small_arena_run: Path
) -> None:
    workspace.run("view", str(small_arena_run), "--save", "run.rrd")
    picture = screenshot(viewer, str(workspace.folder / "run.rrd"))
    check_robots(picture, small_arena_run)
    # The check rejects a mirrored picture.
    with pytest.raises(AssertionError):
        check_robots(picture[:, ::-1], small_arena_run)
    # The script of the page about viewing draws the recording, too.
    script = Path(__file__).parents[2] / "docs" / "examples" / "viewer_picture.py"
    own = workspace.folder / "run.png"
    subprocess.run(
        [sys.executable, str(script), "run.rrd", str(own), str(free_port())],
        cwd=workspace.folder, check=True,
    )  # fmt: skip
    shown = Image.open(own).convert("RGB")
    colours = shown.getcolors(maxcolors=shown.width * shown.height)
    assert len(colours or []) > 100
