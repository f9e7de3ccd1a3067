"""Points off the ground, in the recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
import synthetic_survey as survey
from points_in_space import HEIGHTS, raised
from recording_contents import Contents
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from uneven_ground import DEPARTURE_M, uneven

from uavgram.model.result.result import Result
from uavgram.views.recording import write_recording
from uavgram.views.recording.blueprint import blueprint
from uavgram.views.recording.curves import frame_curves, pose_curves
from uavgram.views.recording.legend import BAND_PX, LEGEND_BACKGROUND, draw_legend
from uavgram.views.recording.photo import project_picks
from uavgram.views.recording.scene import measure_scene
from uavgram.views.style import ABOVE, BELOW, FREE, REFERENCE, UNASKED
from uavgram.views.survey.heights import height_label, height_of

PHOTO = "/survey/current_camera/photo"
RULERS = "/survey/points/heights"
ELLIPSOIDS = "/survey/points/ellipsoid_95_true_size/0"
ENLARGED = "/survey/points/ellipsoid_95_exaggerated/0"


def no_ground() -> None:
    """In place of a mosaic."""


@pytest.fixture(scope="module")
def result() -> Result:
    return raised(survey.build(frame_count=4))


@pytest.fixture(scope="module")
def contents(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("raised") / "recording.rrd"
    write_recording(result, (), no_ground, path)
    return Contents(path)


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("flat") / "recording.rrd"
    write_recording(survey.build(frame_count=2), (), no_ground, path)
    return Contents(path)


def rows_of(result: Result, *labels: str) -> list[int]:
    return [result.points.label.index(label) for label in labels]


@pytest.mark.parametrize(
    ("source", "labels", "colour"),
    [
        ("free", ("P09", "P14"), FREE),
        ("stated", ("P15", "P20"), REFERENCE),
        ("found", ("P21",), UNASKED),
    ],
)
def test_rulers_stand_on_the_ground_in_the_colour_of_where_heights_are_from(
    result: Result, contents: Contents, source: str, labels: tuple[str, ...], colour: object
) -> None:
    rulers = contents.static[f"{RULERS}/{source}"]
    strips = np.array(rulers["LineStrips3D:strips"])
    top = result.points.position_world_m[rows_of(result, *labels)]
    (packed,) = rulers["LineStrips3D:colors"]

    np.testing.assert_allclose(strips[:, 1], top, atol=1e-5)
    np.testing.assert_allclose(strips[:, 0, :2], top[:, :2], atol=1e-5)
    np.testing.assert_allclose(strips[:, 0, 2], 0.0, atol=1e-5)  # the ground of this survey
    assert (packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255) == colour


def test_who_points_at_a_ruler_reads_its_height(contents: Contents) -> None:
    free, stated = (contents.static[f"{RULERS}/{one}"] for one in ("free", "stated"))

    assert free["LineStrips3D:labels"][0] == "P09 1.400 ± 0.030 m, found"
    assert stated["LineStrips3D:labels"] == [
        "P15 0.800 m, as stated",
        "P20 2.500 ± 0.050 m, stated and adjusted",
    ]
    assert free["LineStrips3D:show_labels"] == [False]


def test_ellipsoids_are_those_of_the_covariance_within_the_survey(
    result: Result, contents: Contents
) -> None:
    shown = contents.static[ELLIPSOIDS]
    rows = rows_of(result, *HEIGHTS)
    half = np.array(shown["Ellipsoids3D:half_sizes"])
    axes = Rotation.from_quat(np.array(shown["Ellipsoids3D:quaternions"])).as_matrix()
    made = np.einsum("nij,nj,nkj->nik", axes, half**2 / chi2.ppf(0.95, 3), axes)

    np.testing.assert_allclose(made, result.points.relative.covariance_m3[rows], atol=1e-7)
    np.testing.assert_allclose(
        shown["Ellipsoids3D:centers"], result.points.position_world_m[rows], atol=1e-5
    )


def test_points_on_the_ground_stay_flat_ellipses(result: Result, contents: Contents) -> None:
    shown = contents.static["/survey/points/ellipse_95_true_size/0"]
    on_ground = np.delete(np.arange(30), rows_of(result, *HEIGHTS))

    np.testing.assert_allclose(
        shown["Ellipsoids3D:centers"], result.points.position_world_m[on_ground], atol=1e-5
    )
    assert np.array(shown["Ellipsoids3D:half_sizes"])[:, 2].max() < 2e-3


def test_the_close_up_of_a_raised_point_has_its_flat_ellipse(
    result: Result, contents: Contents, flat: Contents, tmp_path: Path
) -> None:
    within = result.points.relative.ellipse_95_m.copy()
    within[rows_of(result, "P14")] = 0.5, 0.25
    relative = replace(result.points.relative, ellipse_95_m=within)
    worst = replace(result, points=replace(result.points, relative=relative))
    write_recording(worst, (), no_ground, tmp_path / "recording.rrd")
    shown = Contents(tmp_path / "recording.rrd").static["/close_up/ellipse_95/0"]

    np.testing.assert_allclose(shown["Ellipsoids3D:half_sizes"], [[0.5, 0.25, 1e-3]], rtol=1e-5)
    for on_ground in (contents, flat):
        assert "/close_up/ellipse_95/0" not in on_ground.static


def test_small_ellipsoids_are_drawn_once_more_as_much_larger_as_said(
    result: Result, contents: Contents, tmp_path: Path
) -> None:
    certain = raised(survey.build(frame_count=2), factor=1e-3)
    write_recording(certain, (), no_ground, tmp_path / "recording.rrd")
    small = Contents(tmp_path / "recording.rrd").static
    factor = measure_scene(certain).ellipsoid_factor
    true, enlarged = (np.array(small[e]["Ellipsoids3D:half_sizes"]) for e in (ELLIPSOIDS, ENLARGED))

    assert factor >= 5
    np.testing.assert_allclose(enlarged, factor * true, rtol=1e-5)
    assert f"true size and ×{factor}" in small["/documents/summary"]["TextDocument:text"][0]
    assert measure_scene(result).ellipsoid_factor == 1
    assert ENLARGED not in contents.static


def test_a_survey_on_the_ground_has_none_of_this(flat: Contents) -> None:
    words = ("height", "ellipsoid", "from_the_side")

    assert not [e for e in flat.static if any(word in e for word in words) and "plots" not in e]
    assert not [e for e in flat.by_frame if "photo/heights" in e]
    for page in ("summary", "points"):
        text = flat.static[f"/documents/{page}"]["TextDocument:text"][0]
        assert "above the ground" not in text
        assert "llipsoid" not in text


def test_the_side_view_looks_level_across_the_longer_side_and_has_all_in_it(
    result: Result,
) -> None:
    scene = measure_scene(result)
    eye, standing = scene.side_eye, scene.off_ground
    assert eye is not None
    assert standing is not None
    heads = result.points.position_world_m[standing.rows]
    long = np.linalg.svd((heads - heads.mean(axis=0))[:, :2])[2][0]
    screen = eye.project_to_screen(np.concatenate([heads, standing.foot_m]))

    assert abs(eye.towards[2]) < 0.1
    assert abs(eye.towards[:2] @ long) < 1e-6
    assert eye.towards[1] < 0  # as in the survey's view, north is rather away
    assert (np.abs(screen) <= [0.70 + 1e-9, 0.47 + 1e-9]).all()
    assert np.ptp(screen[:, 0]) > 1.2


def test_heights_stand_beside_their_points_in_the_side_view(
    result: Result, contents: Contents
) -> None:
    shown = contents.static["/from_the_side/heights"]
    texts, spots = shown["Points3D:labels"], np.array(shown["Points3D:positions"])
    rows = rows_of(result, *(text.split()[0] for text in texts))

    assert "P14 6.00 ± 0.12 m" in texts
    assert len(texts) >= 4
    eye = measure_scene(result).side_eye
    assert eye is not None
    offset = eye.project_to_screen(spots) - eye.project_to_screen(
        result.points.position_world_m[rows]
    )
    beside = (np.abs(offset) < [0.3, 0.075]).all(axis=1)
    assert beside.mean() > 0.7
    lines = contents.static.get("/from_the_side/heights/lines", {"LineStrips3D:strips": []})
    ends = {tuple(np.round(end, 5)) for _, end in lines["LineStrips3D:strips"]}
    assert {tuple(np.round(spot, 5)) for spot in spots[~beside]} <= ends


def views(container: rrb.Container) -> Iterator[rrb.View]:
    for item in container.contents:
        if isinstance(item, rrb.View):
            yield item
        else:
            yield from views(item)


def test_there_is_a_view_and_a_page_more(result: Result) -> None:
    def names(of: Result) -> set[str]:
        layout = blueprint(
            of, measure_scene(of), frame_curves(of, project_picks(of)), pose_curves(of)
        )
        return {str(view.name) for view in views(layout.root_container)}

    more = names(result) - names(survey.build(frame_count=4))
    side, page = sorted(name for name in more if not name.startswith(("Photo", "Worst")))
    assert side.startswith("From the side, looking north")
    assert page == "Heights"


def test_points_and_rulers_lie_in_the_photo_where_opencv_projects_them(
    result: Result, contents: Contents
) -> None:
    poses, points, seen = result.frames.refined, result.points, 0
    size = np.array([survey.WIDTH_PX, survey.HEIGHT_PX]) - 0.5
    by_frame = contents.by_frame[f"{PHOTO}/heights/free"]["LineStrips2D:strips"]
    for frame, name in enumerate(result.frames.frame_id):
        picked = [
            label
            for image, label in zip(result.picks.image, result.picks.label, strict=True)
            if image == name
        ]
        shown = contents.by_frame[f"{PHOTO}/from_refined"]["Points2D:positions"][frame]
        camera = poses.center_world_m[frame], poses.world_from_camera[frame]
        pixel = survey.project(*camera, points.position_world_m[rows_of(result, *picked)])
        inside = ((pixel > -0.5) & (pixel < size)).all(axis=1)
        np.testing.assert_allclose(np.array(shown) - 0.5, pixel[inside], atol=1e-3)

        free = [label for label in picked if HEIGHTS.get(label, (0, 0, ""))[2] == "free"]
        strips = [np.array(strip) - 0.5 for strip in by_frame[frame]]
        assert len(strips) == len(free)
        for strip, row in zip(strips, rows_of(result, *free), strict=True):
            top = points.position_world_m[row]
            ends = survey.project(*camera, np.stack([top * [1, 1, 0], top]))
            if ((ends > -0.5) & (ends < size)).all():  # cut off at the photo's border else
                np.testing.assert_allclose(strip[[0, -1]], ends, atol=1e-2)
                seen += 1
    assert seen >= 2


def test_names_in_the_photo_tell_heights(contents: Contents) -> None:
    shown = contents.by_frame[f"{PHOTO}/labels"]["Points2D:labels"]
    words = {word for texts in shown.values() for word in texts}

    assert "P14 +6.00 m" in words
    assert not words & set(HEIGHTS)
    assert words & {"P02", "P03", "P07", "P08", "P13"}


def test_the_pages_have_heights_and_where_they_are_from(contents: Contents) -> None:
    heights, points = (
        contents.static[f"/documents/{page}"]["TextDocument:text"][0]
        for page in ("heights", "points")
    )
    lines = [line for line in heights.splitlines() if line.startswith("| P")]

    assert [line.split("|")[1].strip() for line in lines] == ["P14", "P20", "P21", "P09", "P15"]
    assert "| P09 | **1.400 ± 0.030 m, found** |" in heights
    assert "| P15 | **0.800 m, as stated** |" in heights
    for page in (heights, points):
        assert len({line.count("|") for line in page.splitlines() if line.startswith("|")}) == 1
    assert "| -0.300 ± 0.040 m, found, though its picks have it on the ground |" in points


def test_bars_of_the_ground_stand_on_the_ground_below_a_raised_point(tmp_path: Path) -> None:
    both = uneven(raised(survey.build(frame_count=2)))
    write_recording(both, (), no_ground, tmp_path / "recording.rrd")
    bars = Contents(tmp_path / "recording.rrd").static["/survey/points/off_plane"]

    np.testing.assert_allclose(np.array(bars["LineStrips3D:strips"])[:, 0, 2], 0.0, atol=1e-5)


def test_the_legend_has_their_colours_and_room_for_them(result: Result) -> None:
    def has_colour(of: Result) -> bool:
        image = np.asarray(draw_legend(of, measure_scene(of)))
        return bool((image == FREE).all(axis=-1).any())

    assert has_colour(result)
    assert not has_colour(survey.build(frame_count=2))
    everything = np.asarray(
        draw_legend(uneven(result), measure_scene(uneven(result)), brightened=True)
    )
    assert (everything[BAND_PX + 1 :, -8:] == LEGEND_BACKGROUND).all()


def test_labels_say_which_heights_were_stated(result: Result) -> None:
    rows = rows_of(result, "P21", "P15", "P20")

    assert [height_label(result.points, row) for row in rows] == [
        "P21 -0.300 ± 0.040 m, not free in the picks",
        "P15 0.80 m, stated",
        "P20 2.500 ± 0.050 m, stated",
    ]
    assert (
        height_of(result.points, rows[0])
        == "-0.300 ± 0.040 m, found, though its picks have it on the ground"
    )


# Where the ground is no plane, in the recording.


BARS = "/survey/points/off_plane"


@pytest.fixture(scope="module")
def uneven_result() -> Result:
    built: Result = survey.build(frame_count=2)
    return uneven(built)


@pytest.fixture(scope="module")
def uneven_contents(uneven_result: Result, tmp_path_factory: pytest.TempPathFactory) -> Contents:
    path = tmp_path_factory.mktemp("uneven") / "recording.rrd"
    write_recording(uneven_result, (), no_ground, path)
    return Contents(path)


def test_bars_stand_on_points_off_the_plane_as_tall_as_said(
    uneven_result: Result, uneven_contents: Contents
) -> None:
    bars = np.array(uneven_contents.static[BARS]["LineStrips3D:strips"])
    rows = [uneven_result.points.label.index(label) for label in DEPARTURE_M]
    factor = measure_scene(uneven_result).departure_factor
    size = np.abs(list(DEPARTURE_M.values()))

    assert factor > 1
    np.testing.assert_allclose(bars[:, 0], uneven_result.points.position_world_m[rows], atol=1e-5)
    np.testing.assert_allclose(bars[:, 1, :2], bars[:, 0, :2], atol=1e-5)
    np.testing.assert_allclose(bars[:, 1, 2] - bars[:, 0, 2], factor * size, atol=1e-5)
    assert uneven_contents.static[BARS]["LineStrips3D:colors"][3] == 0x0571B0FF
    text = uneven_contents.static["/documents/summary"]["TextDocument:text"][0]
    assert f"{factor} times as tall as the departure of their ground from its plane" in text
    assert "farthest off is P21, by -0.200 m" in text


def test_the_page_of_points_has_their_departures(uneven_contents: Contents) -> None:
    text = uneven_contents.static["/documents/points"]["TextDocument:text"][0]
    widths = {line.count("|") for line in text.splitlines() if line.startswith("|")}

    assert "-0.200 ± 0.020" in text
    assert len(widths) == 1


def test_a_plane_has_neither_bars_nor_words_of_them(tmp_path: Path) -> None:
    write_recording(survey.build(frame_count=2), (), no_ground, tmp_path / "flat.rrd")
    flat = Contents(tmp_path / "flat.rrd")

    assert BARS not in flat.static
    for page in ("summary", "points"):
        assert "its plane" not in flat.static[f"/documents/{page}"]["TextDocument:text"][0]


def test_the_legend_has_both_colours_only_where_bars_are(uneven_result: Result) -> None:
    def colours(of: Result) -> set[tuple[int, ...]]:
        image = np.asarray(draw_legend(of, measure_scene(of)))
        return {tuple(pixel) for pixel in np.unique(image.reshape(-1, 3), axis=0).tolist()}

    assert {ABOVE, BELOW} <= colours(uneven_result)
    assert not {ABOVE, BELOW} & colours(survey.build(frame_count=2))


@pytest.mark.parametrize("telemetry", [True, False])
def test_the_legend_has_room_for_them(telemetry: bool) -> None:  # noqa: FBT001
    rough = uneven(survey.build(telemetry=telemetry))
    image = np.asarray(draw_legend(rough, measure_scene(rough), brightened=True))
    assert (image[BAND_PX + 1 :, -8:] == LEGEND_BACKGROUND).all()
