"""Templates that stay compiled say what they would say if they were compiled anew."""

from __future__ import annotations

import sys
from pathlib import Path

import jinja2
import pytest

from uavgram.views.pages import CompiledTemplates


def _rendered(templates: dict[str, str], name: str) -> str:
    environment = jinja2.Environment(
        loader=jinja2.DictLoader(templates), autoescape=True, bytecode_cache=CompiledTemplates()
    )
    return environment.get_template(name).render(x=3)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "compiled"))
    monkeypatch.setattr(sys, "dont_write_bytecode", False)


def _kept(tmp_path: Path) -> list[Path]:
    return [path for path in (tmp_path / "compiled").rglob("*") if path.is_file()]


def test_what_was_compiled_is_used_until_the_template_changes(tmp_path: Path) -> None:
    assert _rendered({"a": "{{ x }} m"}, "a") == "3 m"
    (kept,) = _kept(tmp_path)
    before = kept.stat().st_mtime_ns
    assert _rendered({"a": "{{ x }} m"}, "a") == "3 m"
    assert kept.stat().st_mtime_ns == before
    assert _rendered({"a": "{{ x }} km"}, "a") == "3 km"
    assert kept.stat().st_mtime_ns > before


def test_broken_leavings_are_compiled_over(tmp_path: Path) -> None:
    _rendered({"a": "{{ x }} m"}, "a")
    (kept,) = _kept(tmp_path)
    kept.write_bytes(kept.read_bytes()[:-9])
    assert _rendered({"a": "{{ x }} m"}, "a") == "3 m"


def test_nothing_is_written_where_python_writes_no_bytecode_or_cannot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert _rendered({"a": "{{ x }} m"}, "a") == "3 m"
    assert not _kept(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "file"))
    (tmp_path / "file").write_text("no folder can be made below a file")
    assert _rendered({"a": "{{ x }} m"}, "a") == "3 m"
