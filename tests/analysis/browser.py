"""Chromium without a window: what a script finds in a page of a width."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

import pytest

_FRAME = """<!DOCTYPE html><pre id="found"></pre><script>
window.addEventListener("message", (event) => {
  document.getElementById("found").textContent = event.data;
});
</script><iframe src="page.html" width="WIDTH" height="800" style="border: 0"></iframe>
"""
"""Page in a frame: windows of Chromium are at least 500 pixels wide."""
_PROBE = """
<script>
const errors = [];
window.addEventListener("error", (event) => errors.push(event.message));
</script>
"""
_WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def chromium() -> str:
    """Return the path of a browser, or skip the test."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    pytest.skip("no Chromium is installed")


def looked_at(shown: str, look: str, folder: Path, width: int) -> dict[str, Any]:
    """Return what a script finds in a page that a browser shows from a file.

    The script posts JSON to its parent; ``errors`` are those of scripts before it.
    """
    probed = shown.replace("<body>", f"<body>{_PROBE}")
    probed = probed.replace("</body>", f"{look}</body>")
    (folder / "page.html").write_text(probed, encoding="utf-8")
    frame = folder / "frame.html"
    frame.write_text(_FRAME.replace("WIDTH", str(width)), encoding="utf-8")
    command = [chromium(), "--headless=new", "--no-sandbox", *_WEBGL,
               f"--user-data-dir={folder / 'profile'}", "--window-size=1400,900",
               "--hide-scrollbars", "--virtual-time-budget=5000", "--dump-dom",
               frame.as_uri()]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    (found,) = re.findall(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    answer: dict[str, Any] = json.loads(unescape(found))
    return answer
