"""Templates that stay compiled say what they would say if they were compiled anew."""

from __future__ import annotations

import base64
import re
import sys
import xml.etree.ElementTree as ET
from html import unescape
from pathlib import Path

import jinja2
import pytest
import synthetic_survey as survey

from uavgram.views.pages import (
    DRAWING,
    MIN_PT,
    PHOTO,
    CompiledTemplates,
    convert_tables_to_text,
    split_page,
)
from uavgram.views.pages import ROWS_OF_A_BLOCK as MAX_ROWS
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


# Tables of short texts as lines, for paper.


HEAD = '<tr><th>photo</th><th class="n">largest residual [px]</th></tr>'


def table(rows: str, head: str = HEAD) -> str:
    return f'<p>a</p><table class="dense plain"><thead>{head}</thead><tbody>{rows}</tbody></table>'


def lines(html: str) -> list[str]:
    return [
        unescape(line)
        for one in re.findall(r"<pre.*?>(.*?)</pre>", html, re.DOTALL)
        for line in one.split("\n")
    ]


def test_columns_stand_below_their_heads_to_the_left_or_the_right() -> None:
    rows = (
        '<tr><td>a &amp; b</td><td class="n">1.25</td></tr><tr><td>c</td><td class="n">–</td></tr>'
    )
    told = lines(convert_tables_to_text(table(rows)))

    assert told == [
        "         largest",
        "        residual",
        "photo       [px]",
        "a & b       1.25",
        "c              –",
    ]


def test_what_catches_the_eye_in_a_cell_does_so_in_a_line() -> None:
    rows = (
        '<tr><td class="tag look">not &lt;</td><td class="n">1.25</td></tr>'
        '<tr><td class="tag good">ok</td><td class="n">2</td></tr>'
    )

    assert '><span class="tag look">not &lt;</span>  1.25\nok        2<' in convert_tables_to_text(
        table(rows, "")
    )


def test_tags_in_a_cell_stay_tags_in_a_line() -> None:
    rows = '<tr><td>D1 &lt; <span class="tag bad">first order</span></td><td class="n">1</td></tr>'

    told = convert_tables_to_text(table(rows, ""))
    assert '>D1 &lt; <span class="tag bad">first order</span>  1<' in told


@pytest.mark.parametrize(
    "rows",
    [
        '<tr><td>a<span class="sub">b</span></td><td>1</td></tr>',
        '<tr class="bad"><td>a</td><td>1</td></tr>',
        "<tr><td>飛行</td><td>1</td></tr>",
        "<tr><td>a</td></tr>",
        f"<tr><td>{'a' * 400}</td><td>1</td></tr>",
    ],
    ids=["markup", "marked row", "wide letters", "another number of cells", "too wide"],
)
def test_what_lines_cannot_show_stays_a_table(rows: str) -> None:
    assert convert_tables_to_text(table(rows)) == table(rows)


def test_the_head_is_repeated_on_each_page_and_no_row_is_lost() -> None:
    rows = "".join(f'<tr><td>IMG_{k}</td><td class="n">{k}.5</td></tr>' for k in range(95))
    made = convert_tables_to_text(table(rows))

    assert made.count("<tr><td>") == -(-95 // MAX_ROWS)
    assert re.search(r'<thead><tr><th><pre class="head".*?</thead><tbody>', made, re.DOTALL)
    told = [line.split() for line in lines(made) if line.startswith("IMG")]
    assert told == [[f"IMG_{k}", f"{k}.5"] for k in range(95)]


def test_letters_are_as_large_as_the_paper_lets_them_be() -> None:
    for letters in (20, 100, 140):
        row = f"<tr><td>{'a' * letters}</td><td>1</td></tr>"
        size = re.search(r"font-size: ([\d.]+)pt", convert_tables_to_text(table(row, "")))
        assert size is not None
        assert float(size[1]) >= MIN_PT
        assert float(size[1]) * 0.602 * (letters + 3) <= 182 / 25.4 * 72
