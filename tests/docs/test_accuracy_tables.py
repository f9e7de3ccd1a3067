"""The page of accuracies: its tables are where the command puts them, and say what they should."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from accuracy_tables import Compared, height_row, joined, length_row, replaced

ROOT = Path(__file__).parents[2]


def compared(error: list[float], sigma: float, true: float) -> Compared:
    return Compared("a", np.array(error), np.full(len(error), sigma), np.full(len(error), true))


def test_a_row_tells_errors_and_honesty() -> None:
    some = joined("both", [compared([0.1, -0.1], 0.1, 10.0), compared([0.8, 0.0], 0.2, 20.0)])

    # z is 1, 1, 4, 0; shares of the lengths are 1, 1, 4, 0 per cent
    share = ("both", "4", "1.50 %", "1.00 %", "75 %")
    assert length_row(some) == (*share, "2.12", "25.0 %")
    assert height_row(some) == ("both", "4", "25.0 cm", "15.0 cm", "2.12", "25.0 %")


def test_only_what_is_made_is_replaced() -> None:
    page = "words\n<!-- made: a -->\nold\n<!-- end: a -->\nmore\n"

    again = replaced(page, "a", r"new \1")
    assert again == "words\n<!-- made: a -->\nnew \\1\n<!-- end: a -->\nmore\n"
    assert replaced(again, "a", r"new \1") == again
    with pytest.raises(ValueError, match="0 places for 'b'"):
        replaced(page, "b", "new")


def test_the_page_has_a_table_of_each_section(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(ROOT / "tests" / "benchmarks")])
    script = importlib.import_module("make_accuracy")
    page = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
    for name in script.SECTIONS:
        made = page.partition(f"<!-- made: {name} -->")[2].partition(f"<!-- end: {name} -->")[0]
        assert made.strip().startswith("| measured |"), name
        assert replaced(page, name, made.strip("\n")) == page
