"""Templates that stay compiled say what they would say if they were compiled anew."""

from __future__ import annotations

import base64
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import jinja2
import pytest
import synthetic_survey as survey

from uavgram.views.pages import (
    DRAWING,
    PHOTO,
    CompiledTemplates,
    split_page,
)
from uavgram.views.report import render_report


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


# The page taken apart for paper.


JPEG = b"\xff\xd8 not quite \xff\xd9"
INSIDE = f"data:image/jpeg;base64,{base64.b64encode(JPEG).decode()}"


def test_a_photo_in_a_drawing_is_a_file_that_the_drawing_names() -> None:
    html = (
        "<style>p svg.photo { width: 9px }</style><p>svg"
        f'<svg class="photo" viewBox="0 0 9 6" aria-label="R&amp;1"><image href="{INSIDE}"/></svg>'
    )
    apart = split_page(html)

    assert apart.html == (
        "<style>p img.photo { width: 9px }</style><p>svg"
        '<img class="photo" alt="R&amp;1" src="part:1">'
    )
    assert apart.parts["part:0"] == (PHOTO, JPEG)
    kind, drawing = apart.parts["part:1"]
    assert kind == DRAWING
    assert ET.fromstring(drawing)[0].attrib["href"] == "part:0"  # noqa: S314 (our own)


def test_every_drawing_of_a_report_is_a_drawing_by_itself() -> None:
    html = render_report(survey.build(label="\"<&>'"))
    apart = split_page(html)
    drawings = [part.content for part in apart.parts.values() if part.kind == DRAWING]

    assert len(drawings) == html.count("<svg")
    assert "<svg" not in apart.html
    assert all(ET.fromstring(one).tag.endswith("}svg") for one in drawings)  # noqa: S314
