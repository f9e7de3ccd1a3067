"""A simulated survey: is its truth true, and is it wrong by as much as it says?"""

from __future__ import annotations

import dataclasses
from collections import Counter

import cv2
import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementKind, MeasurementRequest
from uavgram.synthetic.accident_scene import ScenePoint
from uavgram.synthetic.errors import ErrorSpec
from uavgram.synthetic.flight import draw_gauss_markov
from uavgram.synthetic.quantities import compute_true_values
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.survey import SimulatedSurvey, simulate

FAULTLESS = ErrorSpec(
    position_bias_m=(0.0, 0.0),
    position_drift_m=(0.0, 0.0),
    attitude_deg=0.0,
    heading_deg=0.0,
    heading_bias_deg=0.0,
    gimbal_deg=0.0,
    boresight_deg=0.0,
    lever_arm_m=(0.5, -0.3, 0.2),
    lever_arm_sigma_m=0.0,
    exif_jitter_s=0.0,
    event_jitter_s=0.0,
)


@pytest.fixture(scope="module")
def survey() -> SimulatedSurvey:
    return simulate(Scenario())


def logged_poses(survey: SimulatedSurvey) -> tuple[Floats, Rotation, Rotation]:
    """Camera poses from the log alone, by scipy and PROJ: nothing of ours but the names."""
    log = survey.log
    events = log.event_time_s[survey.event_has_photo]

    def at(times: Floats, columns: Floats) -> Floats:
        return np.stack([np.interp(events, times, c) for c in columns.T], axis=1)

    geodetic = at(log.position_time_s, log.position_geodetic)
    n = log.undulation_m
    latitude, longitude, height = log.home_geodetic.tolist()
    to_enu = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={latitude!r} +lon_0={longitude!r} +h_0={height + n!r}"
    )
    position = np.stack(
        to_enu.transform(geodetic[:, 1], geodetic[:, 0], geodetic[:, 2] + n), axis=1
    )
    roll, pitch, yaw = at(log.attitude_time_s, log.attitude_rpy_rad).T
    gimbal_roll, gimbal_pitch, gimbal_yaw = at(log.gimbal_time_s, log.gimbal_rpy_rad).T
    enu_from_ned = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    body = enu_from_ned * Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    gimbal = enu_from_ned * Rotation.from_euler(
        "ZYX", np.stack([yaw + gimbal_yaw, gimbal_pitch, gimbal_roll], axis=1)
    )
    camera_axes = Rotation.from_matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    return position, body, gimbal * camera_axes


def test_the_same_scenario_gives_the_same_survey_and_another_seed_another(
    survey: SimulatedSurvey,
) -> None:
    again = simulate(Scenario())
    assert np.array_equal(again.picks.pixel_px, survey.picks.pixel_px)
    assert np.array_equal(again.log.gimbal_rpy_rad, survey.log.gimbal_rpy_rad)
    other = simulate(Scenario().with_seed(1))
    assert not np.allclose(other.truth.boresight_rad, survey.truth.boresight_rad)


@pytest.mark.parametrize("seed", [Scenario().seed, 1, 2])
def test_every_point_is_seen_in_three_photos_or_more(seed: int) -> None:
    survey = simulate(Scenario().with_seed(seed))
    seen = Counter(survey.picks.label)
    assert set(seen) == set(survey.truth.label)
    assert min(seen.values()) >= 3


def test_a_log_without_errors_leads_to_the_true_poses() -> None:
    survey = simulate(dataclasses.replace(Scenario(), errors=FAULTLESS))
    position, body, camera = logged_poses(survey)
    center = position + body.apply([0.5, -0.3, 0.2])
    # What remains is the log's 10 Hz between the rows.
    assert np.abs(center - survey.truth.center_world_m).max() < 0.01
    turn = camera.inv() * Rotation.from_matrix(survey.truth.world_from_camera.copy())
    assert np.rad2deg(turn.magnitude()).max() < 0.1


def test_each_shared_error_is_in_the_log_with_its_sign() -> None:
    errors = dataclasses.replace(
        FAULTLESS, position_bias_m=(3.0, 3.0), heading_bias_deg=8.0, boresight_deg=2.0
    )
    survey = simulate(dataclasses.replace(Scenario(), errors=errors))
    truth = survey.truth
    position, body, camera = logged_poses(survey)
    # Heading too large by the bias (clockwise): the truth is turned back, counterclockwise.
    back = Rotation.from_rotvec([0.0, 0.0, truth.heading_bias_rad])
    center = position - truth.position_bias_m + (back * body).apply([0.5, -0.3, 0.2])
    assert np.abs(center - truth.center_world_m).max() < 0.01
    refined = back * camera * Rotation.from_rotvec(truth.boresight_rad.copy())
    turn = refined.inv() * Rotation.from_matrix(truth.world_from_camera.copy())
    assert np.rad2deg(turn.magnitude()).max() < 0.1


