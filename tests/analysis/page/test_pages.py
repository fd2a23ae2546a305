"""Pages of robots: their content, and what a browser makes of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from analysis.page.content import grounds, moving, packed, page
from analysis.page.robots import robot_page
from analysis.render.files import NoPictures
from analysis.render.flags import page_parser
from analysis.render.motion import recorded
from analysis.viewer.body import box_model, place
from analysis.viewer.ground import surfaces
from schema.experiment.document import body_space
from schema.experiment.environment import Environment
from schema.formats.files import settings_of
from schema.robot.trace import Floats
from tests.analysis.browser import looked_at
from worker.bench.spider import spider
from worker.robot.evaluation import simulate

SETTINGS = settings_of(None)
CLOCK = replace(SETTINGS.simulation, warmup_steps=0, window_steps=200)
SPACE = body_space(SETTINGS.space)
SPIDER = spider()
BOX = '<geom type="box" size=".1 .2 .3" pos="1 2 3" rgba="1 0 0 1"/>'
_LOOK = """
<script>
window.addEventListener("load", () => {
  isPlaying = false;
  seek(begin_s + AT);
  const seen = [];
  for (let n = 0; n < robots[0].boxes.length; n++) {
    robots[0].mesh.getMatrixAt(n, matrix);
    seen.push(...new T.Vector3().setFromMatrixPosition(matrix));
  }
  const wide = document.documentElement.clientWidth;
  parent.postMessage(JSON.stringify({
    errors, seen, wide, scrolls: document.documentElement.scrollWidth - wide,
    charts: document.querySelectorAll("figure canvas").length,
    ancestors: document.querySelectorAll("#ancestry line").length,
    text: document.body.innerText, drawn: renderer.info.render.triangles,
    fetched: performance.getEntriesByType("resource").length,
  }), "*");
});
</script>
"""


@pytest.fixture(scope="module")
def motion() -> tuple[Floats, list[Floats]]:
    """Return the states of a spider every 0.04 s, and the commands of its ticks."""
    commands: list[Floats] = []
    settings = replace(SETTINGS, simulation=CLOCK)
    return np.array(recorded(simulate, SPIDER, settings, 0.04, commands)), commands


def content(rows: Floats, commands: list[Floats]) -> dict[str, Any]:
    level = [{"row": 1, "name": "0:7", "fitness": 0.25}]
    parents = [{"row": row, "name": f"0:{row}", "fitness": None} for row in (2, 3)]
    robot = moving(
        "spider </script>", SPIDER, SPACE, rows, interval_s=0.04, fitness=0.25,
        commands=packed(commands), commands_s=CLOCK.tick_s, motors=len(commands[0]),
        ancestry={"levels": [level, parents], "edges": [(1, 2), (1, 3)]},
    )  # fmt: skip
    rough = Environment(
        roughness_m=0.01,
        scenery=f"<mujoco><worldbody>{BOX}</worldbody></mujoco>",
        light=(1.0, 1.0, 0.5),
    )
    below = surfaces(rough, CLOCK, rough.light)
    wall = np.array([[2.0, 0, 0.1, 1, 0, 0, 0, 0.1, 0.5, 0.1]])
    curve = {"title": "robots alive", "times": [0.0, 1.0], "values": [3, 5]}
    return {"robots": [robot], "grounds": grounds(below, wall), "curves": [curve]}


@pytest.mark.long
@pytest.mark.parametrize("width", [1280, 400])
def test_a_browser_moves_robots_as_the_viewer_does(
    motion: tuple[Floats, list[Floats]], tmp_path: Path, width: int
) -> None:
    """Places of all boxes, at a recorded state, equal those of the viewer."""
    rows, commands = motion
    shown = page("A title", "A lead", content(rows, commands))
    found = looked_at(shown, _LOOK.replace("AT", "0.40"), tmp_path, width)
    assert found["errors"] == []
    assert found["fetched"] == 0
    assert found["wide"] == width
    assert found["scrolls"] <= 0
    model = box_model(SPIDER, SPACE, is_plain=False)
    centres, _ = place(model, rows[10:11, :7], rows[10:11, 7:])
    assert found["seen"] == pytest.approx(centres[0].ravel().tolist(), abs=1e-4)
    assert (found["charts"], found["ancestors"]) == (2, 2)
    assert found["drawn"] > 12 * len(model.segments)
    for text in ("A title", "spider </script>", "fitness 0.250", "robots alive"):
        assert text in found["text"]


def test_pages_are_small_and_name_no_address(
    motion: tuple[Floats, list[Floats]],
) -> None:
    """One robot of 30 s in at most 1.5 MB, ten in 4 MB."""
    rows, commands = (np.tile(each, (20, 1))[:750] for each in motion)
    one = content(rows, list(commands))
    assert len(page("One", "", one)) < 1_500_000
    ten = page("Ten", "", {**one, "robots": one["robots"] * 10})
    assert len(ten) < 4_000_000
    assert 'src="' not in ten
    assert "<link" not in ten


def test_a_page_has_its_ending(tmp_path: Path) -> None:
    options = page_parser().parse_args(["a.yaml", str(tmp_path / "a.htm")])
    with pytest.raises(NoPictures, match=r"must end in \.html, got '\.htm'"):
        robot_page(options, simulate, lambda *_: None)  # type: ignore[arg-type]
