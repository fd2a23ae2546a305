"""Report in a real browser: no script error, no overlap, nothing too wide."""

from pathlib import Path

import pytest

from tests.analysis.browser import looked_at
from tests.analysis.reported import drawings, page, tables

pytestmark = pytest.mark.long

WIDE, SCREEN = 1000, 720
"""Width from which on, and height at which the difference must be seen [pixels]."""
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
  const mark = document.querySelector("svg.plot .dots use");
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


@pytest.mark.parametrize("width", [1280, 400])
def test_a_browser_shows_the_report_without_errors_or_overlaps(
    tmp_path: Path, width: int
) -> None:
    shown = page(tables(), drawings(tmp_path))
    found = looked_at(shown, _LOOK, tmp_path, width)
    assert found["errors"] == []
    assert found["overlapping"] == []
    assert found["outside"] == []
    assert found["scrolls"] <= 0
    assert found["broken"] == 0
    assert "seed" in found["tip"]
    assert found["wide"] == width
    if width > WIDE:  # the difference is on the first screen
        assert 0 < found["compared"] < SCREEN
