"""Make the notebook from its script, with what each cell prints: `python docs/make_notebook.py`.

Cells begin at `# %%`; those with `[markdown]` are text. Run it in the root of a clone.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).parent / "examples"


def cells(script: str) -> list[tuple[str, str]]:
    """Return kind (``markdown`` or ``code``) and text of each cell."""
    found = []
    for part in script.split("# %%")[1:]:
        head, _, body = part.partition("\n")
        if "[markdown]" in head:
            lines = [line.removeprefix("#").removeprefix(" ") for line in body.strip().splitlines()]
            found.append(("markdown", "\n".join(lines)))
        else:
            found.append(("code", body.strip()))
    return found


def notebook(script: str, shown: list[str]) -> str:
    """Return the notebook as JSON.

    Parameters
    ----------
    script
        With its cells.
    shown
        What each code cell prints, in their order.
    """
    made: list[dict[str, Any]] = []
    outputs = iter(enumerate(shown, start=1))
    for number, (kind, text) in enumerate(cells(script), start=1):
        cell: dict[str, Any] = {"cell_type": kind, "id": f"cell{number:02}", "metadata": {}}
        cell["source"] = text.splitlines(keepends=True)
        if kind == "code":
            count, printed = next(outputs)
            lines = printed.splitlines(keepends=True)
            stream = {"name": "stdout", "output_type": "stream", "text": lines}
            cell |= {"execution_count": count, "outputs": [stream] if lines else []}
        made.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def executed(script: str) -> list[str]:
    """Run the code cells in one namespace, and return what each of them prints."""
    names: dict[str, Any] = {"__file__": str(EXAMPLES / "survey.py")}
    shown = []
    for text in (text for kind, text in cells(script) if kind == "code"):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(text, "survey.py", "exec"), names)  # noqa: S102  (our own words)
        shown.append(said.getvalue())
    return shown


if __name__ == "__main__":
    text = (EXAMPLES / "survey.py").read_text(encoding="utf-8")
    (EXAMPLES / "survey.ipynb").write_text(notebook(text, executed(text)), encoding="utf-8")
    sys.stdout.write("written: docs/examples/survey.ipynb\n")
