"""Pages of the manual and README as code blocks, and how each of them is run.

A block is run in the folder that its page names (`<!-- folder: demo -->`; else an empty one), or is
marked: `<!-- not run: reason -->` before it, or `<!-- no block of this page is run: reason -->`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DIRECTIVES = re.compile(r"\{[\w-]+\}")
_BLOCK = re.compile(
    r"^(?P<indent> *)```(?P<language>[^\s`]*)[^\n]*\n(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
_MARK = re.compile(r"<!-- not run: (?P<why>[^\n]+) -->\s*\Z")
_PAGE_MARK = re.compile(r"<!-- no block of this page is run: (?P<why>[^\n]+) -->")
_FOLDER = re.compile(r"<!-- folder: (\w+) -->")


@dataclass(frozen=True)
class Block:
    """A code block.

    Attributes
    ----------
    page
        Its file, below the repository.
    language
        ``sh``, ``python``, ``csv``, ``yaml`` or ``text`` (what a command prints).
    text
        What it holds.
    why_not_run
        The reason of its mark; empty: it is run.
    """

    page: str
    language: str
    text: str
    why_not_run: str


@dataclass(frozen=True)
class ManualPage:
    """A page as it is written.

    Attributes
    ----------
    name
        Its file, below the repository.
    text
        What it holds.
    """

    name: str
    text: str

    @property
    def folder(self) -> str:
        """Which folder its commands are run in: ``empty``, ``demo`` or ``configs``."""
        found = _FOLDER.search(self.text)
        return found[1] if found else "empty"

    @property
    def blocks(self) -> list[Block]:
        """Its code blocks; directives of the site are none."""
        of_page = _PAGE_MARK.search(self.text)
        blocks = []
        for found in _BLOCK.finditer(self.text):
            if DIRECTIVES.match(found["language"]):
                continue
            mark = _MARK.search(self.text[: found.start()]) or of_page
            indent = found["indent"]
            lines = [line.removeprefix(indent) for line in found["text"].splitlines()]
            why = mark["why"].strip() if mark else ""
            blocks.append(Block(self.name, found["language"], "\n".join(lines) + "\n", why))
        return blocks

    def run(self, language: str) -> list[str]:
        """Texts of the blocks of a language that are run."""
        blocks = (block for block in self.blocks if not block.why_not_run)
        return [block.text for block in blocks if block.language == language]


def manual_pages() -> list[ManualPage]:
    """README and all pages of the site that people write, in the order of their names."""
    written = (path for path in (ROOT / "docs").rglob("*.md") if path.parent.name != "made")
    paths = [ROOT / "README.md", *sorted(written)]
    return [
        ManualPage(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
        for path in paths
    ]
