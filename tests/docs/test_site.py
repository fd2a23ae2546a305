"""Links of all Markdown files, the navigation of the docs site, and its build."""

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
DOCS = TOP / "docs"
FILES = [
    *sorted(TOP.glob("*.md")),
    *(file for file in sorted(DOCS.rglob("*.md")) if "_build" not in file.parts),
]
# Not pages of the site.
_ASIDE = ["index", "data/README"]


def _prose(file: Path) -> str:
    """Return the text of a page without its blocks of code."""
    text = file.read_text("utf-8")
    return re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL)


def _anchors(file: Path) -> set[str]:
    """Return the anchors of a page's headings, as code hosts and MyST make them."""
    found: Counter[str] = Counter()
    anchors = set()
    for title in re.findall(r"^#+ (.*)$", _prose(file), re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        anchors.add(f"{slug}-{found[slug]}" if found[slug] else slug)
        found[slug] += 1
    return anchors


def _problems(file: Path) -> Iterator[str]:
    """Yield the links of a page that lead nowhere."""
    prose = re.sub(r"`[^`\n]*`", "", _prose(file))
    for link in re.findall(r"\]\(([^)\s]+)\)", prose):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = file.parent / name if name else file
        # The site has no page of a folder, code hosts have.
        if not target.is_file() or (anchor and anchor not in _anchors(target)):
            yield link


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(TOP)))
def test_links_lead_to_files_and_headings(file: Path) -> None:
    assert list(_problems(file)) == []


def test_navigation_has_every_page_once() -> None:
    index = (DOCS / "index.md").read_text("utf-8")
    blocks = re.findall(r"^```\{toctree\}\n([^`]*)^```", index, re.MULTILINE)
    lines = [line for block in blocks for line in block.splitlines()]
    entries = [line for line in lines if line and not line.startswith(":")]
    named = [re.sub(r"^.*<(.*)>$", r"\1", entry) for entry in entries]
    assert len(set(named)) == len(named)
    pages = [
        file.relative_to(DOCS).with_suffix("").as_posix()
        for file in [*FILES, *DOCS.glob("notebooks/*.ipynb")]
        if file.is_relative_to(DOCS)
    ]
    for page in pages:
        matches = [name for name in named if fnmatchcase(page, name)]
        assert page in _ASIDE or matches, f"{page} is not in docs/index.md"
    for name in named:
        assert any(fnmatchcase(page, name) for page in pages), name


@pytest.mark.long
@pytest.mark.system
def test_site_builds_without_warnings_and_needs_no_network(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-E", "-W", "--keep-going",
         "-d", str(tmp_path / "doctrees"), str(DOCS), str(tmp_path / "html")],
        cwd=TOP, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    html = tmp_path / "html"
    for page in html.rglob("*.html"):
        loaded = re.findall(
            r"<(?:script|link|img)\b[^>]*=\"(https?:[^\"]*)", page.read_text()
        )
        assert loaded == [], page
    # Words are stemmed, here and in the search.
    assert '"tournament_s"' in (html / "searchindex.js").read_text()
    assert 'id="selectionculling"' in (html / "reference" / "settings.html").read_text()
