"""A simulated survey: is its truth true, and is it wrong by as much as it says?"""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import cv2
import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.errors import InputError
from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementKind, MeasurementRequest
from uavgram.model.simulation import Repetitions
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.parallel import run_in_processes
from uavgram.synthetic.accident_scene import ScenePoint
from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.errors import ErrorSpec
from uavgram.synthetic.flight import draw_gauss_markov
from uavgram.synthetic.resurvey import read_project_world
from uavgram.synthetic.scenario import PlateSpec, Scenario
from uavgram.synthetic.scenario_file import read_world
from uavgram.synthetic.simulate import (
    SimulationRequest,
    find_unlike_stated,
    gather_repetitions,
    list_variants,
    predict_sigmas,
    run_repetition,
    simulate_many,
    write_outputs,
)
from uavgram.synthetic.survey import (
    ScenarioWorld,
    SimulatedSurvey,
    make_inputs,
    make_project,
    simulate,
)
from uavgram.synthetic.truth import compute_true_values
from uavgram.views.simulation import render_simulation_page, simulation_lines

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
    other = simulate(Scenario().replace_seed(1))
    assert not np.allclose(other.truth.boresight_rad, survey.truth.boresight_rad)


@pytest.mark.parametrize("seed", [Scenario().seed, 1, 2])
def test_every_point_is_seen_in_three_photos_or_more(seed: int) -> None:
    survey = simulate(Scenario().replace_seed(seed))
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
        truth = simulate(Scenario().replace_seed(seed)).truth
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


# Simulated surveys through the real pipeline: reproducible, and honest in a world as modelled.


@pytest.fixture(scope="module")
def single(repository: Path) -> ScenarioWorld:
    return read_world(repository / "configs" / "single_photo.yaml")


@pytest.fixture(scope="module")
def repeated(single: ScenarioWorld) -> Repetitions:
    name, unit, sigma = predict_sigmas(single)
    return gather_repetitions([run_repetition(single, k) for k in range(24)], name, unit, sigma)


def test_where_the_world_is_the_model_errors_are_as_predicted(repeated: Repetitions) -> None:
    assert repeated.failed == 0
    assert repeated.unsettled == 0
    error = (repeated.value - repeated.true) / repeated.predicted
    # The three measurements go together: each is held against chi-square by itself.
    for total in (error**2).sum(axis=0):
        assert chi2.ppf(1e-4, len(error)) < total < chi2.isf(1e-4, len(error))


def test_sigmas_are_those_that_were_predicted(repeated: Repetitions) -> None:
    ratio = np.sqrt((repeated.sigma**2).mean(axis=0)) / repeated.predicted
    assert (np.abs(ratio - 1.0) < 0.05).all()


def test_a_repetition_is_reproducible(single: ScenarioWorld, repeated: Repetitions) -> None:
    again = run_repetition(single, 7)
    assert again.value == tuple(repeated.value[7].tolist())
    other = run_repetition(single, 8)
    assert other.value != again.value


