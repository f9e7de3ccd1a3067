"""Cameras from tags: the makers' published formulas, and calibrations that were really made."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np
import pytest
import scipy.stats
import yaml

from uavgram.errors import InputError
from uavgram.geometry.camera.projection import project
from uavgram.io.cameras import read_drone_cameras
from uavgram.io.photos.metadata import read_camera_tags
from uavgram.model import camera as calibration
from uavgram.model.arrays import Floats
from uavgram.model.camera import AssumedErrors, Calibration, CameraTags, make_assumed_covariance
from uavgram.model.message import Message
from uavgram.model.result.result import CameraUpdate, Estimate, compare_cameras
from uavgram.stages.camera import assume_camera, report_learnt_camera

DEWARP = (3684.48, 3677.57, 2.24, 22.05, -0.263482, 0.106788, 3.71107e-05, -3.27247e-04, -0.0300783)


class Tags(TypedDict, total=False):
    """What a photo says of its camera."""

    make: str
    model: str
    focal_mm: float
    focal_step_mm: float
    focal_35mm_mm: float
    focal_plane_per_mm: tuple[float, float]
    original_px: tuple[float, float]
    digital_zoom: float
    dewarp: tuple[float, ...]
    dewarped: bool


def assume(
    *, may_be_unknown: bool = False, size: tuple[int, int] = (4000, 3000), **tags: Unpack[Tags]
) -> tuple[Calibration, tuple[Message, ...]]:
    given = CameraTags(path="photo.jpg", width_px=size[0], height_px=size[1], **tags)
    return assume_camera(given, read_drone_cameras(), may_be_unknown=may_be_unknown)


def sigma_of(camera: Calibration) -> Floats:
    return np.sqrt(np.diag(camera.covariance))


def test_the_makers_calibration_projects_by_the_makers_formula() -> None:
    """Mavic 3M Image Processing Guide, page 9: [fx 0 W/2+cx; 0 fy H/2+cy], OpenCV's order."""
    camera, messages = assume(dewarp=DEWARP, size=(5472, 3648), make="DJI", model="FC6310R")
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = DEWARP
    x, y = 0.3 / 1.2, -0.2 / 1.2
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = 2736 + cx + fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x))
    v = 1824 + cy + fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)

    np.testing.assert_allclose(
        project("brown", camera.parameters, np.array([0.3, -0.2, 1.2])), [u, v], atol=1e-9
    )
    assert "the maker's calibration in the photo (DewarpData)" in messages[0].text
    assert sigma_of(camera)[0] / fx == pytest.approx(0.005)


def test_twelve_parameters_of_the_maker_are_kept() -> None:
    camera, _ = assume(dewarp=(*DEWARP, 0.1, 0.2, 0.3))

    np.testing.assert_array_equal(camera.parameters[9:], [0.1, 0.2, 0.3])
    assert camera.covariance.shape == (12, 12)


def test_a_photo_without_its_distortion_has_none() -> None:
    camera, messages = assume(dewarp=DEWARP, dewarped=True)

    assert not camera.parameters[4:].any()
    assert "free of distortion" in messages[0].text


def test_the_table_gives_the_focal_length_of_a_whole_frame() -> None:
    camera, messages = assume(make="DJI", model="FC220", focal_mm=4.73, focal_step_mm=0.01)

    # 4.73 mm over a pixel of 6.32692 / 4000 mm
    assert camera.parameters[0] == pytest.approx(4.73 / 6.32692 * 4000)
    assert camera.parameters[4] == 0.032984
    assert sigma_of(camera)[4] == pytest.approx(math.hypot(0.02, 0.032984))  # perhaps removed
    assert sigma_of(camera)[0] / camera.parameters[0] == pytest.approx(0.02, rel=0.01)
    assert re.search(r"± 60 px \(2\.0 %\).*known to about 0\.2 %", messages[0].text)
    assert [m.code for m in messages] == ["camera-assumed"]


def test_a_smaller_photo_of_the_whole_frame_has_larger_pixels() -> None:
    whole, _ = assume(make="DJI", model="FC220", focal_mm=4.73)
    half, _ = assume(make="DJI", model="FC220", focal_mm=4.73, size=(2000, 1500))

    np.testing.assert_allclose(half.parameters[:2] * 2, whole.parameters[:2])
    np.testing.assert_allclose(half.parameters[2:4], [999.5, 749.5])


