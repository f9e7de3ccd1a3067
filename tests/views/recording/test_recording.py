"""The recording, read back from its file."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Never

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
import synthetic_survey as survey
from recording_contents import Contents
from rerun.chunk import RrdReader
from scipy.stats import norm
from standings import with_status

from uavgram.errors import OutputError
from uavgram.imaging.photos.preview import Preview, decode_preview
from uavgram.imaging.top_view.mosaic import Mosaic
from uavgram.model.result.result import Result
from uavgram.views.recording import write_recording
from uavgram.views.recording.blueprint import blueprint
from uavgram.views.recording.curves import frame_curves, pose_curves
from uavgram.views.recording.photo import (
    HALF_LETTER,
    ON_SMALL_SCREENS,
    place_on_photo,
    project_picks,
)
from uavgram.views.recording.scene import measure_scene
from uavgram.views.survey.reliability import pick_limit

PHOTO = "/survey/current_camera/photo"
SCALE = 8


def previews(result: Result, frames: list[int] | None = None) -> dict[str, Preview]:
    shown = range(len(result.frames.frame_id)) if frames is None else frames
    made = {}
    for i in shown:
        center = result.frames.refined.center_world_m[i]
        if np.isfinite(center[0]):
            rgb = survey.render(center, result.frames.refined.world_from_camera[i], SCALE)
        else:
            rgb = np.zeros((survey.HEIGHT_PX // SCALE, survey.WIDTH_PX // SCALE, 3), np.uint8)
        made[result.frames.frame_id[i]] = Preview(
            survey.jpeg(rgb), rgb.shape[1], rgb.shape[0], (float(SCALE), float(SCALE))
        )
    return made


def no_ground() -> None:
    """In place of a mosaic."""


@pytest.fixture(scope="module")
def result() -> Result:
    return survey.build()


@pytest.fixture(scope="module")
def contents(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("recording") / "recording.rrd"
    photos = previews(result)
    mosaic = Mosaic(result, photos, SCALE, 256)

    def passing() -> Iterator[tuple[str, Preview]]:
        for name, photo in photos.items():
            mosaic.add(name, decode_preview(photo)[..., ::-1])
            yield name, photo

    write_recording(result, passing(), mosaic.texture, path)
    return Contents(path)


def test_tracks_are_the_centres_in_the_order_of_flight(result: Result, contents: Contents) -> None:
    for name, poses in (("flight_log", result.frames.seed), ("refined", result.frames.refined)):
        known = poses.center_world_m[np.isfinite(poses.center_world_m[:, 0])]
        (track,) = contents.static[f"/survey/{name}/track"]["LineStrips3D:strips"]
        np.testing.assert_allclose(track, known, atol=1e-4)


def test_every_posed_frame_has_a_frustum_in_one_static_batch(contents: Contents) -> None:
    assert len(contents.static["/survey/flight_log/cameras"]["LineStrips3D:strips"]) == 19
    assert len(contents.static["/survey/refined/cameras"]["LineStrips3D:strips"]) == 17


def test_lines_of_each_status_are_apart_and_in_their_own_colour(contents: Contents) -> None:
    colours = {
        status: contents.static[f"/survey/known_lengths/{status}"]["LineStrips3D:colors"][0]
        for status in ("used", "suspect", "checked")
    }

    assert len(set(colours.values())) == 3
    assert colours["suspect"] == 0xFF3B30FF
    assert len(contents.static["/survey/known_lengths/used"]["LineStrips3D:strips"]) == 3
    assert "/survey/known_lengths/unseen" not in contents.static


def test_ellipses_within_the_survey_are_at_true_size_and_once_more_enlarged_as_said(
    result: Result, contents: Contents
) -> None:
    within = result.points.relative
    true = contents.static["/survey/points/ellipse_95_true_size/0"]
    outlines = np.array(
        contents.static["/survey/points/ellipse_95_exaggerated"]["LineStrips3D:strips"]
    )
    reach = np.linalg.norm(outlines - result.points.position_world_m[:, None], axis=2).max(axis=1)
    factor = measure_scene(result).ellipse_factor

    np.testing.assert_allclose(
        np.array(true["Ellipsoids3D:half_sizes"])[:, :2], within.ellipse_95_m, rtol=1e-5
    )
    np.testing.assert_allclose(reach, factor * within.ellipse_95_m[:, 0], rtol=0.01)
    text = contents.static["/documents/summary"]["TextDocument:text"][0]
    assert f"within the survey, drawn ×{factor}" in text


def test_the_major_axis_of_a_flat_ellipsoid_lies_along_its_azimuth(
    result: Result, contents: Contents
) -> None:
    x, y, z, w = np.array(
        contents.static["/survey/points/ellipse_95_true_size/0"]["Ellipsoids3D:quaternions"]
    ).T
    east, north = 1 - 2 * (y**2 + z**2), 2 * (x * y + w * z)
    azimuth = np.arctan2(east, north) % np.pi

    np.testing.assert_allclose(azimuth, result.points.relative.ellipse_azimuth_rad, atol=1e-5)


def test_measured_lengths_are_labelled_with_value_and_sigma(contents: Contents) -> None:
    labels = contents.static["/survey/labels"]["Points3D:labels"]

    assert "LEAST CERTAIN LENGTH (by 0.19 %): road width 6.310 ± 0.012 m (doubtful)" in labels
    assert "P24: largest 95 % ellipse, 4.7 cm × 2.8 cm" in labels
    assert "SUSPECT R3 hedge: 11.21 m taped, 11.42 m found" in labels
    assert len(labels) <= 14


def test_the_photo_is_put_back_into_original_pixels(contents: Contents) -> None:
    picture = contents.by_frame[f"{PHOTO}/picture"]

    assert sorted(picture["EncodedImage:blob"]) == list(range(20))
    assert picture["Transform3D:scale"][3] == [[SCALE, SCALE, 1.0]]
    assert contents.static[PHOTO]["Pinhole:resolution"] == [[1640.0, 1232.0]]


def test_picks_lie_on_their_original_pixels_half_a_pixel_from_rerun_s_corner(
    result: Result, contents: Contents
) -> None:
    frame = 7
    image = np.array(result.picks.image) == result.frames.frame_id[frame]
    shown = contents.by_frame[f"{PHOTO}/picked"]["Points2D:positions"]

    np.testing.assert_allclose(shown[frame], result.picks.pixel_px[image] + 0.5, atol=1e-3)
    assert shown[5] == []  # unmatched: nothing may stay from the frame before


def test_residuals_are_exaggerated_by_the_stated_factor(result: Result, contents: Contents) -> None:
    frame = 7
    image = np.array(result.picks.image) == result.frames.frame_id[frame]
    strips = np.array(
        contents.by_frame[f"{PHOTO}/residual_exaggerated"]["LineStrips2D:strips"][frame]
    )
    factor = measure_scene(result).residual_factor
    text = contents.static["/documents/summary"]["TextDocument:text"][0]

    np.testing.assert_allclose(
        strips[:, 1] - strips[:, 0], factor * result.picks.residual_px[image], atol=1e-2
    )
    assert f"drawn ×{factor}" in text


def test_reprojections_are_opencv_s_and_only_those_inside_the_photo(
    result: Result, contents: Contents
) -> None:
    frame = 7
    poses = result.frames.refined
    image = np.array(result.picks.image) == result.frames.frame_id[frame]
    at = [result.points.label.index(label) for label in np.array(result.picks.label)[image]]
    pixel = survey.project(
        poses.center_world_m[frame],
        poses.world_from_camera[frame],
        result.points.position_world_m[at],
    )

    shown = contents.by_frame[f"{PHOTO}/from_refined"]["Points2D:positions"]
    np.testing.assert_allclose(shown[frame], pixel + 0.5, atol=1e-3)
    for rows in contents.by_frame[f"{PHOTO}/from_flight_log"]["Points2D:positions"].values():
        spots = np.reshape(rows, (-1, 2))
        assert ((spots >= 0) & (spots <= [1640, 1232])).all()


def test_a_line_in_the_photo_is_bent_and_stays_inside(contents: Contents) -> None:
    bent = False
    for strips in contents.by_frame[f"{PHOTO}/known_lengths/used"]["LineStrips2D:strips"].values():
        for strip in map(np.array, strips):
            assert ((strip >= 0) & (strip <= [1640, 1232])).all()
            chord = strip[-1] - strip[0]
            off = (strip - strip[0]) @ [-chord[1], chord[0]] / np.linalg.norm(chord)
            bent |= bool(np.abs(off).max() > 2)
    assert bent


def test_every_frame_has_a_state_a_sheet_and_the_unmatched_one_too(contents: Contents) -> None:
    states = contents.by_frame["/frame_status"]["StateChange:state"]

    # and an end where the next frame would be, or the last would have no width
    assert sorted(states) == list(range(21))
    assert states[20] == [""]
    assert [states[i] for i in (0, 1, 5, 11, 14)] == [
        ["check"],
        ["refined"],
        ["unmatched"],
        ["rejected"],
        ["seeded"],
    ]
    assert (
        "outside the flight log" in contents.by_frame["/documents/frame"]["TextDocument:text"][5][0]
    )


def test_a_frame_without_a_pose_shows_no_frustum(contents: Contents) -> None:
    depth = contents.by_frame[PHOTO]["Pinhole:image_plane_distance"]

    assert depth[5][0] < 1e-5 < depth[4][0]


def test_curves_have_values_only_where_there_are_any(result: Result, contents: Contents) -> None:
    rms = contents.by_frame["/plots/residual/refined"]["Scalars:scalars"]
    worst = contents.by_frame["/plots/worst_w/worst"]["Scalars:scalars"]
    image = np.array(result.picks.image) == result.frames.frame_id[7]
    height = contents.by_frame["/plots/height/refined"]

    assert sorted(rms) == sorted(worst) == [i for i in range(20) if i not in (5, 11, 14)]
    assert rms[7][0] == pytest.approx(np.sqrt(np.mean(result.picks.residual_px[image] ** 2)))
    assert worst[7][0] == pytest.approx(np.abs(result.picks.w[image]).max())
    assert height["Measurements:variances"][7] == [pytest.approx(0.15**2)]


def test_plots_show_what_picks_and_tests_allow_in_every_frame(
    result: Result, contents: Contents
) -> None:
    sigma = contents.by_frame["/plots/residual/sigma_of_picks"]["Scalars:scalars"]
    limit = contents.by_frame["/plots/worst_w/limit"]["Scalars:scalars"]

    assert [sigma[i] for i in range(20)] == [[1.0]] * 20
    # two-sided quantile of one in a thousand for ten tests, which two for each pick have to share
    own = norm.isf(10 * 0.001 / (2 * np.isfinite(result.picks.w).sum()) / 2)
    assert [limit[i][0] for i in range(20)] == pytest.approx([own] * 20, abs=1e-4)


def test_the_limit_is_that_of_the_run_s_own_significance(result: Result) -> None:
    options = (("solve.significance", 0.01),)
    wider = replace(result, provenance=replace(result.provenance, options=options))
    under_test = np.where(np.arange(len(result.picks.w)) < 5, 1.0, np.nan)
    few = replace(result.picks, w=under_test)

    # quantiles from a table of the normal distribution: ten tests have the significance whole
    assert pick_limit(replace(wider, picks=few)) == pytest.approx(2.5758, abs=1e-4)
    assert pick_limit(replace(result, picks=few)) == pytest.approx(3.2905, abs=1e-4)
    many = 2 * int(np.isfinite(result.picks.w).sum())
    assert pick_limit(wider) == pytest.approx(norm.isf(10 * 0.01 / many / 2), abs=1e-4)


def test_heights_are_above_the_ground_below_the_camera(tmp_path: Path) -> None:
    result = survey.build(frame_count=3)
    plane = replace(result.plane, height_m=replace(result.plane.height_m, value=np.array([2.0])))
    path = tmp_path / "recording.rrd"
    write_recording(replace(result, areas=(plane,)), (), no_ground, path)
    shown = Contents(path).by_frame["/plots/height/refined"]["Measurements:values"]

    expected = result.frames.refined.center_world_m[:, 2] - 2
    assert [shown[i][0] for i in range(3)] == pytest.approx(expected)


def test_every_plot_starts_at_zero(result: Result) -> None:
    scene, picks = measure_scene(result), project_picks(result)
    layout = blueprint(result, scene, frame_curves(result, picks), pose_curves(result))
    plots = [view for view in views(layout.root_container) if view.class_identifier == "TimeSeries"]

    assert len(plots) == 9
    for plot in plots:
        axis = plot.properties["ScalarAxis"]
        assert isinstance(axis, rrb.ScalarAxis)
        assert axis.range is not None
        (bounds,) = axis.range.as_arrow_array().to_pylist()
        assert bounds[0] == 0.0 < bounds[1]


def views(container: rrb.Container) -> Iterator[rrb.View]:
    for item in container.contents:
        if isinstance(item, rrb.View):
            yield item
        else:
            yield from views(item)


@pytest.fixture(scope="module")
def crowded() -> Result:
    """Many measurements, nothing of them in doubt: every third pair of points."""
    labels = [f"P{i:02d}" for i in range(30)]
    pairs = list(combinations(labels, 2))[::3]
    wanted: tuple[survey.Measure, ...] = tuple(
        (f"D{i}", "distance", p, "m") for i, p in enumerate(pairs)
    )
    return with_status(survey.build(measures=wanted), "ok")


def test_many_measurements_are_thin_lines_of_which_the_least_certain_are_labelled(
    crowded: Result, tmp_path: Path
) -> None:
    path = tmp_path / "recording.rrd"
    write_recording(crowded, (), no_ground, path)
    static = Contents(path).static
    texts = [t for t in static["/survey/labels"]["Points3D:labels"] if " ± " in t]
    bold = static["/survey/measured/least_certain"]["LineStrips3D:strips"]
    thin = static["/survey/measured/others"]

    assert 4 <= len(texts) <= 8
    assert len(bold) == len(texts)
    assert len(bold) + len(thin["LineStrips3D:strips"]) == 145
    # screen sizes are stored as negative numbers
    assert -0.5 < thin["LineStrips3D:radii"][0] < 0
    assert texts[0].startswith("LEAST CERTAIN LENGTH (by ")


def test_a_photo_shows_the_measurements_whose_points_are_all_picked_in_it(
    crowded: Result, tmp_path: Path
) -> None:
    path = tmp_path / "recording.rrd"
    write_recording(crowded, (), no_ground, path)
    by_frame = Contents(path).by_frame
    picks, counts = crowded.picks, []
    for name in crowded.frames.frame_id:
        here = {p for p, image in zip(picks.label, picks.image, strict=True) if image == name}
        counts.append(sum(set(points) <= here for points in crowded.measurements.points))
    refined = crowded.has_refined

    shown = by_frame[f"{PHOTO}/measured"]["LineStrips2D:strips"]
    assert [len(shown[i]) for i in range(20)] == [
        c * bool(r) for c, r in zip(counts, refined, strict=True)
    ]
    assert max(counts) > 10
    for words in by_frame[f"{PHOTO}/labels"]["Points2D:labels"].values():
        assert len([word for word in words if " m" in word]) <= 10
    assert by_frame[f"{PHOTO}/known_lengths/used"]["LineStrips2D:strips"][0]


def test_it_opens_at_its_first_frame(contents: Contents) -> None:
    """The viewer opens at the first instant that there is."""
    first = {
        entity: min(min(rows) for rows in columns.values())
        for entity, columns in contents.by_frame.items()
    }

    assert min(first.values()) == 0
    for entity in (PHOTO, f"{PHOTO}/picture", f"{PHOTO}/picked", "/documents/frame"):
        assert first[entity] == 0


@pytest.mark.parametrize("spot", [(0.0, 0.0), (1639.0, 10.0), (3.0, 1231.0), (850.0, 600.0)])
def test_a_label_stands_wholly_in_the_photo(result: Result, spot: tuple[float, float]) -> None:
    at = np.array(spot)
    words = [(at, "P1"), (at, "south 19.93 m ± 0.29 (not checked)")]
    boxes = place_on_photo(result, words, at[None]).boxes

    wide = ON_SMALL_SCREENS * HALF_LETTER * 1640
    for box, letters in zip(boxes, (2, 34), strict=True):
        assert box[2] >= letters * wide
        assert (box[:2] - box[2:4] >= -1e-9).all()
        assert (box[:2] + box[2:4] <= [1640 + 1e-9, 1232 + 1e-9]).all()


def test_misses_are_told_in_metres_at_the_distance_of_the_points(
    result: Result, contents: Contents
) -> None:
    miss = contents.by_frame["/plots/miss/refined"]["Scalars:scalars"]
    pixels = contents.by_frame["/plots/residual/refined"]["Scalars:scalars"]
    center, rows = result.frames.refined.center_world_m[7], []
    for k, image in enumerate(result.picks.image):
        if image == result.frames.frame_id[7] and np.isfinite(result.picks.residual_px[k, 0]):
            point = result.points.position_world_m[result.points.label.index(result.picks.label[k])]
            away = math.dist(point, center) / float(result.shared.intrinsics.value[0])
            rows.append(away * result.picks.residual_px[k])

    assert sorted(miss) == sorted(pixels)
    assert miss[7][0] == pytest.approx(np.sqrt(np.mean(np.square(rows))))


def test_the_photo_is_shown_whole(result: Result) -> None:
    scene, picks = measure_scene(result), project_picks(result)
    layout = blueprint(result, scene, frame_curves(result, picks), pose_curves(result))
    (photo,) = [view for view in views(layout.root_container) if str(view.name).startswith("Photo")]
    visible = photo.properties["VisualBounds2D"]
    assert isinstance(visible, rrb.VisualBounds2D)
    assert visible.range is not None
    bounds = visible.range.as_arrow_array().to_pylist()[0]

    for side, size in (("x_range", 1640), ("y_range", 1232)):
        assert bounds[side][0] <= 0
        assert bounds[side][1] >= size


def test_the_summary_opens_with_what_is_wrong(contents: Contents) -> None:
    text = contents.static["/documents/summary"]["TextDocument:text"][0]

    assert text.startswith(
        "# ⚠ Check: of 10 measurements, 9 are doubtful (skid left, skid right, road width and 6 "
        "more) and 1 is not computed (to the tree).\n\n"
        "1. Line 'R3 hedge' disagrees"
    )
    assert "'to the tree' cannot be measured" in text
    assert "2 more are on the page *Measured*" in text


def test_there_are_two_timelines_and_the_origin_is_a_property(contents: Contents) -> None:
    assert contents.timelines == {"frame", "capture_time"}


def test_a_layout_comes_before_all_else_and_is_replaced(tmp_path: Path) -> None:
    """A viewer plays what arrives before it, and would then stop at the fourth photo."""
    path = tmp_path / "recording.rrd"
    write_recording(survey.build(frame_count=2), (), no_ground, path)

    assert len(RrdReader(str(path)).blueprints()) == 2
    viewer = Path(sys.executable).with_name("rerun")
    listed = subprocess.run(
        [viewer, "rrd", "print", path], check=True, capture_output=True, text=True
    ).stdout
    assert listed.index("- /time_panel") < listed.index("- /survey")


def test_nothing_in_the_recording_is_infinite_or_nan(contents: Contents) -> None:
    def numbers(value: object) -> Iterator[float]:
        if isinstance(value, float):
            yield value
        elif isinstance(value, list):
            for item in value:
                yield from numbers(item)

    for entity, columns in contents.static.items():
        for name, value in columns.items():
            assert all(map(math.isfinite, numbers(value))), (entity, name)
    for entity, moving in contents.by_frame.items():
        for name, rows in moving.items():
            assert all(map(math.isfinite, numbers(list(rows.values())))), (entity, name)


@pytest.mark.parametrize(
    "variant",
    [
        {"telemetry": False},
        {"frame_count": 1},
        {"lines": ()},
        {"measures": ()},
        {"lines": (), "measures": (), "point_count": 0},
        {"frame_count": 150},
        {"clean": True},
        {"label": "<b>P{:02d}</b> | ä/*"},
    ],
    ids=str,
)
def test_unusual_surveys_have_a_recording_too(tmp_path: Path, variant: survey.Variant) -> None:
    path = tmp_path / "recording.rrd"
    result = survey.build(**variant)
    write_recording(result, previews(result, [0]).items(), no_ground, path)

    contents = Contents(path)
    states = contents.by_frame["/frame_status"]["StateChange:state"]
    assert len(states) == len(result.frames.status) + 1


def test_without_telemetry_there_is_no_map_and_the_summary_says_why(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    write_recording(survey.build(telemetry=False), (), no_ground, path)
    contents = Contents(path)

    assert not any(entity.startswith("/map") for entity in contents.static)
    assert "there is no map" in contents.static["/documents/summary"]["TextDocument:text"][0]
    assert "/survey/flight_log/track" not in contents.static


def test_a_frame_without_a_photo_does_not_show_the_one_before_it(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    result = survey.build(frame_count=4)
    write_recording(result, previews(result, [0, 1, 3]).items(), no_ground, path)
    picture = Contents(path).by_frame[f"{PHOTO}/picture"]

    assert [picture["EncodedImage:opacity"][i] for i in range(4)] == [[1.0], [1.0], [0.0], [1.0]]
    assert sorted(picture["EncodedImage:blob"]) == [0, 1, 3]


def test_the_same_result_gives_the_same_recording(result: Result, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_recording(
            result, previews(result, [0, 1]).items(), no_ground, tmp_path / f"{name}.rrd"
        )
    a, b = (Contents(tmp_path / f"{name}.rrd") for name in "ab")
    ids = [RrdReader(str(tmp_path / f"{name}.rrd")).recordings()[0].recording_id for name in "ab"]

    assert a.static == b.static
    assert a.by_frame == b.by_frame
    assert ids[0] == ids[1]


def test_rerun_s_strictness_is_left_as_it_was(tmp_path: Path) -> None:
    before = rr.strict_mode()
    try:
        for mode in (False, True):
            rr.set_strict_mode(mode)
            write_recording(survey.build(frame_count=1), (), no_ground, tmp_path / "recording.rrd")
            assert rr.strict_mode() is mode
    finally:
        rr.set_strict_mode(before)


def test_a_recording_that_cannot_be_written_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        write_recording(
            survey.build(frame_count=1), (), no_ground, tmp_path / "nowhere" / "recording.rrd"
        )


def test_a_failed_recording_leaves_the_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> Never:
        raise RuntimeError("planted")

    path = tmp_path / "recording.rrd"
    path.write_bytes(b"earlier")
    monkeypatch.setattr("uavgram.views.recording.write.log_map", fail)
    with pytest.raises(RuntimeError, match="planted"):
        write_recording(survey.build(frame_count=2), (), no_ground, path)

    assert path.read_bytes() == b"earlier"
    assert [p.name for p in tmp_path.iterdir()] == ["recording.rrd"]


FULL_DISK = """
import errno, pickle, resource, sys
from pathlib import Path
from uavgram.views.recording import write_recording

