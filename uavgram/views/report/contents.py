"""Contents of a page, made from its own headings."""

from __future__ import annotations

import re

PLACE = "<!-- contents -->"
_HEADING = re.compile(r'<section id="([\w-]+)">\s*<h2>(.*?)</h2>', re.DOTALL)


def with_contents(html: str) -> str:
    """Insert the list of sections at its place in the page; the PDF adds page numbers."""
    rows = [f'<li><a href="#{name}">{words}</a></li>' for name, words in _HEADING.findall(html)]
    listed = "\n".join(rows)
    title = '<p class="title"><b>Contents</b></p>'
    nav = f'<nav class="contents">\n{title}\n<ol>\n{listed}\n</ol>\n</nav>'
    return html.replace(PLACE, nav, 1)
