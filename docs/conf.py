"""Build the manual: `sphinx-build -W docs build/site`. A dead link is an error."""

from __future__ import annotations

import importlib.metadata
import re
import sys
from dataclasses import is_dataclass
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import generated  # noqa: E402  (beside this file)

project = "uavgram"
author = "the authors of uavgram"
release = importlib.metadata.version("uavgram")
html_title = f"uavgram {release}"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["examples/*.ipynb"]
source_suffix = {".md": "markdown"}
myst_enable_extensions = ["attrs_block"]
myst_heading_anchors = 4
suppress_warnings = [
    "myst.header",  # pages that the program writes begin at the levels that they need
]

napoleon_google_docstring = False
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
python_use_unqualified_type_names = True

# Everything is served from the site itself: no font and no script comes from elsewhere.
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_extra_path = ["field-card-to-print.html"]
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"

generated.write(DOCS / "reference" / "made", DOCS / "background" / "made")


FOR_ALL = (
    ('<aside class="sidebar-drawer">', '<aside class="sidebar-drawer" aria-label="All pages">'),
    ('<aside class="toc-drawer', '<aside aria-label="On this page" class="toc-drawer'),
    ('<th class="head"><p></p></th>', '<td class="head"></td>'),
    ('<div id="search-results"></div>', '<h1>Search</h1>\n<div id="search-results"></div>'),
    ("<pre>", '<pre tabindex="0">'),
    ('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper'),
)
"""What the theme leaves out for people who use no mouse or hear the page: text, and better."""


def _for_all(app: Sphinx, fault: Exception | None) -> None:
    """Name landmarks, and let the keyboard reach what can be scrolled."""
    for path in () if fault else Path(app.outdir).rglob("*.html"):
        text = better = path.read_text(encoding="utf-8")
        for old, new in FOR_ALL:
            better = better.replace(old, new)
        if better != text:
            path.write_text(better, encoding="utf-8")


def _bare(_app: Sphinx, what: str, _name: str, thing: object, *_: object) -> tuple[str, str] | None:
    """Leave out how a class is made: users are handed its instances, and each field is listed."""
    return ("", "") if what == "class" and is_dataclass(thing) else None


def _show_drawings(_app: Sphinx, _page: str, source: list[str]) -> None:
    """Show drawings in place of their descriptions, which a page has outside of the site."""
    source[0] = re.sub(r"^\*Drawing `(\S+)`: (.+)\*$", r"![\2](\1)", source[0], flags=re.MULTILINE)


def setup(app: Sphinx) -> None:
    """Show tables as they are, and mend the pages once they are written."""
    app.connect("autodoc-process-signature", _bare)
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", _show_drawings)
    app.connect("build-finished", _for_all)