result, path = pickle.loads(open(sys.argv[1], "rb").read()), Path(sys.argv[2])
whole, hard = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)[1]
for limit in map(int, sys.argv[3:]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        write_recording(result, (), lambda: None, path)
    except OSError as error:
        left = [each.name for each in path.parent.iterdir()]
        print(limit, path.read_bytes() == whole, left, error.errno == errno.EFBIG, error)
"""


def test_a_disk_that_is_full_while_rerun_writes_is_left_to_who_chose_the_folder(
    tmp_path: Path,
) -> None:
    pytest.importorskip("resource", reason="file size limits exist on POSIX systems only")
    result, path = survey.build(frame_count=4), tmp_path / "out" / "recording.rrd"
    path.parent.mkdir()
    (tmp_path / "result").write_bytes(pickle.dumps(result))
    write_recording(result, (), no_ground, path)
    limits = [str(int(room * path.stat().st_size)) for room in (0.05, 0.5, 0.99)]
    command = [sys.executable, "-c", FULL_DISK, str(tmp_path / "result"), str(path), *limits]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)

    for told, limit in zip(run.stdout.splitlines(), limits, strict=True):
        assert told.startswith(f"{limit} True ['recording.rrd'] True ")
        assert "File too large" in told


def test_rerun_s_own_verification_finds_no_fault(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    write_recording(result, previews(result, [0, 1]).items(), no_ground, path)
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)

    assert run.returncode == 0, run.stderr
    assert "verified without error" in run.stdout + run.stderr
