"""What studies say: every sentence follows from the numbers."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from xml.etree import ElementTree as ET

from PIL import Image

from uavgram.model.simulation import Cell, MethodRow, Study
from uavgram.views.study import (
    compare_studies,
    describe_agreement,
    describe_study,
    figure_files,
    rank_effects,
    render_study_page,
)


def cell(at: float, lengths: float, **more: object) -> Cell:
    usual = Cell(
        curve="usual",
        at=at,
        label=f"{at:g} mm",
        predicted_m=0.04,
        simulated_m=0.041,
        ratio=1.01,
        ratio_range=(0.99, 1.03),
        bias_m=0.001,
        shares=(lengths, 1.0 - lengths, 0.0, 0.0, 0.0, 0.0),
        repetitions=100,
        lost=0,
    )
    return replace(usual, **more)  # type: ignore[arg-type]


def study(*cells: Cell, name: str = "lengths") -> Study:
    return Study(
        name=name,
        title="Title",
        question="Question?",
        axis="axis",
        is_log=True,
        cells=cells,
        seconds=1.0,
    )


def test_the_thesis_holds_from_where_the_lengths_have_half() -> None:
    # Lead of the lengths: -0.6 at 1 mm, +0.6 at 100 mm; half-way on a logarithmic axis is 10 mm.
    told = describe_study(study(cell(1.0, 0.2), cell(100.0, 0.8)))
    assert "holds in 1 of the 2 conditions" in told[0]
    assert "from about 10 mm on; below that, the picks do" in told[1]


def test_the_scale_of_the_tape_is_an_error_of_the_lengths() -> None:
    shared = (0.3, 0.4, 0.0, 0.0, 0.3, 0.0)
    told = describe_study(study(cell(1.0, 0.0, shares=shared), cell(2.0, 0.0, shares=shared)))
    assert "holds in 2 of the 2" in told[0]
    assert "at every precision" in told[1]


def test_agreement_counts_the_cells() -> None:
    good, chance = cell(1.0, 0.5), cell(2.0, 0.5, ratio=1.06, ratio_range=(1.02, 1.1))
    wrong = cell(3.0, 0.5, ratio=1.2, ratio_range=(1.1, 1.3), lost=7)
    text = describe_agreement((study(good, chance, wrong),))
    assert "1.01 to 1.20 times" in text
    assert "1 of 3 cells are" in text
    assert "of the others 1 differ" in text
    assert "7 of 300 repetitions gave no result: usual, 3 mm (7 of 100)." in text
    assert describe_agreement((study(good),)).endswith("0 of 100 repetitions gave no result.")


def test_what_differs_by_less_than_is_shown_is_no_extreme() -> None:
    for size_m, is_told in ((0.0399, False), (0.037, True)):
        low = cell(5.0, 0.5, predicted_m=size_m)
        told = describe_study(study(cell(1.0, 0.5), low, cell(9.0, 0.5), name="picks"))[0]
        assert ("smallest at 5 mm (37 mm)" in told) == is_told


def test_over_all_studies() -> None:
    one = study(cell(1.0, 0.2), cell(2.0, 0.3), cell(3.0, 0.7))
    two = study(cell(1.0, 0.2), cell(9.0, 0.2, predicted_m=0.4), name="picks")
    told = " ".join(compare_studies((one, two)))
    assert "The picks matter most in 4 of them." in told
    assert "The reference lengths matter most in 1 of them: lengths, usual (at 3 mm)" in told
    assert "The camera file matters most in none of them." in told
    assert rank_effects((one, two))[0] == ("Title", "40 mm at 1 mm", "400 mm at 9 mm", "10.0")


def test_page_and_figures() -> None:
    row = MethodRow(
        setting="usual",
        method="points",
        scenes=10,
        rms_m=0.04,
        ninth_m=0.06,
        fewest_m=0.05,
        most_m=0.03,
        failed=0.1,
        ambiguous=0.0,
        told=0.0,
        failed_silently=0.1,
        coverage=0.8,
        z=1.5,
    )
    few = replace(row, setting="three lines", failed=0.3, coverage=0.5)
    fine = replace(row, setting="three lines", method="all", failed=0.0, coverage=0.95)
    methods = (row, replace(row, method="log", rms_m=0.7), few, fine)
    compared = replace(study(name="methods"), methods=methods)
    assert describe_study(compared)[-1] == (
        'Three lines (10 photos): useless distances by "points" (30 %, 10 % without a warning); '
        'of the errors are within the 95 % intervals: "points" 50 %.'
    )
    studies = (study(cell(1.0, 0.2), cell(100.0, 0.8)), compared)
    files = figure_files(studies)
    assert sorted(files) == ["lengths.png", "lengths.svg", "methods.png", "methods.svg"]
    for name, content in files.items():
        if name.endswith(".svg"):
            assert ET.fromstring(content).tag.endswith("svg")  # noqa: S314
        else:
            assert Image.open(io.BytesIO(content)).size[0] > 800
    page = render_study_page(studies, files)
    pictures = re.findall(r"svg\+xml;base64,([^\"]+)", page)
    assert base64.b64decode(pictures[0]) == files["lengths.svg"]
    for text in describe_study(studies[0]):
        assert text.replace('"', "&#34;") in page
    assert figure_files(studies) == files
