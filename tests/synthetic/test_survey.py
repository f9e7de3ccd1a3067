"""What a scenario can have amiss happens, as much as it says, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from uavgram.synthetic.errors import FixedErrors, RaisedPoint, WrongLength
from uavgram.synthetic.scenario import FlightPlan, GroundSpec, Pattern, Scenario, Station
from uavgram.synthetic.survey import SimulatedSurvey, simulate
from uavgram.synthetic.truth import draw_surface

CLEAN = simulate(Scenario())


def with_habits(**habits: object) -> SimulatedSurvey:
    return simulate(replace(Scenario(), habits=replace(FixedErrors(), **habits)))  # type: ignore[arg-type]


def on_ground(spec: GroundSpec) -> SimulatedSurvey:
    return simulate(replace(Scenario(), ground=spec))


def above_plane(survey: SimulatedSurvey) -> dict[str, float]:
    """Heights of points above the clean survey's, by label."""
    off = survey.truth.point_world_m[:, 2] - CLEAN.truth.point_world_m[:, 2]
    return dict(zip(survey.truth.label, off.tolist(), strict=True))


def test_tapes_and_blunders_change_the_readings_alone() -> None:
    long = with_habits(tape_long=0.01, wrong_lengths=(WrongLength(name="L2", by_m=0.5),))
    off = long.lines.length_m - CLEAN.lines.length_m - 0.01 * CLEAN.truth.line_length_m
    assert off == pytest.approx([0.5 * (name == "L2") for name in CLEAN.lines.name], abs=1e-12)
    assert (long.picks.pixel_px == CLEAN.picks.pixel_px).all()
    assert (long.log.position_geodetic == CLEAN.log.position_geodetic).all()


def test_labels_are_swapped_in_one_photo_only() -> None:
    swapped = with_habits(swapped=(("P1", "P3"),))
    pairs = zip(CLEAN.picks.image, CLEAN.picks.label, swapped.picks.label, strict=True)
    changed = [(image, before, after) for image, before, after in pairs if before != after]
    assert len({image for image, *_ in changed}) == 1
    assert sorted(two for _, *two in changed) == [["P1", "P3"], ["P3", "P1"]]


def test_raised_points_and_shapes_of_the_ground() -> None:
    raised = above_plane(with_habits(raised=(RaisedPoint(label="P2", height_m=0.4),)))
    assert raised["P2"] == pytest.approx(0.4)
    assert sum(map(abs, raised.values())) == pytest.approx(0.4)
    crown = above_plane(on_ground(GroundSpec(shape="crown")))
    kerb = above_plane(on_ground(GroundSpec(kerb_m=0.12, kerb_y_m=3.5)))
    for point in Scenario().points:
        assert crown[point.label] == pytest.approx(-0.02 * abs(point.y_m))
        assert kerb[point.label] == pytest.approx(0.12 * (point.y_m > 3.5))


def test_relief_has_its_size_and_its_length() -> None:
    """Of many grounds: heights here, and how they go with those one and three lengths away."""
    scenario = replace(Scenario(), ground=GroundSpec(shape="relief", relief_length_m=4.0))
    places = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 12.0]])
    plane = draw_surface(Scenario(), np.random.default_rng(0)).up(places)
    count = 2000
    off = np.array(
        [draw_surface(scenario, np.random.default_rng(k)).up(places) for k in range(count)]
    )
    off -= plane
    assert off.std(axis=0) == pytest.approx(np.full(3, 0.05), rel=4 / np.sqrt(2 * count))
    together = np.corrcoef(off.T)[0, 1:]
    # A Gaussian of the length: exp(-d^2 / 2 l^2).
    assert together == pytest.approx(np.exp([-0.5, -4.5]), abs=4 / np.sqrt(count))


def test_a_jump_of_the_receiver_is_logged_amid_the_photos() -> None:
    jumped = with_habits(gps_jump_m=3.0)
    north = (jumped.log.position_geodetic - CLEAN.log.position_geodetic)[:, 0] * 111_200.0
    assert np.unique(np.round(north)).tolist() == [0.0, 3.0]
    assert (jumped.truth.center_world_m == CLEAN.truth.center_world_m).all()


