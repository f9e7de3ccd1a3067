"""Simulated surveys through the real pipeline: reproducible, and honest in a world as modelled."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from uavgram.errors import InputError
from uavgram.model.simulation import Repetitions
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.parallel import run_in_processes
from uavgram.synthetic.autopilot import draw_biases
from uavgram.synthetic.files import write_demo
from uavgram.synthetic.inputs import ScenarioWorld, make_inputs, make_project
from uavgram.synthetic.resurvey import read_project_world
from uavgram.synthetic.scenario import PlateSpec, Scenario
from uavgram.synthetic.scenario_file import read_world
from uavgram.synthetic.simulate import (
    SimulationRequest,
    apply_stated_sigmas,
    find_unlike_stated,
    gather_repetitions,
    list_variants,
    predict_sigmas,
    run_repetition,
    simulate_many,
    write_outputs,
)
from uavgram.synthetic.survey import simulate
from uavgram.views.simulation import render_simulation_page, simulation_lines


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
    assert page.count('<br><span class="within">(') == 4 * len(found.repetitions.name)


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


def test_what_is_drawn_otherwise_than_stated_is_told_and_can_be_drawn_as_stated() -> None:
    demo = Scenario()
    # By hand from configs/demo.yaml: position 1.2 and 1.5 m against 2 and 3 m.
    told = {one.key: one for one in find_unlike_stated(demo)}
    assert told["errors.position_bias_m"].drawn == (1.2, 1.5)
    assert told["errors.position_bias_m"].stated == (2.0, 3.0)
    assert "errors.pick_px" not in told
    as_told = apply_stated_sigmas(demo)
    assert find_unlike_stated(as_told) == ()
    biases = [draw_biases(as_told, np.random.default_rng(k)).position_m for k in range(400)]
    spread = np.std(biases, axis=0)
    assert spread == pytest.approx([2.0, 2.0, 3.0], rel=0.15)
    # Without a log nothing of it is asked.
    alone = replace(demo, telemetry="none")
    assert [one.key for one in find_unlike_stated(alone)] == ["errors.tape_scale"]
