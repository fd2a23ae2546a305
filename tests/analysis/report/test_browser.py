"""Report in a real browser: no script error, no overlap, nothing too wide."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from tests.analysis.reported import drawings, page, tables

pytestmark = [pytest.mark.long, pytest.mark.timeout(180)]

WIDE, SCREEN = 1000, 720
"""Width from which on, and height at which the difference must be seen [pixels]."""
_FRAME = """<!DOCTYPE html><pre id="found"></pre><script>
window.addEventListener("message", (event) => {
  document.getElementById("found").textContent = event.data;
});
</script><iframe src="page.html" width="WIDTH" height="800" style="border: 0"></iframe>
"""
"""Page with the report in a frame: windows of Chromium are at least 500 pixels wide."""
_PROBE = """
<script>
const errors = [];
window.addEventListener("error", (event) => errors.push(event.message));
</script>
"""
_LOOK = """
<script>
window.addEventListener("load", () => {
  for (const fold of document.querySelectorAll("details")) fold.open = true;
  const wide = document.documentElement.clientWidth;
  const box = (one) => one.getBoundingClientRect();
  const name = (one) => `${one.tagName} ${one.textContent.slice(0, 40)}`;
  const seen = [...document.querySelectorAll(
    "h1, h2, h3, p, nav, figure, .scroll, summary, pre, svg.plot, svg.bar")
  ].filter((one) => box(one).width && box(one).height);
  const outside = seen.filter((one) => box(one).left < -1 || box(one).right > wide + 1);
  // Those that contain each other may cover each other.
  const overlapping = [];
  const covers = (a, b) => {
    const [first, second] = [box(a), box(b)];
    return Math.min(first.right, second.right) - Math.max(first.left, second.left) > 1
      && Math.min(first.bottom, second.bottom) - Math.max(first.top, second.top) > 1;
  };
  seen.forEach((a, at) => seen.slice(at + 1).forEach((b) => {
    if (!a.contains(b) && !b.contains(a) && covers(a, b)) {
      overlapping.push(`${name(a)} / ${name(b)}`);
    }
  }));
  for (const plot of document.querySelectorAll("svg.plot")) {
    const texts = [...plot.querySelectorAll("text")];
    texts.forEach((a, at) => {
      if (box(a).left < box(plot).left - 1 || box(a).right > box(plot).right + 1) {
        overlapping.push(`${a.textContent} leaves the plot`);
      }
      texts.slice(at + 1).forEach((b) => {
        if (covers(a, b)) overlapping.push(`${a.textContent} / ${b.textContent}`);
      });
    });
  }
  const mark = document.querySelector("svg.plot circle");
  mark.dispatchEvent(new PointerEvent("pointermove", { bubbles: true }));
  const tip = document.getElementById("tip");
  parent.postMessage(JSON.stringify({
    errors, overlapping, outside: outside.map(name), wide,
    scrolls: document.documentElement.scrollWidth - wide,
    tip: tip.hidden ? "" : tip.textContent,
    broken: [...document.images].filter((one) => !one.naturalWidth).length,
    compared: Math.max(...[...document.querySelectorAll(".difference")]
      .slice(0, 1).map((one) => box(one).bottom)),
  }), "*");
});
</script>
"""


@pytest.fixture(scope="module")
def chromium() -> str:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    pytest.skip("no Chromium is installed")


def looked_at(chromium: str, shown: str, folder: Path, width: int) -> dict[str, Any]:
    """Return what a script finds in a page that a browser shows from a file."""
    probed = shown.replace("<body>", f"<body>{_PROBE}")
    probed = probed.replace("</body>", f"{_LOOK}</body>")
    (folder / "page.html").write_text(probed, encoding="utf-8")
    frame = folder / "frame.html"
    frame.write_text(_FRAME.replace("WIDTH", str(width)), encoding="utf-8")
    command = [chromium, "--headless=new", "--no-sandbox", "--disable-gpu",
               f"--user-data-dir={folder / 'profile'}", "--window-size=1400,900",
               "--hide-scrollbars", "--virtual-time-budget=5000", "--dump-dom",
               frame.as_uri()]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    (found,) = re.findall(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    answer: dict[str, Any] = json.loads(unescape(found))
    return answer


@pytest.mark.parametrize("width", [1280, 400])
def test_a_browser_shows_the_report_without_errors_or_overlaps(
    chromium: str, tmp_path: Path, width: int
) -> None:
    shown = page(tables(), drawings(tmp_path))
    found = looked_at(chromium, shown, tmp_path, width)
    assert found["errors"] == []
    assert found["overlapping"] == []
    assert found["outside"] == []
    assert found["scrolls"] <= 0
    assert found["broken"] == 0
    assert "seed" in found["tip"]
    assert found["wide"] == width
    if width > WIDE:  # the difference is on the first screen
        assert 0 < found["compared"] < SCREEN
