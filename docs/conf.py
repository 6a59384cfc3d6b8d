"""The documentation as a site: `make docs` builds it with Sphinx, and a warning is a failure.

The pages are the Markdown of this folder, readable as they are. Two parts are written while the site is built:
the options of every command, from the commands (`site/command_pages.py`), and the reference of every room of the
package, from its docstrings (`site/room_pages.py`).
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "site"))

from command_pages import write_command_pages, write_page  # noqa: E402  (found where the line above says)
from contents import CONTENTS, with_reader  # noqa: E402  (as above)
from notebook_pages import write_notebook_page  # noqa: E402  (as above)
from room_pages import write_room_pages  # noqa: E402  (as above)

import tumble  # noqa: E402  (sorted by the same rule as those above)

project = "tumble"
author = "The tumble authors"
copyright = "The tumble authors, Apache-2.0"
version = release = tumble.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
exclude_patterns = ["_build", "site"]

# Markdown: anchors as code hosts make them, so that one link serves both; mathematics between dollars.
myst_enable_extensions = ["dollarmath", "attrs_inline"]
myst_heading_anchors = 6
# `python` is written for both: as an example that the tests run, and for its colours.
highlight_language = "text"

autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = "tumble"
html_show_sourcelink = False
html_static_path, html_css_files = ["site/static"], ["tables.css"]

# Pages of the repository's root, which the site shows too.
COPIED = ("CONTRIBUTING", "CHANGELOG")
for name in COPIED:
    text = (HERE.parent / f"{name}.md").read_text(encoding="utf-8").replace("](docs/", "](/")
    write_page(HERE / "reference" / f"{name.lower()}.md", text)
write_command_pages(HERE / "reference" / "commands")
write_room_pages(HERE / "reference" / "rooms")
for notebook in HERE.glob("*.ipynb"):
    write_notebook_page(notebook, HERE / "reference" / f"{notebook.stem}-notebook.md")

# Types in docstrings are words ("rate in Hz"), which Sphinx takes for the names of attributes, of several at once.
suppress_warnings = ["ref.python"]


def setup(app: Sphinx) -> None:
    """Have the contents added to the first page, and links to files above this folder led to their copies."""
    app.connect("source-read", _for_the_site)


def _for_the_site(_app: Sphinx, page: str, source: list[str]) -> None:
    for name in COPIED:
        source[0] = re.sub(rf"\]\((?:\.\./)+{name}\.md", f"](/reference/{name.lower()}.md", source[0])
    source[0] = with_reader(page, source[0])
    if page == root_doc:
        for caption, pages in CONTENTS.items():
            lines = ["", "```{toctree}", ":hidden:", ":glob:", f":caption: {caption}", "", *pages, "```", ""]
            source[0] += "\n".join(lines)
