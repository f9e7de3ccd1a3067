"""The recording's views and curves, read back from its file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun.blueprint as rrb
import synthetic_survey as survey
from large_result import large_result
from pyproj import Geod
from recording_contents import Contents
from scipy.spatial.transform import Rotation

from uavgram.imaging.photos.preview import Preview
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Floats
from uavgram.model.naming import round_down
from uavgram.model.result.result import AreaPlane, Estimate, Result
from uavgram.views.recording import write_recording
from uavgram.views.recording.blueprint import blueprint
from uavgram.views.recording.curves import frame_curves, pose_curves
from uavgram.views.recording.legend import (
    BAND_PX,
    HEIGHT_PX,
    LEGEND_BACKGROUND,
    WIDTH_PX,
    draw_legend,
)
from uavgram.views.recording.pages import summary
from uavgram.views.recording.photo import PHOTOS_PER_CHUNK, project_picks
from uavgram.views.recording.scene import measure_scene
from uavgram.views.survey.verdict import verdict_words

PHOTO = "/survey/current_camera/photo"


def no_ground() -> None:
    """In place of a mosaic."""


@pytest.fixture(scope="module")
def result() -> Result:
    return survey.build()


@pytest.fixture(scope="module")
def contents(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("recording") / "recording.rrd"
    write_recording(result, (), no_ground, path)
    return Contents(path)


def test_each_photo_says_its_name_and_state_above_itself(contents: Contents) -> None:
    names = contents.by_frame[f"{PHOTO}/name"]

    assert names["Points2D:labels"][5] == ["DSC_0005.jpg: not in the log"]
    assert names["Points2D:labels"][0] == ["DSC_0000.jpg: to check"]
    assert all(spot[0][1] < 0 for spot in names["Points2D:positions"].values())


def test_the_border_of_a_photo_on_the_ground_is_where_its_corners_look(
    result: Result, contents: Contents
) -> None:
    frame = 7
    (ring,) = contents.by_frame["/survey/footprint_of_this_photo"]["LineStrips3D:strips"][frame]
    poses = result.frames.refined
    pixel = survey.project(
        poses.center_world_m[frame], poses.world_from_camera[frame], np.array(ring)
    )
    size = np.array([survey.WIDTH_PX, survey.HEIGHT_PX]) - 0.5
    off = np.minimum(np.abs(pixel + 0.5), np.abs(pixel - size)).min(axis=1)

    assert off.max() < 0.05
    assert ring[0] == ring[-1]
    # a frame without a pose has no border, and not that of the frame before
    assert contents.by_frame["/survey/footprint_of_this_photo"]["LineStrips3D:strips"][5] == []


def test_a_photo_shows_the_borders_of_those_before_and_after(
    result: Result, contents: Contents
) -> None:
    frame, other = 7, 8
    strips = contents.by_frame[f"{PHOTO}/footprints_before_and_after"]["LineStrips2D:strips"][frame]
    (ring,) = contents.by_frame["/survey/footprint_of_this_photo"]["LineStrips3D:strips"][other]
    poses = result.frames.refined
    corner = survey.project(
        poses.center_world_m[frame], poses.world_from_camera[frame], np.array(ring)
    )
    inside = ((corner > 0) & (corner < [survey.WIDTH_PX - 1, survey.HEIGHT_PX - 1])).all(axis=1)
    drawn = np.concatenate([np.array(strip) - 0.5 for strip in strips])
    nearest = np.linalg.norm(corner[inside][:, None] - drawn, axis=-1).min(axis=1)

    assert inside.sum() > 3
    assert nearest.max() < 0.05
    assert not contents.by_frame[f"{PHOTO}/footprints_before_and_after"]["LineStrips2D:strips"][5]


def test_corrections_of_the_attitude_are_scipy_s(result: Result, contents: Contents) -> None:
    seed, refined = result.frames.seed, result.frames.refined
    tilt = contents.by_frame["/plots/attitude_correction/tilt"]["Scalars:scalars"]
    turn = contents.by_frame["/plots/attitude_correction/turn"]["Scalars:scalars"]
    both = np.flatnonzero(result.has_seed & result.has_refined)
    change = Rotation.from_matrix(
        np.swapaxes(seed.world_from_camera[both], 1, 2) @ refined.world_from_camera[both]
    )
    # swing and twist about the optical axis
    twist = 2 * np.degrees(np.arctan2(change.as_quat()[:, 2], change.as_quat()[:, 3]))
    axis = change.as_matrix()[:, :, 2]

    assert sorted(tilt) == sorted(turn) == both.tolist()
    expected = np.degrees(np.arctan2(np.linalg.norm(axis[:, :2], axis=1), axis[:, 2]))
    assert [tilt[i][0] for i in both.tolist()] == pytest.approx(expected, abs=1e-9)
    assert [turn[i][0] for i in both.tolist()] == pytest.approx(np.abs(twist), abs=1e-9)


def test_sigmas_are_those_of_the_least_certain_axis(contents: Contents) -> None:
    plots = contents.by_frame

    assert plots["/plots/attitude_sigma/flight_log"]["Scalars:scalars"][3][0] == pytest.approx(
        np.degrees(0.04)
    )
    assert plots["/plots/attitude_sigma/refined"]["Scalars:scalars"][3][0] == pytest.approx(
        np.degrees(0.003), rel=1e-3
    )
    assert plots["/plots/position_sigma/flight_log"]["Scalars:scalars"][3] == [pytest.approx(2.0)]


def test_rejected_frames_and_those_to_check_stand_out_in_the_survey(contents: Contents) -> None:
    rejected = contents.static["/survey/frames_rejected"]["LineStrips3D:strips"]
    to_check = contents.static["/survey/frames_to_check"]["LineStrips3D:strips"]

    assert len(rejected) == len(to_check) == 1
    assert rejected[0] in contents.static["/survey/flight_log/cameras"]["LineStrips3D:strips"]
    assert "REJECTED DSC_0011.jpg" in contents.static["/survey/labels"]["Points3D:labels"]


def test_a_good_survey_marks_no_frame(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    write_recording(survey.build(clean=True), (), no_ground, path)
    labels = Contents(path).static["/survey/labels"]["Points3D:labels"]

    assert not any(entity.startswith("/survey/frames_") for entity in Contents(path).static)
    assert not any(word in label for label in labels for word in ("REJECTED", "SUSPECT"))


def test_the_map_shows_flight_footprints_and_lines_at_their_true_distances(
    result: Result, contents: Contents
) -> None:
    (flight,) = contents.static["/map/refined"]["GeoLineStrings:line_strings"]
    known = contents.static["/map/known_lengths"]["GeoLineStrings:line_strings"]
    geod = Geod(ellps="WGS84")
    centers = result.frames.refined.center_world_m[result.has_refined]
    (a, b) = np.array(flight[:2])
    # the ellipsoid lies below the cameras: distances there are shorter by height over radius
    below = 1 - (519.2 + survey_height(centers)) / 6.37e6
    expected = np.linalg.norm(np.diff(centers[:2, :2], axis=0)) * below

    assert geod.inv(a[1], a[0], b[1], b[0])[2] == pytest.approx(expected, rel=1e-4)
    assert len(known) == 5
    assert len(contents.static["/map/footprints"]["GeoLineStrings:line_strings"]) == 19
    assert len(contents.static["/map/measured"]["GeoLineStrings:line_strings"]) == 7


def survey_height(centers: Floats) -> float:
    return float(centers[:2, 2].mean())


def test_the_scale_bar_of_the_close_up_is_as_long_as_it_says(
    result: Result, contents: Contents
) -> None:
    bar = contents.static["/close_up/scale_bar"]
    west, east = np.array(bar["LineStrips3D:strips"][0])
    largest = result.points.relative.ellipse_95_m[:, 0].max()

    assert bar["LineStrips3D:labels"] == ["5 cm"]
    assert np.linalg.norm(east - west) == pytest.approx(0.05, abs=1e-5)
    assert 0.05 <= 2 * largest < 0.1


@pytest.mark.parametrize(
    ("most", "round_one"), [(0.0999, 0.05), (0.1, 0.1), (0.7, 0.5), (3.0, 2.0), (19.0, 10.0)]
)
def test_scale_bars_have_round_lengths(most: float, round_one: float) -> None:
    assert round_down(most) == pytest.approx(round_one)


def test_the_end_of_the_last_frame_lies_one_step_after_it_in_time_too(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    result = survey.build(frame_count=4)
    write_recording(result, (), no_ground, path)
    from rerun.chunk import RrdReader

    times = [
        time
        for chunk in RrdReader(str(path)).stream().to_chunks()
        if chunk.entity_path == "/frame_status" and not chunk.is_static
        for time in chunk.to_record_batch().to_pydict()["capture_time"]
    ]
    seconds = sorted(time.timestamp() for time in times)

    assert np.diff(seconds) == pytest.approx([2.0] * 4, abs=1e-3)


def test_points_of_a_lower_area_are_not_hidden_by_the_ground() -> None:
    result = survey.build()
    position = result.points.position_world_m.copy()
    position[7, 2] = -2.5
    lower = replace(result, points=replace(result.points, position_world_m=position))

    assert measure_scene(lower).ground_drop_m > 2.5
    assert measure_scene(lower).ground_is_lowered
    assert not measure_scene(result).ground_is_lowered


def test_the_lowered_ground_is_drawn_lower_and_the_summary_says_so(tmp_path: Path) -> None:
    result = survey.build(frame_count=2)
    position = result.points.position_world_m.copy()
    position[7, 2] = -2.5
    lower = replace(result, points=replace(result.points, position_world_m=position))
    grey = np.full((64, 64, 3), 90, np.uint8)
    ground = GroundTexture(grey, np.ones((64, 64), bool), -40.0, 40.0, 1.25)
    path = tmp_path / "recording.rrd"
    write_recording(lower, (), lambda: ground, path)
    contents = Contents(path)
    corners = np.array(contents.static["/survey/ground"]["Mesh3D:vertex_positions"])

    assert corners[:, 2].max() < -2.5
    assert "2.5" in contents.static["/documents/summary"]["TextDocument:text"][0]
    assert "too low" in contents.static["/documents/summary"]["TextDocument:text"][0]


def test_the_summary_says_whose_plane_the_ground_lies_on() -> None:
    result = survey.build()
    zero = Estimate(value=np.zeros(1), sigma=np.ones(1))
    flat = Estimate(value=np.zeros(2), sigma=np.ones(2))
    areas = tuple(
        AreaPlane(name=name, height_m=zero, slope_deg=flat, pivot_m=np.zeros(2))
        for name in ("default", "verge")
    )
    several, scene = replace(result, areas=areas), measure_scene(result)

    assert "plane of the area 'default': the ground of 'verge'" in summary(
        several, verdict_words(several), scene
    )
    assert "plane of the area" not in summary(result, verdict_words(result), scene)


@pytest.mark.parametrize("variant", [{}, {"clean": True}, {"telemetry": False}], ids=str)
def test_the_legend_is_not_cut_off(variant: survey.Variant) -> None:
    result = survey.build(**variant)
    image = np.asarray(draw_legend(result, measure_scene(result), brightened=True))

    assert image.shape == (HEIGHT_PX, WIDTH_PX, 3)
    assert (image[BAND_PX + 1 :, -8:] == LEGEND_BACKGROUND).all()
    assert (image[BAND_PX + 1 :] != LEGEND_BACKGROUND).any()


def test_the_legend_says_that_the_ground_is_brightened(result: Result) -> None:
    scene = measure_scene(result)
    plain, said = (np.asarray(draw_legend(result, scene, brightened=b)) for b in (False, True))
    changed = (plain != said).any(axis=(0, 2))

    assert changed.any()
    assert not changed[: np.argmax(changed)].any()
    assert np.argmax(changed) > WIDTH_PX // 2


def test_every_view_has_a_name_and_something_to_show(result: Result, contents: Contents) -> None:
    scene, picks = measure_scene(result), project_picks(result)
    layout = blueprint(result, scene, frame_curves(result, picks), pose_curves(result))
    entities = {*contents.static, *contents.by_frame}
    names = []
    for view in views(layout.root_container):
        names.append(str(view.name))
        origin = str(view.origin)
        assert origin == "/" or any(e.startswith(f"/{origin}") for e in entities), view.name
    assert len(names) == len(set(names)) == 23
    assert "Worst point P24, true scale: 4.7 cm × 2.8 cm" in names
    assert "20 photos: 17 refined (1 to check), 1 no picks, 1 not in the log, 1 rejected" in names
    assert "Messages: 1 error, 1 warning" in names


def test_the_overview_has_eight_views_and_the_details_open_beside_it(result: Result) -> None:
    scene, picks = measure_scene(result), project_picks(result)
    layout = blueprint(result, scene, frame_curves(result, picks), pose_curves(result))
    overview, details = layout.root_container.contents
    assert isinstance(overview, rrb.Container)
    assert isinstance(details, rrb.Container)

    assert [overview.name, details.name] == ["Overview", "Details"]
    assert len(list(views(overview))) <= 8
    assert any(view.class_identifier == "TimeSeries" for view in views(details))


def views(container: rrb.Container) -> Iterator[rrb.View]:
    for item in container.contents:
        if isinstance(item, rrb.View):
            yield item
        else:
            yield from views(item)


def test_photos_pass_through_a_few_at_a_time(tmp_path: Path) -> None:
    result = survey.build(frame_count=40, clean=True)
    picture = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    jpeg = picture + np.random.default_rng(1).bytes(200_000)
    path = tmp_path / "recording.rrd"
    sizes = []

    def photos() -> Iterator[tuple[str, Preview]]:
        for name in reversed(result.frames.frame_id):
            unfinished = path.with_name(f".{path.name}.unfinished")
            sizes.append(unfinished.stat().st_size)
            yield name, Preview(jpeg, 8, 8, (205.0, 154.0))

    write_recording(result, photos(), no_ground, path)
    blobs = Contents(path).by_frame[f"{PHOTO}/picture"]["EncodedImage:blob"]

    assert sorted(blobs) == list(range(40))
    # what was handed over is in the file already, but for the last few
    assert all(size >= 200_000 * (k - PHOTOS_PER_CHUNK) for k, size in enumerate(sizes))


def test_more_points_than_ellipses_can_be_drawn_are_coloured_themselves(
    contents: Contents, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("uavgram.views.recording.points.MAX_OUTLINES", 29)
    path = tmp_path / "recording.rrd"
    write_recording(survey.build(), (), no_ground, path)
    many = Contents(path).static

    assert "/survey/points/ellipse_95_exaggerated" not in many
    assert "/survey/points/ellipse_95_exaggerated" in contents.static
    assert len(set(many["/survey/points/picked"]["Points3D:colors"])) > 10
    assert len(set(contents.static["/survey/points/picked"]["Points3D:colors"])) == 1
    assert "too many to be drawn" in many["/documents/summary"]["TextDocument:text"][0]


def test_long_flights_with_many_points_can_be_written_and_read(tmp_path: Path) -> None:
    result = large_result(600, 7000)
    path = tmp_path / "recording.rrd"
    write_recording(result, (), no_ground, path)
    contents = Contents(path)
    picks = contents.by_frame[f"{PHOTO}/picked"]["Points2D:positions"]

    assert len(contents.static["/survey/refined/cameras"]["LineStrips3D:strips"]) == 600
    assert sum(map(len, picks.values())) == len(result.picks.label)
    ellipses = contents.static["/survey/points/ellipse_95_true_size/0"]
    assert len(ellipses["Ellipsoids3D:centers"]) == 7000
    assert path.stat().st_size < 10e6
