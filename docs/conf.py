"""Settings of the documentation site, which `make docs` builds with Sphinx.

The pages stay plain Markdown that reads well on a code host, too. docs/index.md has the
navigation. Notebooks show the output that is stored in them; tests run them.
"""

import re
from pathlib import Path

import msgspec
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.nodes import make_refnode

_PROJECT = msgspec.toml.decode(
    (Path(__file__).parents[1] / "pyproject.toml").read_bytes()
)["project"]
_PATTERN = re.compile(r"[\w/*]+\*")

project = "Revolve Islands"
version = release = _PROJECT["version"]
html_title = f"{project} {version}"

extensions = ["myst_nb"]
exclude_patterns = ["_build", "data"]
myst_heading_anchors = 4
nb_execution_mode = "off"
# Code without a language is a command, its output or a message.
highlight_language = "text"

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False


def _folder_page(
    app: Sphinx, environment: BuildEnvironment, reference: pending_xref, shown: object
) -> object:
    """Return a link to the first page of a folder, for a link to the folder."""
    folder = Path(reference["refdoc"]).parent / reference["reftarget"]
    top = Path(app.srcdir)
    if not (top / folder).is_dir():
        return None
    name = (top / folder).resolve().relative_to(top.resolve()).as_posix()
    pages = sorted(page for page in environment.all_docs if page.startswith(f"{name}/"))
    page = f"{name}/README" if f"{name}/README" in pages else next(iter(pages), None)
    if page is None:
        return None
    return make_refnode(app.builder, reference["refdoc"], page, "", [shown])


def _without_empty_patterns(app: Sphinx, page: str, source: list[str]) -> None:
    """Drop patterns of the navigation that match no page."""
    if page == "index":
        source[0] = "\n".join(
            line
            for line in source[0].splitlines()
            if not _PATTERN.fullmatch(line) or [*Path(app.srcdir).glob(f"{line}.*")]
        )


def setup(app: Sphinx) -> None:
    """Connect the events."""
    app.connect("source-read", _without_empty_patterns)
    app.connect("missing-reference", _folder_page)
