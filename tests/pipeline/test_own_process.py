"""What is not loaded, and that nothing else shows it."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from uavgram.pipeline import own_process

PACKAGE = """
from . import second
from .first import One as One, two
import colorsys as colours

HERE = "stated here"
"""


@pytest.fixture
def loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """A package that is loaded piecemeal, and one that is loaded late; what was executed."""
    folder = tmp_path / "pieces"
    folder.mkdir()
    (folder / "__init__.py").write_text(PACKAGE, encoding="utf-8")
    told = "import sys; sys.executed.add(__name__)\n"
    (folder / "first.py").write_text(f"{told}class One: pass\ntwo = 2\n", encoding="utf-8")
    (folder / "second.py").write_text(f"{told}three = 3\n", encoding="utf-8")
    (tmp_path / "lately.py").write_text(f"{told}four = 4\n", encoding="utf-8")
    executed: set[str] = set()
    monkeypatch.setattr(sys, "executed", executed, raising=False)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    monkeypatch.setattr(own_process, "PIECEMEAL", frozenset({"pieces"}))
    monkeypatch.setattr(own_process, "LATE", frozenset({"lately"}))
    for name in ("pieces", "pieces.first", "pieces.second", "lately"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    own_process.load_little()
    return executed


def test_a_module_is_loaded_for_a_name_of_it(loaded: set[str]) -> None:
    pieces = importlib.import_module("pieces")
    assert loaded == set()
    assert pieces.two == 2
    assert loaded == {"pieces.first"}
    assert pieces.second.three == 3
    assert pieces.One is importlib.import_module("pieces.first").One
    assert pieces.colours is importlib.import_module("colorsys")


def test_what_a_package_states_itself_is_there(loaded: set[str]) -> None:
    pieces = importlib.import_module("pieces")
    assert pieces.HERE == "stated here"
    assert loaded == {"pieces.first", "pieces.second"}
    with pytest.raises(AttributeError):
        _ = pieces.nothing


def test_what_is_late_is_executed_when_it_is_asked(loaded: set[str]) -> None:
    lately = importlib.import_module("lately")
    assert loaded == set()
    assert lately.four == 4
    assert loaded == {"lately"}


def test_what_is_never_needed_is_not_found(loaded: set[str]) -> None:
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("pandas.nothing")
    assert loaded == set()
