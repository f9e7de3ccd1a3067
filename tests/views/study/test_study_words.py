"""What studies say: every sentence follows from the numbers."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from PIL import Image

from uavgram.model.study.methods import MethodRow
from uavgram.model.study.study import Cell, Study
from uavgram.views.study.figures import figure_files
from uavgram.views.study.overall import overall, ranking
from uavgram.views.study.page import render_study_page
from uavgram.views.study.words import agreement, said


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
        told=0.0,
        repetitions=100,
        lost=0,
        is_model=True,
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
    told = said(study(cell(1.0, 0.2), cell(100.0, 0.8)))
    assert "holds in 1 of the 2 conditions" in told[0]
    assert "from about 10 mm on; below that, the picks do" in told[1]


def test_the_scale_of_the_tape_is_an_error_of_the_lengths() -> None:
    shared = (0.3, 0.4, 0.0, 0.0, 0.3, 0.0)
    told = said(study(cell(1.0, 0.0, shares=shared), cell(2.0, 0.0, shares=shared)))
    assert "holds in 2 of the 2" in told[0]
    assert "at every precision" in told[1]


def test_agreement_counts_the_cells() -> None:
    good, chance = cell(1.0, 0.5), cell(2.0, 0.5, ratio=1.06, ratio_range=(1.02, 1.1))
    wrong = cell(3.0, 0.5, ratio=1.2, ratio_range=(1.1, 1.3), lost=7)
    aside = cell(4.0, 0.5, ratio=3.0, ratio_range=(2.9, 3.1), is_model=False)
    text = agreement((study(good, chance, wrong, aside),))
    assert "1.01 to 1.20 times" in text
    assert "1 of 3 cells lie" in text
    assert "of the others 1 differ" in text
    assert "7 of 300 repetitions gave no result: usual, 3 mm (7 of 100)." in text
    assert "another solution" not in text
    assert agreement((study(good),)).endswith("0 of 100 repetitions gave no result.")
    assert not agreement((study(aside),))


def test_repetitions_at_another_solution_are_told() -> None:
    found = study(cell(1.0, 0.5), cell(2.0, 0.5, elsewhere=3, lost=1))
    assert "3 ended at another solution" in agreement((found,))
    assert "usual, 2 mm (3 of 100)" in agreement((found,))
    assert ">96 of 100<" in render_study_page((found,), figure_files((found,)))


def test_a_prediction_that_fails_is_told_with_its_range() -> None:
    bad = cell(50.0, 0.5, ratio=1.4, ratio_range=(1.35, 1.45), is_model=False)
    fine = cell(10.0, 0.5, is_model=False)
    told = " ".join(said(study(fine, bad, name="ground")))
    assert "the errors are 1.40 times (1.35 to 1.45) at 50 mm" in told
    assert "at 10 mm" in told


def test_what_chance_explains_is_no_extreme() -> None:
    """37 mm, drawn, below 40 mm predicted and drawn: only where its range says so."""
    ends = cell(1.0, 0.5), cell(9.0, 0.5, simulated_m=0.06, is_model=False)
    for spread, is_told in ((0.10, False), (0.02, True)):
        drawn = {"simulated_m": 0.037, "ratio": 0.925, "is_model": False}
        low = cell(5.0, 0.5, ratio_range=(0.925 - spread, 0.925 + spread), **drawn)
        told = said(study(ends[0], low, ends[1], name="ground"))[0]
        assert ("smallest at 5 mm (37 mm)" in told) == is_told
    same = cell(5.0, 0.5, predicted_m=0.0399)
    assert "smallest" not in said(study(ends[0], same, cell(9.0, 0.5), name="picks"))[0]


def test_a_misreading_that_is_overlooked_again_when_larger_is_not_seen_from_there_on() -> None:
    sizes = [cell(at, 0.5, is_model=False, told=t) for at, t in ((1, 0.9), (2, 0.7), (3, 0.9))]
    assert "of the surveys from 3 mm on" in " ".join(said(study(*sizes, name="blunder")))


@pytest.mark.parametrize(("told", "words"), [(0.9, "from 500 mm on"), (0.5, "never seen")])
def test_a_misreading_is_seen_from_where_the_misfit_shows(told: float, words: str) -> None:
    small = cell(100.0, 0.5, is_model=False, told=0.1)
    large = cell(500.0, 0.5, is_model=False, told=told)
    assert words in " ".join(said(study(small, large, name="blunder")))


def test_over_all_studies() -> None:
    one = study(cell(1.0, 0.2), cell(2.0, 0.3), cell(3.0, 0.7))
    two = study(cell(1.0, 0.2), cell(9.0, 0.2, predicted_m=0.4), name="picks")
    told = " ".join(overall((one, two)))
    assert "The picks matter most in 4 of them." in told
    assert "The reference lengths matter most in 1 of them: lengths, usual (at 3 mm)" in told
    assert "The camera file matters most in none of them." in told
    assert ranking((one, two))[0] == ("Title", "40 mm at 1 mm", "400 mm at 9 mm", "10.0")


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
    assert said(compared)[-1] == (
        'Three lines (10 photos): useless distances by "points" (30 %, 10 % without a word); '
        'of the errors lie within what should hold 95 %: "points" 50 %.'
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
    for text in said(studies[0]):
        assert text.replace('"', "&#34;") in page
    assert figure_files(studies) == files
