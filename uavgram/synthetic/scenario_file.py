"""Reader and writer of scenario files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from uavgram.config.strict_yaml import (
    Document,
    Plain,
    format_key_path,
    plain_settings,
    read_yaml,
    yaml_text,
)
from uavgram.config.validation import validate
from uavgram.errors import InputError, suggest_spelling
from uavgram.io.cameras import read_drone_cameras
from uavgram.io.tables.measure import points_fault
from uavgram.model.camera import ORDINARY_EQUIVALENTS_MM, Calibration, CameraTags, DroneCamera
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementRequest
from uavgram.pipeline.cameras import assume_drone_camera, read_camera
from uavgram.stages.camera import assume_camera, find_camera
from uavgram.synthetic.errors import LOST_EXPOSURE_INDEX, USUAL_SECTIONS
from uavgram.synthetic.scenario import CameraSpec, RepeatedSurvey, Scenario
from uavgram.synthetic.survey import ScenarioWorld, find_senseless, simulate

MAX_ITEMS = 2000
"""Limit of the items of all lists of a scenario together."""


def load_scenario(path: str | Path) -> Scenario:
    """Read the scenario of a simulated survey; missing values are the demo's.

    Raises
    ------
    InputError
        Names file, line and key of every mistake.
    """
    return read_scenario_document(path)[0]


def read_scenario_document(path: str | Path) -> tuple[Scenario, Document]:
    """Read a scenario as `load_scenario` does, and return the document with its line numbers."""
    path = Path(path).absolute()
    document = _remove_lost_exposure(_fill_in_usual(read_yaml(path, MAX_ITEMS)))
    scenario = validate(Scenario, document)
    camera = scenario.camera
    if camera.file is not None:
        file = str(path.parent / camera.file)
        scenario = replace(scenario, camera=replace(camera, file=file))
    return scenario, document


def load_repeated(path: str | Path) -> RepeatedSurvey:
    """Read the additions to a repeated real survey.

    Raises
    ------
    InputError
        Names file, line and key of every mistake.
    """
    return validate(RepeatedSurvey, read_yaml(Path(path).absolute(), MAX_ITEMS))


def _remove_lost_exposure(document: Document) -> Document:
    """Return the document without a lost exposure if the flight is too short and none is stated."""
    data = document.data
    flight = data.get("flight") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(flight, dict):
        return document
    errors, photos = data.get("errors", {}), flight.get("photos_per_strip")
    short = isinstance(photos, int) and 2 * photos <= LOST_EXPOSURE_INDEX
    if not short or not isinstance(errors, dict) or "lost_exposure" in errors:
        return document
    return replace(document, data={**data, "errors": {**errors, "lost_exposure": None}})


def _fill_in_usual(document: Document) -> Document:
    """Return the document with the defaults of its class of telemetry filled in."""
    data = document.data
    kind = data.get("telemetry") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(kind, str) or kind not in USUAL_SECTIONS:
        return document
    filled: dict[str, Plain] = dict(data)
    for section, usual in USUAL_SECTIONS[kind].items():
        written = data.get(section, {})
        if isinstance(written, dict):
            own: dict[str, Plain] = {key: list(value) for key, value in usual.items()}
            filled[section] = own | written
    return replace(document, data=filled)


def format_scenario(scenario: Scenario, remark: str = "") -> str:
    """Return the text of a scenario file that reads back as the same scenario.

    Parameters
    ----------
    scenario
        Scenario to write.
    remark
        First line, behind ``#``.
    """
    return (f"# {remark}\n" if remark else "") + yaml_text(plain_settings(scenario))


def read_world(path: Path, seed: int | None = None) -> ScenarioWorld:
    """Read a scenario that can be repeated.

    Parameters
    ----------
    path
        The scenario file.
    seed
        Replaces its own.

    Raises
    ------
    InputError
        Names file, line and key of values that are invalid or make no sense.
    """
    scenario, document = read_scenario_document(path)
    scenario = scenario if seed is None else scenario.replace_seed(seed)
    wrong = [(i, explain_impossible(one)) for i, one in enumerate(scenario.measurements)]
    if any(fault for _, fault in wrong):
        named = [
            (document.line_of(("measurements", i)), f"measurements[{i}]: {fault}")
            for i, fault in wrong
            if fault
        ]
        raise InputError.of_all(document.path, named)
    calibration = read_scenario_camera(path, scenario.camera)
    world = ScenarioWorld(scenario, calibration)
    faults = list(find_senseless(simulate(scenario, calibration, exact=True)))
    if faults:
        placed = [
            (document.line_of(one.key), f"{format_key_path(one.key)}: {one.text}") for one in faults
        ]
        raise InputError.of_all(document.path, placed)
    return world


def explain_impossible(asked: MeasurementRequest) -> str:
    """Return why a measurement is impossible with its points and parameters, or empty."""
    given = dict(asked.parameters)
    missing = [one for one in MEASUREMENT_FORMS[asked.kind].parameters if one not in given]
    fault = points_fault(asked) or (missing and f"needs {' and '.join(missing)}")
    return f"{asked.name!r}: {fault}" if fault else ""


def read_scenario_camera(path: Path, camera: CameraSpec) -> Calibration | None:
    """Return the camera of a file or of a drone; None: the scenario's own numbers.

    Raises
    ------
    InputError
        The file cannot be read, or the drone is unknown.
    """
    if camera.file is not None:
        return read_camera(camera.file).calibration
    if camera.drone is None:
        return None
    by_name = None if camera.focal_mm is not None else assume_drone_camera(camera.drone)
    if by_name is not None:
        return by_name
    known = read_drone_cameras()
    named = CameraTags(path=str(path), width_px=1, height_px=1, model=camera.drone)
    found = find_camera(named, known)
    if found is None:
        sold = {one.comment for one in known if one.make_model in ORDINARY_EQUIVALENTS_MM}
        hint = suggest_spelling(camera.drone, sorted({*sold, *(one.make_model for one in known)}))
        raise InputError(
            path,
            f"camera.drone: the table of drone cameras has no {camera.drone!r}"
            f"{hint and f' ({hint})'}: name it by make and model as its photos do, such as "
            "'dji fc330', or as it is sold, such as 'DJI Mavic 2 Pro', or give camera.file. Drones "
            "of one maker often have the same camera",
        )
    return _make_tabulated_camera(path, camera, _choose_colour_camera(found, known))


def _choose_colour_camera(found: DroneCamera, known: tuple[DroneCamera, ...]) -> DroneCamera:
    """Return, of several cameras of one name, the colour camera with the most pixels."""
    same = [one for one in known if one.make_model == found.make_model and not one.is_thermal]
    return max(same, key=lambda one: one.width_px, default=found)


def _make_tabulated_camera(path: Path, camera: CameraSpec, found: DroneCamera) -> Calibration:
    focal_mm = found.focal_mm if camera.focal_mm is None else camera.focal_mm
    if not focal_mm > 0:
        raise InputError(
            path,
            f"camera.drone: the table of drone cameras does not know the focal length of "
            f"{camera.drone!r}: write camera.focal_mm, the true one (not that of a 35 mm camera)",
        )
    tags = CameraTags(
        path=str(path),
        width_px=found.width_px,
        height_px=found.height_px,
        model=str(camera.drone),
        focal_mm=focal_mm,
    )
    calibration, _ = assume_camera(tags, read_drone_cameras())
    return replace(calibration, name=str(camera.drone))
