"""Methods of finding the pose of one photo, compared: right ones are honest, limits show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.model.simulation import MethodRow
from uavgram.synthetic.study.method_scenes import Setting, draw_scenes
from uavgram.synthetic.study.methods import METHODS, compare_methods

SCENES = 40


@pytest.fixture(scope="module")
def usual() -> dict[str, MethodRow]:
    return {
        row.method: row
        for row in compare_methods(Setting(name="usual", features=(6, 7)), SCENES, 2)
    }


def test_every_method_has_its_row(usual: dict[str, MethodRow]) -> None:
    assert tuple(usual) == tuple(METHODS)
    assert {row.scenes for row in usual.values()} == {SCENES}


@pytest.mark.parametrize("method", ["lines of known position", "lengths and log", "log", "all"])
def test_sigmas_are_honest(usual: dict[str, MethodRow], method: str) -> None:
    """Twelve distances of a scene hang together: as if each scene were three numbers."""
    row = usual[method]
    spread = 1.0 / np.sqrt(2 * 3 * SCENES)

    assert abs(row.z - 1.0) < 4 * spread
    assert row.coverage > 0.95 - 4 * np.sqrt(0.95 * 0.05 / (3 * SCENES))


def test_what_knows_more_is_better(usual: dict[str, MethodRow]) -> None:
    error = {name: row.rms_m for name, row in usual.items()}

    assert error["all"] < min(error["points"], error["lengths and log"]) < error["log"]
    assert error["points"] <= error["points, IPPE alone"]
    # A log alone is no use here, and its sigmas say so.
    assert usual["log"].failed > 0.2
    assert usual["log"].failed_silently == 0.0


def test_distortion_left_out_breaks_the_sigmas_of_all_but_the_log() -> None:
    setting = Setting(name="distorted", features=(7, 7), bulge=-0.1)
    rows = {row.method: row for row in compare_methods(setting, 20, 3)}

    assert all(rows[name].z > 1.5 for name in ("points", "lines of known position", "lengths"))


def test_scenes_are_drawn_again_from_their_seed_alone() -> None:
    first, again, other = (draw_scenes(Setting(name="a"), 5, 3, seed) for seed in (1, 1, 2))

    np.testing.assert_array_equal(first.pixel_px, again.pixel_px)
    assert np.abs(first.place_m - other.place_m).max() > 0.1
    # Withheld distances are true ones of places that the photo shows.
    assert (first.check_m >= 3.0).all()
    assert ((first.pixel_px > -5) & (first.pixel_px < 4005)).all()


def test_a_setting_without_room_is_refused() -> None:
    long = replace(Setting(name="too long"), length_m=(60.0, 70.0))
    with pytest.raises(ValueError, match="a photo shows 0 of the 4 lines"):
        draw_scenes(long, 4, 1, 0)


def test_who_gives_no_pose_says_so() -> None:
    """IPPE takes four points: of three lines there is none, and no silent failure."""
    rows = {
        row.method: row for row in compare_methods(Setting(name="three", features=(3, 3)), 4, 1)
    }

    for name in ("points", "points, IPPE alone"):
        assert rows[name].failed == 1.0
        assert rows[name].failed_silently == 0.0