def test_picks_are_opencv_projections_with_the_stated_noise(survey: SimulatedSurvey) -> None:
    truth, picks = survey.truth, survey.picks
    k = truth.intrinsics
    matrix = np.array([[k[0], 0, k[2]], [0, k[1], k[3]], [0, 0, 1]])
    residual = []
    for image, label, pixel in zip(picks.image, picks.label, picks.pixel_px, strict=True):
        i, j = truth.frame_id.index(image), truth.label.index(label)
        camera_from_world = truth.world_from_camera[i].T
        expected, _ = cv2.projectPoints(
            truth.point_world_m[j],
            cv2.Rodrigues(camera_from_world)[0],
            -camera_from_world @ truth.center_world_m[i],
            matrix,
            k[4:],
        )
        residual.append((pixel - expected.ravel()) / survey.scenario.errors.pick_px)
    whole = np.array(residual)
    low, high = chi2.interval(0.9999, whole.size)
    assert low < np.sum(whole**2) < high
    assert np.abs(whole).max() < 5


def test_the_scene_lies_on_the_plane_that_truth_states(survey: SimulatedSurvey) -> None:
    truth = survey.truth
    plane = (
        truth.surface.height_m
        + (truth.point_world_m[:, :2] - truth.surface.middle_m) @ truth.surface.slope
    )
    np.testing.assert_allclose(truth.point_world_m[:, 2], plane, atol=1e-12)


def test_the_cameras_look_down_and_ahead_with_image_up_along_the_flight(
    survey: SimulatedSurvey,
) -> None:
    optical_axis = survey.truth.world_from_camera[:, :, 2]
    down_deg = np.rad2deg(np.arccos(-optical_axis[:, 2]))
    assert np.all((down_deg > 5) & (down_deg < 15))
    image_up = -survey.truth.world_from_camera[:, :, 1]
    azimuth = np.rad2deg(np.arctan2(image_up[:, 0], image_up[:, 1]))
    off = (azimuth - survey.scenario.site.road_azimuth_deg + 90) % 180 - 90
    assert np.abs(off).max() < 8


def test_photo_times_carry_the_clock_offset_and_one_exposure_has_no_photo(
    survey: SimulatedSurvey,
) -> None:
    offset = survey.file_time_utc_s - survey.truth.time_utc_s
    assert np.abs(offset - 2.6).max() < 0.05
    assert len(survey.log.event_time_s) == len(survey.frame_id) + 1
    assert np.flatnonzero(~survey.event_has_photo).tolist() == [9]
    events = survey.log.boot_utc_s + survey.log.event_time_s[survey.event_has_photo]
    assert np.abs(events - survey.truth.time_utc_s).max() < 0.03


def test_tapes_are_wrong_by_centimetres_and_one_is_withheld(survey: SimulatedSurvey) -> None:
    error = survey.lines.length_m - survey.truth.line_length_m
    assert 1e-4 < np.abs(error).max() < 0.05
    assert survey.lines.adjust.tolist() == [True] * 5 + [False]


def test_gauss_markov_noise_has_its_sigma_and_its_memory() -> None:
    noise = draw_gauss_markov(np.random.default_rng(3), 400_000, 0.1, 2.0, np.array([0.5, 3.0]))
    np.testing.assert_allclose(noise.std(axis=0), [0.5, 3.0], rtol=0.03)
    steps = 20  # one time constant
    correlation = [np.corrcoef(c[:-steps], c[steps:])[0, 1] for c in noise.T]
    np.testing.assert_allclose(correlation, np.exp(-1), atol=0.03)
    starts = [
        draw_gauss_markov(np.random.default_rng(i), 2, 0.1, 2.0, np.array([1.0]))[0, 0]
        for i in range(2000)
    ]
    assert np.std(starts) == pytest.approx(1.0, rel=0.06)  # stationary from the first sample on