def test_a_coarsely_rounded_focal_length_is_known_less_well() -> None:
    fine, _ = assume(make="DJI", model="FC220", focal_mm=5.0, focal_step_mm=0.01)
    coarse, _ = assume(make="DJI", model="FC220", focal_mm=5.0, focal_step_mm=1.0)
    share = sigma_of(coarse)[0] / coarse.parameters[0]

    assert share == pytest.approx(math.hypot(0.02, 0.2 / math.sqrt(12)))
    assert sigma_of(fine)[0] < sigma_of(coarse)[0]


def test_of_two_cameras_of_one_name_the_nearer_in_size_is_taken() -> None:
    colour, _ = assume(make="autel robotics", model="XT709", focal_mm=25.6, size=(8000, 6000))
    thermal, _ = assume(make="Autel Robotics", model="XT709", focal_mm=13.0, size=(640, 512))

    assert colour.parameters[0] == pytest.approx(25.6 / (6.4 / 8000))
    assert thermal.parameters[0] == pytest.approx(13.0 / 0.012)


def test_a_distortion_that_folds_back_in_the_image_is_not_believed() -> None:
    # a tele lens (k1 k2 k3 = -0.25 1.8 -6.4) with the focal length of a wide one
    camera, messages = assume(make="DJI", model="FC4382", focal_mm=5.0, size=(4032, 3024))

    assert not camera.parameters[4:].any()
    assert "its distortion is unknown" in messages[0].text
    assert sigma_of(camera)[4] == calibration.UNKNOWN_RADIAL_SIGMAS[0]


def test_an_unknown_camera_has_its_35_mm_equivalent() -> None:
    camera, messages = assume(make="ACME", model="Eye 1", focal_35mm_mm=43.2666, size=(3600, 2400))

    # the diagonal of the frame is that focal length
    assert camera.parameters[0] == pytest.approx(math.hypot(3600, 2400), rel=1e-6)
    assert "the 35 mm equivalent in EXIF (43.2666 mm)" in messages[0].text


@pytest.mark.parametrize("size", [(4000, 2250), (2250, 4000)])
def test_a_strip_of_a_sensor_is_known_less_well(size: tuple[int, int]) -> None:
    camera, messages = assume(focal_35mm_mm=20.0, size=size)

    # a strip of 4000 x 3000: 20 mm over 43.27 mm, times 5000 px
    assert camera.parameters[0] == pytest.approx(20 / math.hypot(36, 24) * 5000)
    assert sigma_of(camera)[0] / camera.parameters[0] == pytest.approx(0.08)
    assert "how wide a strip" in messages[0].text


@pytest.mark.parametrize(
    ("tags", "words"),
    [
        ({}, "does not name its camera"),
        ({"make": "ACME", "model": "Eye"}, "'ACME Eye', and does not state a focal length"),
        ({"make": "parrot", "model": "BEBOP 2", "focal_mm": 1.8}, "fisheye lens"),
        ({"make": "DJI", "model": "FC220", "focal_mm": 4.7, "digital_zoom": 2}, "digital zoom"),
    ],
)
def test_what_nothing_is_known_of_is_refused_with_the_way_out(tags: Tags, words: str) -> None:
    with pytest.raises(InputError, match=rf"photo\.jpg: .*{words}.*uavgram calibrate") as refused:
        assume(**tags)
    assert ("camera: unknown" in str(refused.value)) == ("fisheye" not in words)


def test_of_an_unknown_camera_the_focal_length_is_as_those_of_drones_are() -> None:
    camera, messages = assume(may_be_unknown=True)
    equivalents = np.array([*calibration.ORDINARY_EQUIVALENTS_MM.values()])
    share = sigma_of(camera)[:2] / camera.parameters[:2]
    equivalent = camera.parameters[0] / 5000 * math.hypot(36, 24)

    # Between the phones that fly and the survey cameras; two sigmas reach both ends.
    assert 24 < equivalent < 28
    assert equivalent == pytest.approx(scipy.stats.gmean(equivalents))
    assert equivalents.min() > equivalent * (1 - 2 * share[0])
    assert equivalents.max() < equivalent * (1 + 2.5 * share[0])
    spread = math.log(scipy.stats.gstd(equivalents))
    np.testing.assert_allclose(share, math.hypot(spread, calibration.CROPPED_FOCAL_SIGMA))
    assert camera.parameters[2:].tolist() == [1999.5, 1499.5, 0, 0, 0, 0, 0]
    assert sigma_of(camera)[2] == pytest.approx(0.02 * 4000)
    assert sigma_of(camera)[[4, 5, 8]].tolist() == [*calibration.UNKNOWN_RADIAL_SIGMAS]
    (message,) = messages
    assert (message.level, message.code) == ("warning", "camera-unknown")
    assert "does not name its camera" in message.text
    assert f"{camera.parameters[0]:.0f} ± {sigma_of(camera)[0]:.0f} px (20 %)" in message.text
    assert "calibrate it from these photos" in message.text