def test_more_repetitions_of_a_blunder_are_told_from_none(single: ScenarioWorld) -> None:
    """The same draws with a tape 2 % long: every error grows by 2 % of its length."""
    habits = replace(single.scenario.habits, tape_long=0.02)
    long = ScenarioWorld(replace(single.scenario, habits=habits))
    clean, wrong = (run_repetition(world, 3) for world in (single, long))
    for name, before, after in zip(
        ("P to Q", "Q to R"), clean.value[:2], wrong.value[:2], strict=True
    ):
        assert after / before == pytest.approx(1.02, abs=2e-3), name


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built-in survey in files, its photos being grey."""
    survey = simulate(Scenario())
    size = survey.calibration.height_px, survey.calibration.width_px, 3
    grey = np.full(size, 128, dtype=np.uint8)
    return write_demo(tmp_path_factory.mktemp("survey"), survey, repeat(grey, 13))


def test_in_memory_is_what_the_files_say(project: Path) -> None:
    inputs = read_inputs(project)
    of_files = compute(inputs, curved=False).result
    of_memory = compute(make_inputs(simulate(Scenario())), curved=False).result
    own = make_project(Scenario())
    for section in ("ground", "mount", "time", "telemetry", "solve", "tape", "picks_sigma_px"):
        assert getattr(inputs.project, section) == getattr(own, section), section
    # Files round to a thousandth of a pixel and to a tenth of a millimetre.
    off = (of_files.measurements.value - of_memory.measurements.value) / of_files.measurements.sigma
    assert np.abs(off).max() < 0.05
    assert of_memory.measurements.sigma == pytest.approx(of_files.measurements.sigma, rel=0.01)


def test_files_of_another_scenario_say_what_it_states(tmp_path: Path, repository: Path) -> None:
    """Of one photo without a log; and of a flight with control, heights and other sigmas."""
    one = read_world(repository / "configs" / "single_photo.yaml").scenario
    other = replace(
        Scenario(),
        control=("R1", "R8"),
        stated=replace(Scenario().stated, position_sigma_m=(0.5, 0.8), outliers="remove"),
        points=tuple(
            replace(point, height_m=0.4) if point.label == "P1" else point
            for point in Scenario().points
        ),
    )
    for name, scenario in (("one", one), ("other", other)):
        survey = simulate(scenario)
        size = survey.calibration.height_px, survey.calibration.width_px, 3
        grey = np.full(size, 128, dtype=np.uint8)
        path = write_demo(tmp_path / name, survey, repeat(grey, len(survey.frame_id)))
        inputs, memory = read_inputs(path), make_inputs(survey)
        for section in ("ground", "mount", "time", "telemetry", "solve", "tape"):
            own = getattr(memory.project, section)
            assert getattr(inputs.project, section) == own, (name, section)
        assert (inputs.log is None) == (memory.log is None)
        assert inputs.control.label == memory.control.label
        assert np.allclose(inputs.picks.height_m, memory.picks.height_m, equal_nan=True)


def test_files_of_a_scenario_with_plates_have_them_as_found(tmp_path: Path) -> None:
    """Where corners are, and what the project says of the plates."""
    plates = PlateSpec(side_m=0.5, at=((-10.0, -8.5, 20.0),))
    flight = replace(Scenario().flight, pattern="single")
    survey = simulate(replace(Scenario(), plates=plates, flight=flight))
    blank = [np.zeros((1500, 2000, 3), np.uint8)]
    inputs = read_inputs(write_demo(tmp_path, survey, blank))
    memory = make_inputs(survey)
    assert inputs.project.targets == memory.project.targets is not None
    assert inputs.picks.source == memory.picks.source
    assert set(inputs.picks.source) == {"hand", "target"}


def test_a_real_survey_is_repeated_and_one_more_length_helps(project: Path, tmp_path: Path) -> None:
    world = read_project_world(project, None, 4)
    row = run_repetition(world, 0)
    assert row.failure == ""
    ratio = (np.array(row.value) - np.array(row.true)) / np.array(row.sigma)
    assert np.abs(ratio).max() < 5.0
    more = tmp_path / "more.yaml"
    more.write_text("lines: [{name: new, start: P5, end: P7}]\n", encoding="utf-8")
    name, _, before = predict_sigmas(world)
    _, _, after = predict_sigmas(read_project_world(project, more, 4))
    at = name.index("car to car")
    # The new tape lies along it: its centimetre beside what was known, but for the scale, 0.1 %,
    # which all lengths of the tape have in common.
    scale = 0.001 * world.value[at]
    own = 1.0 / (1.0 / (before[at] ** 2 - scale**2) + 1.0 / 0.01**2)
    assert after[at] == pytest.approx(np.hypot(np.sqrt(own), scale), rel=0.02)
    assert (after <= before * (1 + 1e-6)).all()
    more.write_text("lines: [{name: new, start: P5, end: Z7}]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"more.yaml: .*'Z7'"):
        read_project_world(project, more, 4)


def test_outputs_say_the_same(single: ScenarioWorld, tmp_path: Path) -> None:
    heard: list[str] = []
    source = tmp_path / "one.yaml"
    source.write_text("name: one\n", encoding="utf-8")
    found = simulate_many(source, single, SimulationRequest(3), heard=heard.append)
    files = write_outputs(found, tmp_path / "out", source)
    content = json.loads((tmp_path / "out" / files[0]).read_text(encoding="utf-8"))
    assert content["repetitions"] == 3
    assert content["measurements"][0]["predicted_sigma"] == found.repetitions.predicted[0]
    assert content["draws"]["value"] == found.repetitions.value.tolist()
    page = (tmp_path / "out" / files[1]).read_text(encoding="utf-8")
    assert all(name in page for name in found.repetitions.name)
    assert "http" not in page.replace("http-equiv", "")
    assert content["amiss"] == []
    assert "does not state" not in page
    worn = replace(found, deviations=("ground.crown_percent",))
    for told in ("\n".join(simulation_lines(worn)), render_simulation_page(worn)):
        assert "does not state: the road has a crown (ground.crown_percent). The ± may" in told
    # ranges stand below their values, or the table is wider than the page
    assert page.count('<span class="sub">(') == 4 * len(found.repetitions.name)


def test_what_is_amiss_is_taken_apart(repository: Path) -> None:
    scenario = read_world(repository / "configs" / "worn_road.yaml").scenario
    apart = dict(list_variants(scenario))
    assert list(apart) == [
        "nothing amiss",
        "ground.crown_percent",
        "errors.readout_ms",
        "errors.identification_m",
        "habits.tape_long",
        "habits.wrong_lengths",
    ]
    clean = apart["nothing amiss"]
    assert clean.habits.names() == ()
    assert apart["errors.readout_ms"].errors.readout_ms == 30.0
    assert not list(list_variants(clean))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("flight: {height_m: 0.2}\n", "flight.height_m: .*ground"),
        (
            "flight: {pattern: poses, poses: [{x_m: 0, y_m: 0, height_m: -3}]}\n",
            "height_m: .*below",
        ),
        ("flight: {pattern: orbit, radius_m: 300}\n", "flight.radius_m: .*horizon"),
        ("flight: {pattern: single}\nlines: [{name: L1, start: R1, end: R8}]\n", "lines: no line"),
        ("flight: {pattern: single}\ntelemetry: none\n", "not even without errors: .*lengths"),
        ("site: {scene_east_m: 26}\nflight: {hight_m: 3}\n", "2: flight.hight_m: unknown key"),
        ("camera: {drone: dji fc33}\n", "camera.drone: .*djiFC330"),
        ("camera: {drone: dji fc6310s}\n", "focal_mm"),
        ("measurements: []\n", "measurements: .*nothing to repeat"),
        (
            "measurements: [{name: a, kind: distance, points: [P1, P2, P3]}]\n",
            r"1: measurements\[0\]: 'a': a measurement of kind distance needs 2 labels",
        ),
        (  # too small to be found
            "telemetry: none\nlines: []\nflight: {pattern: single}\n"
            "plates: {side_m: 0.2, at: [[0, 0, 0]]}\n",
            "telemetry: .*no length, plate",
        ),
    ],
)
def test_senseless_scenarios_are_refused_by_key(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"(?s)scenario.yaml.*{named}"):
        simulate_many(path, read_world(path), SimulationRequest(2))


def test_a_drone_of_the_table_is_a_camera(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    text = "camera: {drone: dji fc330, focal_mm: 3.61}\n"
    path.write_text(text, encoding="utf-8")
    calibration = read_world(path).calibration
    assert calibration is not None
    # A Phantom 4 covers 4000 px of a sensor 6.3 mm wide.
    assert calibration.parameters[0] == pytest.approx(3.61 / 6.32 * calibration.width_px, rel=0.02)


def test_work_that_cannot_be_sent_is_an_error_at_once() -> None:
    with pytest.raises((AttributeError, TypeError), match="pickle"):
        list(run_in_processes(lambda item: item, range(20)))


def test_results_come_in_order() -> None:
    squares = [4.0, 9.0, 16.0, 25.0, 36.0]
    assert list(run_in_processes(math.sqrt, squares)) == [2.0, 3.0, 4.0, 5.0, 6.0]


def test_what_is_drawn_otherwise_than_stated_is_told() -> None:
    demo = Scenario()
    # By hand from configs/demo.yaml: position 1.2 and 1.5 m against 2 and 3 m.
    told = {one.key: one for one in find_unlike_stated(demo)}
    assert told["errors.position_bias_m"].drawn == (1.2, 1.5)
    assert told["errors.position_bias_m"].stated == (2.0, 3.0)
    assert "errors.pick_px" not in told
    bias = replace(demo.errors, position_bias_m=(2.0, 3.0))
    left = find_unlike_stated(replace(demo, errors=bias))
    assert {one.key for one in left} == set(told) - {"errors.position_bias_m"}
    # Without a log nothing of it is asked.
    alone = replace(demo, telemetry="none")
    assert [one.key for one in find_unlike_stated(alone)] == ["errors.tape_scale"]
