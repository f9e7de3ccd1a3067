"""A page of HTML as its tags and the rows of its tables."""

from __future__ import annotations

from html.parser import HTMLParser


class Page(HTMLParser):
    """Tags, texts and rows of cells; fails where tags do not nest.

    Attributes
    ----------
    tags
        Names and attributes, in order.
    rows
        Texts of the cells of every row of a table.
    drawn
        Of every row, the attributes of the rectangles that are drawn in it.
    """

    VOID = ("meta", "br", "col")

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self.drawn: list[list[dict[str, str | None]]] = []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
            self.drawn.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "rect" and "td" in self.open:
            self.drawn[-1].append(dict(attrs))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if any(tag in self.open for tag in ("td", "th")) and "svg" not in self.open:
            self.rows[-1][-1] += data.strip("\n")