def test_what_an_ordinary_camera_is_comes_from_cameras_of_the_table() -> None:
    table = {camera.make_model: camera for camera in read_drone_cameras() if not camera.is_thermal}
    lens_mm = {"djiFC550": 15, "djiZP1": 35, "djiFC6540": 24, "djiXT2": 8}
    for name, equivalent in calibration.ORDINARY_EQUIVALENTS_MM.items():
        camera = table[name]
        assert camera.is_perspective
        if name in lens_mm:
            sensor = np.array(camera.pitch_mm) * [camera.width_px, camera.height_px]
            exact = lens_mm[name] / np.hypot(*sensor) * math.hypot(36, 24)
            assert equivalent == pytest.approx(exact, abs=0.05)


def test_the_said_corner_error_is_that_of_the_assumed_distortion() -> None:
    camera, messages = assume(may_be_unknown=True)
    corner = np.array([[2000.0, 1500.0, camera.parameters[0]]])
    middle = camera.parameters[2:4]
    at = []
    for which, sigma in zip((4, 5, 8), calibration.UNKNOWN_RADIAL_SIGMAS, strict=True):
        parameters = np.array(camera.parameters)
        parameters[which] = sigma
        moved = project("brown", parameters, corner)[0] - middle
        at.append(np.hypot(*moved) - 2500)

    found = re.search(r"± (\d+) px at the corners", messages[0].text)
    assert found is not None
    said = float(found[1])
    assert said == pytest.approx(np.hypot.reduce(at), abs=0.5)


def test_calibrations_of_cameras_that_say_nothing_lie_within_two_sigmas_of_an_ordinary_one(
    data_dir: Path,
) -> None:
    """Two of video frames, one of a strip of a sensor, one of a whole frame."""
    duck = json.loads((data_dir / "cirn_duck" / "control.json").read_text())["camera"]
    beach = json.loads((data_dir / "narrabeen_mavic" / "control.json").read_text())["camera"]
    board = json.loads((data_dir / "phantom3_lenscalib" / "control.json").read_text())["camera"]
    plane = yaml.safe_load((data_dir / "cuav" / "camera.yaml").read_text())["parameters"]
    for focal, size in (
        (duck["fx"], (3840, 2160)),
        (beach["fx"], beach["for_size"]),
        (board["fx"], (4000, 2250)),
        (plane[0], (1640, 1232)),
    ):
        camera, _ = assume(may_be_unknown=True, size=size)
        assert abs(focal - camera.parameters[0]) < 2 * sigma_of(camera)[0]


def test_digital_zoom_makes_an_unknown_camera_so_much_longer() -> None:
    plain, _ = assume(may_be_unknown=True)
    zoomed, messages = assume(may_be_unknown=True, digital_zoom=2.0, focal_35mm_mm=24.0)

    np.testing.assert_allclose(zoomed.parameters[:2], 2 * plain.parameters[:2])
    np.testing.assert_allclose(sigma_of(zoomed)[:4], 2 * sigma_of(plain)[:4])
    assert "was taken with digital zoom (2 times)" in messages[0].text


def test_a_better_source_is_used_though_the_camera_may_be_unknown() -> None:
    known, _ = assume(make="DJI", model="FC220", focal_mm=4.73)
    same, messages = assume(may_be_unknown=True, make="DJI", model="FC220", focal_mm=4.73)

    np.testing.assert_array_equal(same.parameters, known.parameters)
    np.testing.assert_array_equal(same.covariance, known.covariance)
    assert [m.code for m in messages] == ["camera-assumed"]


@pytest.mark.parametrize("more", [{"digital_zoom": 2.0}, {"focal_35mm_mm": 24.0}, {}])
@pytest.mark.parametrize("may_be_unknown", [False, True])
def test_a_fisheye_is_never_taken_for_a_perspective_lens(
    *, may_be_unknown: bool, more: Tags
) -> None:
    given: Tags = {"make": "parrot", "model": "BEBOP 2", **more}
    with pytest.raises(InputError, match=r"fisheye lens \(parrot BEBOP 2\).*uavgram calibrate"):
        assume(may_be_unknown=may_be_unknown, **given)