def test_true_values_of_measurements_are_those_of_known_figures() -> None:
    rows = {"a": 0, "b": 1, "c": 2, "d": 3}
    points = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]])
    requests = (
        MeasurementRequest(name="diagonal", kind="distance", points=("a", "c")),
        MeasurementRequest(name="path", kind="polyline", points=("a", "b", "c")),
        MeasurementRequest(name="field", kind="area", points=("a", "b", "c", "d")),
        MeasurementRequest(name="corner", kind="angle", points=("a", "b", "c")),
        MeasurementRequest(name="beside", kind="line_distance", points=("b", "a", "c")),
        MeasurementRequest(
            name="v", kind="skid_speed", points=("a", "b"), parameters=(("mu", 0.5),)
        ),
        MeasurementRequest(name="place", kind="coordinate", points=("c",)),
    )
    names, values, units = compute_true_values(requests, rows, points)
    expected = [5.0, 7.0, 12.0, 90.0, 2.4, np.sqrt(3 * 9.80665), 3.0, 4.0]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    assert names[-2:] == ("place east", "place north")
    assert units == ("m", "m", "m2", "deg", "m", "m/s", "m", "m")


def test_true_heights_slopes_and_volumes_are_those_of_known_figures() -> None:
    rows = {label: i for i, label in enumerate("abcdefgh")}
    base = [[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]]
    points = np.array([*base, [1, 1, 6], [1, 1, 9], [4, 5, 6], [4, 1, 6]])

    def ask(kind: MeasurementKind, labels: str, **parameters: float) -> MeasurementRequest:
        return MeasurementRequest(
            name=kind, kind=kind, points=tuple(labels), parameters=tuple(parameters.items())
        )

    requests = (
        ask("height", "ae"),
        ask("height", "e"),
        ask("vertical_distance", "fe"),
        ask("horizontal_distance", "eg"),
        ask("slope", "ag"),
        ask("plane_distance", "eabc"),
        ask("plane_distance", "eacb"),
        ask("profile", "abg"),
        ask("volume", "abcd"),
        ask("volume", "abcd", level=-2.0),
        ask("volume", "abcde", level=0.0, top=1.0),  # a pyramid
        ask("volume", "abcdegh", plane=1.0),  # below z = 6
    )
    _, values, units = compute_true_values(requests, rows, points)
    slope = np.degrees(np.arctan2(6, np.hypot(4, 5)))
    expected = [6, 0, -3, 5, slope, 6, -6, np.hypot(4, 5), 0, 24, 24, -72]
    np.testing.assert_allclose(values, expected, atol=1e-12)
    assert units == (*"mmmm", "deg", *"mmm", *["m3"] * 4)


def test_a_scenario_that_contradicts_itself_is_refused() -> None:
    point = ScenePoint(label="A", x_m=0.0, y_m=0.0)
    with pytest.raises(ValueError, match="labels given twice: A"):
        Scenario(points=(point, point), lines=(), measurements=())
    with pytest.raises(ValueError, match="unknown points"):
        Scenario(points=(point,))


def test_the_road_is_as_slippery_as_it_is_and_not_as_people_state_it() -> None:
    def true_mu(seed: int) -> float:
        truth = simulate(Scenario().with_seed(seed)).truth
        values = dict(zip(truth.measurement_name, truth.measurement_value, strict=True))
        return float(values["speed from skid"] ** 2 / (2 * 9.80665 * values["skid left"]))

    z = (np.array([true_mu(seed) for seed in range(20)]) - 0.7) / 0.05
    low, high = chi2.interval(0.999, len(z))
    assert low < np.sum(z**2) < high


def test_the_road_leads_where_the_site_says_and_left_is_left(survey: SimulatedSurvey) -> None:
    position = dict(zip(survey.truth.label, survey.truth.point_world_m, strict=True))
    east, north, _ = position["R4"] - position["R1"]  # both at y = 5.4
    assert np.rad2deg(np.arctan2(east, north)) == pytest.approx(62.0)
    along = np.array([east, north, 0.0]) / np.hypot(east, north)
    to_left = position["R4"] - position["R8"]
    assert np.cross(along, to_left)[2] > 0


def test_the_vehicle_flies_nose_first(survey: SimulatedSurvey) -> None:
    log = survey.log
    speed = np.hypot(*log.velocity_ned_m_s[:, :2].T)
    first, last = log.event_time_s[[0, 5]]
    rows = (log.position_time_s > first) & (log.position_time_s < last) & (speed > 2)
    course = np.arctan2(log.velocity_ned_m_s[rows, 1], log.velocity_ned_m_s[rows, 0])
    yaw = np.interp(log.position_time_s[rows], log.attitude_time_s, log.attitude_rpy_rad[:, 2])
    assert np.abs(np.rad2deg(course - yaw)).max() < 12
