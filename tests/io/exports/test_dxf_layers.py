"""Profile sheets in the drawing, through ezdxf's reader."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ezdxf.bbox import extents
from ezdxf.document import Drawing
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.filemanagement import readfile
from ezdxf.layouts.base import BaseLayout
from hypothesis import given
from hypothesis import strategies as st
from raised_survey import PROFILE, raised

from uavgram.io.exports.dxf import write_dxf
from uavgram.io.exports.dxf_layers import count_decimals, spread_places
from uavgram.model.arrays import Floats
from uavgram.model.maps import ProfileSheet
from uavgram.model.result.result import Result
from uavgram.model.result.tables import ProfileResults
from uavgram.stages.products.map_layers import features_of, profile_sheets
from uavgram.views.style import LOOKS

TWO_SIGMA = 1.959964


def drawn(result: Result, profiles: ProfileResults, folder: Path) -> Drawing:
    features = features_of(replace(result, profiles=profiles), None)
    write_dxf(features, folder / "s.dxf", LOOKS)
    document = readfile(folder / "s.dxf")
    assert document.audit().errors == []
    assert document.audit().fixes == []
    return document


@pytest.fixture(scope="module")
def profiles(result: Result) -> ProfileResults:
    return raised(result).profiles


@pytest.fixture(scope="module")
def document(
    result: Result, profiles: ProfileResults, tmp_path_factory: pytest.TempPathFactory
) -> Drawing:
    return drawn(result, profiles, tmp_path_factory.mktemp("dxf"))


@pytest.fixture(scope="module")
def sheet(profiles: ProfileResults) -> ProfileSheet:
    (one,) = profile_sheets(profiles)
    return one


def lines(block: BaseLayout, layer: str) -> list[Floats]:
    found = block.query(f'LWPOLYLINE[layer=="{layer}"]')
    return [np.array(list(line.vertices())) for line in found if isinstance(line, LWPolyline)]


def texts(block: BaseLayout) -> list[str]:
    return [text.dxf.text for text in block.query("TEXT")]


def test_its_lines_are_stations_and_heights_at_the_stated_scale(
    document: Drawing, profiles: ProfileResults, sheet: ProfileSheet
) -> None:
    """Read off as with a ruler: a place on paper less that of the axes, over the exaggeration."""
    block = document.blocks.get("PROFILE_1")
    station, _, height, ground = profiles.place_m.T
    for layer, up in (("PROFILE_POINTS", height), ("PROFILE_GROUND", ground)):
        (line,) = lines(block, layer)
        read_off = line / [1.0, sheet.exaggeration]
        read_off += [sheet.station_ticks_m[0], sheet.height_ticks_m[0]]
        np.testing.assert_allclose(read_off, np.column_stack([station, up]), atol=1e-9)
    assert f"heights drawn {sheet.exaggeration} times as large as lengths" in " ".join(texts(block))


def test_its_bars_are_the_intervals(
    document: Drawing, profiles: ProfileResults, sheet: ProfileSheet
) -> None:
    bars = lines(document.blocks.get("PROFILE_1"), "PROFILE_95")
    half = np.array([np.ptp(bar[:, 1]) for bar in bars]) / 2 / sheet.exaggeration

    wanted = TWO_SIGMA * np.concatenate([profiles.sigma_m[1:, 3], profiles.sigma_m[1:, 2]])
    np.testing.assert_allclose(half, wanted, rtol=1e-6)


def test_its_table_has_every_number(document: Drawing, profiles: ProfileResults) -> None:
    said = texts(document.blocks.get("PROFILE_1"))

    for k, label in enumerate(PROFILE):
        assert said.count(label) == 2
        station, _, height, ground = profiles.place_m[k]
        _, _, height_sigma, ground_sigma = profiles.sigma_m[k]
        for number in (station, height, height_sigma, ground, ground_sigma):
            assert f"{number:.3f}" in said
    assert "PROFILE over <the> car" in said


def test_it_stands_below_the_plan_in_metres_and_on_a_sheet_to_a_round_scale(
    document: Drawing, sheet: ProfileSheet
) -> None:
    (below,) = document.modelspace().query('INSERT[name=="PROFILE_1"]')
    assert (below.dxf.xscale, below.dxf.yscale) == (1.0, 1.0)
    lowest = min(insert.dxf.insert.y for insert in inserts(document, "SURVEY_POINT"))
    assert extents([below]).extmax.y < lowest

    layout = document.paperspace("Profile 1")
    (on_paper,) = layout.query("INSERT")
    scale = 1000.0 / on_paper.dxf.xscale
    note = next(text for text in texts(layout) if text.startswith("lengths"))
    assert note == f"lengths 1:{scale:g}, heights 1:{scale / sheet.exaggeration:g} on A3"
    assert on_paper.dxf.yscale == on_paper.dxf.xscale
    box = extents([on_paper])
    assert (box.extmin.x, box.extmin.y) > (0.0, 0.0)
    assert box.extmax.x <= 420.0
    assert box.extmax.y <= 297.0
    assert max(box.size.x / 420.0, box.size.y / 297.0) > 0.3


def inserts(document: Drawing, name: str) -> Iterable[Any]:
    return document.modelspace().query(f'INSERT[name=="{name}"]')


def test_without_profiles_there_is_no_layer_of_them(result: Result, tmp_path: Path) -> None:
    write_dxf(features_of(result, None), tmp_path / "s.dxf", LOOKS)
    document = readfile(tmp_path / "s.dxf")

    assert not [name for name in document.layout_names() if name.startswith("Profile")]
    assert "PROFILE_AXES" not in document.layers


@pytest.mark.parametrize("length", [0.02, 3.0, 4000.0])
def test_profiles_of_any_size_fit_on_their_sheets(
    result: Result, profiles: ProfileResults, length: float, tmp_path: Path
) -> None:
    factor = length / profiles.place_m[-1, 0]
    several = ProfileResults(
        profile=("a",) * 4 + ("b",) * 4,
        label=profiles.label * 2,
        place_m=np.tile(profiles.place_m * factor, (2, 1)),
        sigma_m=np.tile(profiles.sigma_m * factor, (2, 1)),
    )
    document = drawn(result, several, tmp_path)

    for name in ("Profile 1", "Profile 2"):
        box = extents(document.paperspace(name).query("INSERT"))
        assert min(box.extmin.x, box.extmin.y) >= 0.0
        assert box.extmax.x <= 420.0
        assert box.extmax.y <= 297.0
    boxes = [extents(inserts(document, f"PROFILE_{k}")) for k in (1, 2)]
    assert boxes[1].extmax.y < boxes[0].extmin.y


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=30), st.floats(0.01, 10))
def test_numbers_keep_clear_of_each_other_and_in_order(places: list[float], least: float) -> None:
    x = np.array(places)
    moved = spread_places(x, least)

    assert (moved >= x).all()
    in_order = moved[np.argsort(x, kind="stable")]
    assert all(b - a >= least * (1 - 1e-9) - 1e-12 for a, b in pairwise(in_order))
    apart = np.diff(np.sort(x))
    if (apart >= least).all():
        np.testing.assert_array_equal(moved, x)


@pytest.mark.parametrize(("step", "places"), [(0.05, 2), (0.1, 1), (0.2, 1), (1.0, 0), (50.0, 0)])
def test_ticks_have_the_decimals_that_they_need(step: float, places: int) -> None:
    assert count_decimals(np.array([0.0, step, 2 * step])) == places