def test_assumed_sigmas_hold_for_calibrations_that_were_really_made(data_dir: Path) -> None:
    """The evidence that model/camera.py names, from the files themselves."""
    shares, offsets = [], []
    for folder, photo in (
        ("phantom3_lenscalib", "DJI_0002.jpg"),
        ("narrabeen_mavic", "snapshotNarrabeen.JPG"),
    ):
        truth = json.loads((data_dir / folder / "control.json").read_text())["camera"]
        camera, _ = assume_camera(read_camera_tags(data_dir / folder / photo), read_drone_cameras())
        width, height = truth.get("for_size", (camera.width_px, camera.height_px))
        fx, fy = camera.parameters[:2]
        shares += [truth["fx"] / fx - 1, truth["fy"] / fy - 1]
        offsets += [
            (truth["cx"] - (width - 1) / 2) / width,
            (truth["cy"] - (height - 1) / 2) / width,
        ]
        within = np.abs(np.array([*shares[-2:]])) / (sigma_of(camera)[:2] / [fx, fy])
        assert (within < 2).all()

    np.testing.assert_allclose(shares, [0.0071, 0.0107, 0.1173, 0.1170], atol=2e-4)
    assert np.sqrt(np.mean(np.square(shares))) < 1.1 * calibration.CROPPED_FOCAL_SIGMA
    assert np.sqrt(np.mean(np.square(offsets))) < 1.2 * calibration.CROPPED_CENTRE_SIGMA


def test_assumed_focal_lengths_go_together_as_far_as_pixels_are_square() -> None:
    parameters = np.array([2000.0, 2000, 1000, 700, 0, 0, 0, 0, 0])
    covariance = make_assumed_covariance(
        "brown", parameters, 2000, AssumedErrors(focal=0.02, centre=0.01)
    )
    ratio = np.zeros(9)
    ratio[:2] = 1 / 2000, -1 / 2000

    assert np.sqrt(ratio @ covariance @ ratio) == pytest.approx(calibration.ASPECT_SIGMA)
    assert np.linalg.eigvalsh(covariance)[0] > 0
    np.testing.assert_allclose(np.sqrt(np.diag(covariance))[:4], [40, 40, 20, 20])


CANON: Tags = {
    "make": "Canon",
    "model": "Canon EOS 5D Mark II",
    "focal_mm": 50.0,
    "focal_step_mm": 1.0,
}
PER_MM = (3849.211789 / 25.4, 3908.141962 / 25.4)
"""As this camera states it, of 5616 x 3744 px (photoqas.blogspot.com, October 2016)."""


@pytest.mark.parametrize("size", [(5616, 3744), (3744, 5616), (2808, 1872), (1024, 683)])
def test_the_sensors_resolution_gives_the_focal_length_of_photos_of_any_size(
    size: tuple[int, int],
) -> None:
    """Canon's specification: a sensor of 35.8 mm."""
    original = (5616.0, 3744.0) if size[0] > size[1] else (3744.0, 5616.0)
    given: Tags = {**CANON, "focal_plane_per_mm": PER_MM, "original_px": original}
    camera, messages = assume(size=size, **given)
    expected = 50.0 / 35.8 * max(size)

    assert camera.parameters[0] == pytest.approx(expected, rel=0.03)
    assert camera.parameters[0] == camera.parameters[1]
    assert abs(camera.parameters[0] - expected) < 1.5 * sigma_of(camera)[0]
    assert 0.02 < sigma_of(camera)[0] / camera.parameters[0] < 0.025
    assert "Camera 'Canon EOS 5D Mark II' is assumed" in messages[0].text
    assert "FocalPlaneXResolution in EXIF with 50 mm" in messages[0].text


def test_the_sensors_resolution_goes_before_the_35_mm_equivalent() -> None:
    camera, _ = assume(
        focal_mm=36.0,
        focal_35mm_mm=38.0,
        size=(3600, 2400),
        focal_plane_per_mm=(100.0, 100.0),
        original_px=(3600.0, 2400.0),
    )

    assert camera.parameters[0] == pytest.approx(3600.0)


def test_the_sensors_resolution_keeps_the_tables_distortion() -> None:
    camera, messages = assume(
        make="DJI",
        model="FC220",
        focal_mm=4.73,
        focal_plane_per_mm=(640.0, 640.0),
        original_px=(4000.0, 3000.0),
    )

    assert camera.parameters[0] == pytest.approx(4.73 * 640.0)
    assert camera.parameters[4] == 0.032984
    assert "the distortion of the table of drone cameras" in messages[0].text


