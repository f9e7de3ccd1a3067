"""Tables of short texts as lines, for paper."""

from __future__ import annotations

import re
from html import unescape

import pytest

from uavgram.views.pages_pdf import MAX_ROWS, MIN_PT, convert_tables_to_text

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
