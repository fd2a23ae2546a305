"""Settings of the documentation site, which `make docs` builds with Sphinx.

The pages stay plain Markdown that reads well on a code host, too. docs/index.md has the
navigation. Notebooks show the output that is stored in them; tests run them.
"""

import re

from sphinx.application import Sphinx

from schema.agent.version import VERSION

_TOP_FILE = re.compile(r"\]\(((?:\.\./)*)\.\./(CHANGELOG|CONTRIBUTING)\.md")

project = "Revolve Islands"
version = release = VERSION
html_title = f"{project} {version}"

extensions = ["myst_nb"]
exclude_patterns = ["_build"]
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


def _link_to_included(_app: Sphinx, _page: str, source: list[str]) -> None:
    """Turn links to files of the top folder into links to the pages that show them."""
    source[0] = _TOP_FILE.sub(
        lambda match: f"]({match[1]}about/{match[2].lower()}.md", source[0]
    )


def setup(app: Sphinx) -> None:
    """Connect the event."""
    app.connect("source-read", _link_to_included)