def test_a_copy_whose_exif_calls_its_own_size_the_originals_is_told_by_the_equivalent() -> None:
    stated: Tags = {
        **CANON,
        "focal_plane_per_mm": PER_MM,
        "original_px": (1404.0, 936.0),
        "focal_35mm_mm": 50.0,
    }
    camera, messages = assume(size=(1404, 936), **stated)

    assert camera.parameters[0] == pytest.approx(50 / 43.2666 * math.hypot(1404, 936), rel=1e-4)
    assert "FocalPlaneXResolution in EXIF contradicts that" in messages[0].text


@pytest.mark.parametrize(
    "stated",
    [
        {"original_px": (math.nan, math.nan)},  # is the photo a copy?
        {"original_px": (5616.0, 5616.0)},  # a part was cut off
        {"focal_plane_per_mm": (150.0, 75.0)},  # pixels are square
        {"focal_plane_per_mm": (0.15, 0.15)},  # a sensor of 37 m
        {"digital_zoom": 2.0},
    ],
)
def test_a_resolution_that_does_not_fit_the_photo_is_not_used(stated: Tags) -> None:
    given: Tags = {"focal_plane_per_mm": PER_MM, "original_px": (5616.0, 3744.0), **CANON, **stated}
    with pytest.raises(InputError):
        assume(size=(5616, 3744), **given)


# What a survey taught of its camera, in numbers and in words.


VALUE = np.array([2300.0, 2300, 2000, 1500, 0, 0, 0, 0, 0])
PRIOR = np.array([40.0, 40, 20, 20, 0.02, 0.1, 0.006, 0.006, 0.0])


def learnt(value: Floats = VALUE, sigma: Floats = PRIOR, prior: Floats = PRIOR) -> CameraUpdate:
    calibration = Calibration(
        name="c",
        model="brown",
        width_px=4000,
        height_px=3000,
        parameters=VALUE,
        covariance=np.diag(np.square(prior)),
    )
    return compare_cameras(calibration, Estimate(value=value, sigma=sigma))


def changed(at: int, by: float, array: Floats) -> Floats:
    array = array.copy()
    array[at] = by
    return array


def test_what_was_learnt_is_told_by_its_sigmas_and_its_shift() -> None:
    camera = learnt(changed(0, 2340.0, VALUE), changed(0, 10.0, PRIOR))
    (message,) = report_learnt_camera(camera)

    assert (camera.ratio[0], camera.shift[0]) == (0.25, 1.0)
    assert camera.learnt.tolist() == [True, *[False] * 8]
    assert (message.level, message.code) == ("info", "camera-learnt")
    assert ": the focal length 4.0 times as exactly. The results use the better" in message.text
    assert "do not show the image centre and the lens distortion better." in message.text


def test_a_parameter_that_the_calibration_holds_fixed_is_neither() -> None:
    camera = learnt()

    assert np.isnan([camera.ratio[8], camera.shift[8]]).all()
    assert "k3" not in report_learnt_camera(camera)[0].text


def test_where_nothing_was_learnt_it_says_so() -> None:
    (message,) = report_learnt_camera(learnt(sigma=0.95 * PRIOR))

    assert message.code == "camera-not-learnt"
    assert "do not show the focal length, the image centre" in message.text


def test_a_fixed_camera_needs_no_words() -> None:
    assert report_learnt_camera(learnt(prior=np.zeros(9), sigma=np.zeros(9))) == ()


@pytest.mark.parametrize(("shift_px", "count"), [(119.0, 1), (121.0, 2), (-121.0, 2)])
def test_a_survey_that_contradicts_its_calibration_is_a_warning(
    shift_px: float, count: int
) -> None:
    messages = report_learnt_camera(
        learnt(changed(0, 2300 + shift_px, VALUE), changed(0, 10.0, PRIOR))
    )

    assert len(messages) == count
    if count == 2:
        assert (messages[1].level, messages[1].code) == ("warning", "camera-contradicted")
        assert "focal length by 3.0 times its uncertainty" in messages[1].text


def test_a_camera_that_was_only_assumed_is_not_called_a_calibration() -> None:
    camera = learnt(changed(0, 2300 + 121.0, VALUE), changed(0, 10.0, PRIOR))
    refined, contradicted = report_learnt_camera(camera, is_assumed=True)

    assert "better than the program assumed" in refined.text
    assert "calibration" not in refined.text
    assert "than the program assumed (the focal length by 3.0" in contradicted.text