def test_rows_are_exposed_one_after_the_other() -> None:
    """A moving camera displaces what lies at the edges, by its way during the readout."""
    errors = replace(Scenario().errors, readout_ms=60.0)
    rolled = simulate(replace(Scenario(), errors=errors))
    row = CLEAN.picks.pixel_px[:, 1]
    pairs = zip(CLEAN.picks.image, CLEAN.picks.label, strict=True)
    before = {pair: i for i, pair in enumerate(pairs)}
    pairs = zip(rolled.picks.image, rolled.picks.label, strict=True)
    kept = [(before[pair], j) for j, pair in enumerate(pairs) if pair in before]
    clean, now = np.array(kept).T
    moved = rolled.picks.pixel_px[now, 1] - CLEAN.picks.pixel_px[clean, 1]
    # 4.5 m/s for 60 ms is 0.27 m, over the photo's height 18 px at 32 m: half of it at each edge,
    # in proportion to the row, as the flight goes along the image. Noise is redrawn where other
    # points come into view.
    share = (row[clean] - 749.5) / 1500
    slope = float(np.polyfit(share, moved, 1)[0])
    assert abs(slope) == pytest.approx(18.0, rel=0.25)


@pytest.mark.parametrize(
    ("pattern", "count"),
    [("strip", 7), ("grid", 42), ("orbit", 8), ("single", 1)],
)
def test_patterns_look_at_the_scene(pattern: Pattern, count: int) -> None:
    survey = simulate(replace(Scenario(), flight=FlightPlan(pattern=pattern)), exact=True)
    truth = survey.truth
    assert len(truth.frame_id) == count
    # Where each optical axis meets the ground: on average the middle of the scene.
    axis = truth.world_from_camera[:, :, 2]
    fall = (truth.surface.height_m - truth.center_world_m[:, 2]) / axis[:, 2]
    hit = truth.center_world_m[:, :2] + fall[:, None] * axis[:, :2]
    assert np.abs(hit.mean(axis=0) - truth.surface.middle_m).max() < 1.5


def test_stated_poses_are_flown() -> None:
    places = (
        Station(x_m=0.0, y_m=0.0, height_m=40.0),
        Station(x_m=5.0, y_m=-3.0, height_m=30.0, heading_deg=170.0, pitch_deg=-60.0),
    )
    plan = FlightPlan(
        pattern="poses", poses=places, wobble_m=0.0, tilt_wobble_deg=0.0, gimbal_wobble_deg=0.0
    )
    truth = simulate(replace(Scenario(), flight=plan), exact=True).truth
    assert truth.center_world_m[:, 2] == pytest.approx([40.0, 30.0], abs=0.15)
    azimuth = np.deg2rad(62.0 - np.array([0.0, 170.0]))
    tilt = np.arccos(-truth.world_from_camera[:, 2, 2])
    assert np.rad2deg(tilt) == pytest.approx([0.0, 30.0], abs=0.05)
    up = -truth.world_from_camera[:, :2, 1]
    told = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", up, told) > 0.9999).all()


def test_without_errors_pixels_are_opencvs() -> None:
    survey = simulate(Scenario(), exact=True)
    truth = survey.truth
    fx, fy, cx, cy, *lens = truth.intrinsics.tolist()
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    for i in range(0, len(survey.picks.image), 25):
        frame = truth.frame_id.index(survey.picks.image[i])
        point = truth.point_world_m[truth.label.index(survey.picks.label[i])]
        back = truth.world_from_camera[frame].T
        pixel, _ = cv2.projectPoints(
            point[None],
            cv2.Rodrigues(back)[0],
            -back @ truth.center_world_m[frame],
            matrix,
            np.array(lens),
        )
        assert survey.picks.pixel_px[i] == pytest.approx(pixel.ravel(), abs=1e-6)
