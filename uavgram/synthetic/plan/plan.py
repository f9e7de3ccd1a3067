"""Plan of a scene, with messages to read before flying, its files and its flown scenario."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from uavgram.errors import GeometryError, InputError
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.io.exports.geojson_kml import write_kml, write_layers_geojson
from uavgram.io.exports.missions import qgc_plan_text, waypoints_text
from uavgram.io.outputs import convert_output_errors, replace_bytes, replace_text, stage_output
from uavgram.io.results.command_json import write_plan
from uavgram.model.arrays import Floats
from uavgram.model.maps import Autopilot, HeightFrame, Paper
from uavgram.model.message import Message
from uavgram.model.naming import METRIC, Units, format_digits
from uavgram.model.planned import (
    Assumptions,
    FlightFacts,
    FlightPlanned,
    PlannedFrames,
    PlannedLines,
    PlannedMeasurements,
    PlannedPlates,
    PlannedPoints,
    PlannedSite,
)
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.products.planned_layers import flight_mission, plan_layers
from uavgram.synthetic.accident_scene import SceneLine, ScenePoint
from uavgram.synthetic.plan import accuracy
from uavgram.synthetic.plan.flights import compute_footprints, find_covering_flights
from uavgram.synthetic.plan.scene import Asked, PlanScene, list_wanted, read_scene
from uavgram.synthetic.plan.survey import predict_values
from uavgram.synthetic.scenario import FlightPlan, Scenario, Site, Station
from uavgram.synthetic.scenario_file import format_scenario, read_scenario_document
from uavgram.views.field_sheet import NAME as SHEET
from uavgram.views.field_sheet import field_sheet, field_sheet_pdf
from uavgram.views.flight_plan_recording import write_plan_recording
from uavgram.views.pages import weasyprint_for
from uavgram.views.style import LOOKS

GROSS_ERROR_M = 0.3
"""Gross error of a tape reading that people do make: a slipped decimetre mark or three."""

MIN_GAIN = 0.1
"""Smallest relative reduction of the sigmas for which reference lines are worth the work."""


MIN_ROBUST_LINES = 3
"""Number of lines below which the tilt of a single photo depends on its log.

Over the sigmas of the log, lengths are so nonlinear in the tilt that errors of simulated surveys
were 1.0 to 1.3 times the first-order prediction with one line, and 0.95 to 1.2 times with two;
second order overshoots there. Neither effect occurs with three lines or more.
"""


def make_no_site_message() -> Message:
    """Return the message for a plan in metres without a geodetic origin."""
    site = Site()
    return Message(
        "warning",
        "plan-nowhere",
        "The place on earth is unknown, so no mission file was written: the maps and the "
        "north of the drawing are of the place of the program's demo "
        f"({site.latitude_deg:.4f}, {site.longitude_deg:.4f}). Write site: {{latitude_deg: ..., "
        "longitude_deg: ..., scene_east_m: 0, scene_north_m: 0, road_azimuth_deg: ...}, where "
        "your [0, 0] is and where the first axis of your metres points, clockwise from north; "
        "or give the area as a GeoJSON or KML file.",
    )


def list_remarks(
    laid: tuple[PlannedLines, PlannedPlates],
    measured: PlannedMeasurements,
    gained: float,
    photos: int,
) -> Iterator[Message]:
    """Iterate over the messages to read before flying.

    Parameters
    ----------
    laid, measured
        Planned references and measurements; there are either lines or plates.
    gained
        Relative reduction of the mean sigma by the references; 1 if undetermined without.
    photos
        Number of photos.
    """
    lines, plates = laid
    if gained < MIN_GAIN and (lines.name or plates.name):
        what, instead = (
            (f"Plates of {plates.side_m:g} m", "larger ones, tape long lines (lay: lines)")
            if plates.name
            else (
                f"The reference lines, the longest {lines.length_m.max():.1f} m,",
                "a longer tape (longest_tape_m), a better log",
            )
        )
        yield Message(
            "warning",
            "plan-lines-useless",
            f"{what} make the measurements only {100 * gained:.0f} % more certain than none. Use "
            f"{instead}, or save the work.",
            lengths=lines.name,
        )
    if photos == 1 and 0 < len(lines.name) < MIN_ROBUST_LINES:
        yield Message(
            "warning",
            "plan-few-lines",
            f"With {len(lines.name)} reference line{'s' * (len(lines.name) > 1)} in a single photo "
            "errors may be up to a third larger than the ± of this plan: the tilt of the camera "
            f"is then known from the log alone. Lay {MIN_ROBUST_LINES} lines or more, or take more "
            "photos.",
            lengths=lines.name,
        )
    short = np.flatnonzero(measured.sigma > 1.0001 * measured.wanted_sigma)
    for i in short:
        yield Message(
            "warning",
            "plan-not-reached",
            f"{measured.name[i]!r} will be known to ± {format_digits(measured.sigma[i], 3)} "
            f"{measured.unit[i]}, "
            f"not to the ± {format_digits(measured.wanted_sigma[i], 3)} {measured.unit[i]} that "
            f"are "
            "wanted, with "
            "any flight and layout that was tried. Allow more lines (most_lines), longer ones "
            "(longest_tape_m), lower heights or more photos (heights_m, frames, patterns), pick "
            "more sharply, or accept it.",
            measurements=(measured.name[i],),
        )
    passes = np.isnan(lines.mdb_m) | (lines.mdb_m > GROSS_ERROR_M)
    if passes.any():
        names = tuple(lines.name[i] for i in np.flatnonzero(passes))
        yield Message(
            "warning",
            "plan-unchecked",
            f"A mistake of {format_digits(GROSS_ERROR_M, 1)} m in the tape reading of "
            f"{', '.join(names)} "
            "would go "
            "unnoticed: the other lines check it too little. Read the tape twice there, tape one "
            "more line, or take more photos.",
            lengths=names,
        )
    for own, kind, more in (
        (lines, "the line", "Tape one more line"),
        (plates, "the plate", "Lay one more plate"),
    ):
        names = tuple(own.name[i] for i in np.flatnonzero(np.isnan(own.mean_sigma_without)))
        if names:
            yield Message(
                "warning",
                "plan-needs-line",
                f"Without {kind} {', '.join(names)} too little fixes the photos for any useful "
                f"measurement. {more}, or write `robust: true` in the plan.",
                lengths=names if own is lines else (),
            )


def make_plan(scenario: Scenario, asked: Asked, progress: Progress = silent) -> FlightPlanned:
    """Choose flight and lines, and predict the accuracy.

    Parameters
    ----------
    scenario
        Its name, its camera and its log's class.
    asked
        Its request, in the world's axes.
    progress
        Shows long loops.

    Raises
    ------
    GeometryError
        No flight shows the area, or no line fits into it.
    """
    scene, request = asked.scene, asked.request
    wanted = list_wanted(scene)
    flown = find_covering_flights(scene, request, wanted)
    choice = accuracy.choose_flight(scene, request, wanted, flown, progress)
    layout = choice.robust_layout if request.robust else choice.layout
    ends = accuracy.list_ends(choice.possible, layout.lines)
    try:
        found = predict_values(scene, choice.flight.cameras, wanted, ends)
    except SingularError as fault:
        raise GeometryError(
            f"with {len(ends)} reference {choice.laid} the positions of the photos are not "
            "determined: allow more (lines), or fly with a log (`telemetry`)"
        ) from fault
    lines = accuracy.list_planned_lines(scene, choice, layout.lines, found)
    plates = accuracy.list_planned_plates(scene, choice, layout.lines)
    shown = scene.requests
    measured = accuracy.list_planned_measurements(request, wanted, found)
    return FlightPlanned(
        name=scenario.name,
        site=PlannedSite(
            latitude_deg=asked.site.latitude_deg,
            longitude_deg=asked.site.longitude_deg,
            height_msl_m=asked.site.height_msl_m,
            undulation_m=asked.site.undulation_m,
            ground_height_m=scene.height_m,
        ),
        camera=scene.calibration,
        drone=scenario.camera.drone or "",
        area_world_m=scene.on_ground(scene.area_m),
        no_go_world_m=tuple(scene.on_ground(polygon) for polygon in scene.no_go_m),
        flight=_facts(asked, choice),
        assumptions=Assumptions(
            telemetry=scenario.telemetry,
            pick_sigma_px=scene.picks_sigma_px,
            tape_sigma_m=scene.tape_sigma_m,
            tape_scale_sigma=scene.tape.scale_sigma,
            roughness_m=request.roughness_m,
            deviation_m=request.deviation_m,
            deviation_deg=request.deviation_deg,
        ),
        frames=_frames(scene, choice),
        lines=lines,
        plates=plates,
        points=PlannedPoints(label=scene.label, world_m=scene.on_ground(scene.point_m)),
        measurements=measured if shown else _nothing(),
        grid=accuracy.map_accuracy(scene, choice, layout.lines),
        mean_sigma=accuracy.compute_mean_sigma(found),
        chosen_by=accuracy.get_criterion_name(choice.possible),
        gains=tuple(accuracy.list_gains(scene, request, wanted, choice, layout.lines)),
        messages=(
            *((make_no_site_message(),) if has_no_site(asked) else ()),
            *list_remarks(
                (lines, plates),
                measured,
                accuracy.compute_gain(choice.possible, layout.lines),
                len(choice.flight.cameras.center_m),
            ),
        ),
    )


def has_no_site(asked: Asked) -> bool:
    """Return whether the area is in metres from an unspecified origin."""
    own, usual = asked.site, Site()
    named = (own.latitude_deg, own.longitude_deg) != (usual.latitude_deg, usual.longitude_deg)
    return not named and not isinstance(asked.request.area, str)


def _facts(asked: Asked, choice: accuracy.Choice) -> FlightFacts:
    flown, request = choice.flight, asked.request
    slant = flown.height_m / max(np.sin(np.deg2rad(-flown.pitch_deg)), 0.1)
    return FlightFacts(
        pattern=flown.pattern,
        height_m=flown.height_m,
        gimbal_pitch_deg=flown.pitch_deg,
        speed_m_s=request.speed_m_s,
        seconds_per_photo=request.seconds_per_photo,
        path_m=flown.path_m,
        duration_s=flown.duration_s,
        battery_s=60.0 * request.battery_min,
        max_height_m=request.max_height_m,
        ground_sample_m=float(slant / asked.scene.calibration.parameters[0]),
    )


def _frames(scene: PlanScene, choice: accuracy.Choice) -> PlannedFrames:
    cameras = choice.flight.cameras
    whole, certain = compute_footprints(scene, cameras)
    ground = scene.on_ground(cameras.center_m[:, :2])[:, 2]
    return PlannedFrames(
        name=tuple(f"P{i + 1}" for i in range(len(ground))),
        center_world_m=cameras.center_m,
        world_from_camera=cameras.world_from_camera,
        heading_deg=cameras.heading_deg,
        gimbal_pitch_deg=cameras.pitch_deg,
        height_above_ground_m=cameras.center_m[:, 2] - ground,
        footprint_world_m=whole,
        safe_footprint_world_m=certain,
    )


def _nothing() -> PlannedMeasurements:
    empty: Floats = np.zeros(0)
    return PlannedMeasurements(
        name=(), kind=(), unit=(), points=(), value=empty, sigma=empty, wanted_sigma=empty
    )


def make_flown_scenario(scenario: Scenario, asked: Asked, planned: FlightPlanned) -> Scenario:
    """Return the scenario in which a plan is carried out exactly.

    Parameters
    ----------
    scenario
        Scenario of the plan: camera, log, errors.
    asked
        Its request.
    planned
        Photos and lines.
    """
    site, lines = asked.site, planned.lines
    wanted = list_wanted(asked.scene)
    labels = (*wanted.label, *lines.start_label, *lines.end_label)
    ends = np.concatenate([lines.start_world_m, lines.end_world_m])[:, :2]
    xy = site.in_scene(np.concatenate([wanted.point_m, ends]))
    return replace(
        scenario,
        name=f"{scenario.name} as planned",
        site=site,
        flight=replace(
            FlightPlan(),
            pattern="poses",
            height_m=planned.flight.height_m + asked.scene.height_m,
            speed_m_s=planned.flight.speed_m_s,
            poses=_stations(site, planned),
        ),
        stated=replace(scenario.stated, roughness_sigma_m=planned.assumptions.roughness_m),
        habits=replace(scenario.habits, raised=(), swapped=(), wrong_lengths=()),
        points=tuple(
            ScenePoint(label=label, x_m=float(x), y_m=float(y))
            for label, (x, y) in zip(labels, xy, strict=True)
        ),
        lines=tuple(
            SceneLine(name=name, start=start, end=end)
            for name, start, end in zip(lines.name, lines.start_label, lines.end_label, strict=True)
        ),
        plates=replace(scenario.plates, at=_plates(site, planned)),
        control=(),
        measurements=wanted.requests,
        plan=None,
    )


def _plates(site: Site, planned: FlightPlanned) -> tuple[tuple[float, float, float], ...]:
    plates = planned.plates
    xy = site.in_scene(plates.center_world_m[:, :2])
    side = plates.corner_world_m[:, 1] - plates.corner_world_m[:, 0]
    turn = np.rad2deg(np.arctan2(side[:, 1], side[:, 0])) + site.road_azimuth_deg - 90.0
    return tuple(zip(*xy.T.tolist(), turn.tolist(), strict=True)) if len(xy) else ()


def _stations(site: Site, planned: FlightPlanned) -> tuple[Station, ...]:
    frames = planned.frames
    xy = site.in_scene(frames.center_world_m[:, :2])
    return tuple(
        Station(
            x_m=float(xy[i, 0]),
            y_m=float(xy[i, 1]),
            height_m=float(frames.center_world_m[i, 2]),
            heading_deg=float(site.road_azimuth_deg - frames.heading_deg[i]),
            pitch_deg=float(frames.gimbal_pitch_deg[i]),
        )
        for i in range(len(xy))
    )


PLAN_FILE, SHEET_FILE = "plan.json", f"{SHEET}.html"
MISSION_FILES = {"mission.waypoints", "mission.plan"}


@dataclass(frozen=True, kw_only=True)
class PlanOutputs:
    """Options for the files of a plan.

    Attributes
    ----------
    units
        Of the sheet and of the recording.
    pdf
        Paper of field_sheet.pdf; None: there is none.
    autopilot, heights
        Autopilot whose commands are used in the missions, and reference of their heights. Only
        ArduPilot has mission.waypoints.
    """

    units: Units = METRIC
    pdf: Paper | None = None
    autopilot: Autopilot = "ardupilot"
    heights: HeightFrame = "relative"


DEFAULT_OUTPUTS = PlanOutputs()


@limit_blas_threads
def plan(path: Path, progress: Progress = silent) -> tuple[FlightPlanned, Scenario]:
    """Plan a flight and its reference lines.

    Also return the scenario in which it is flown as planned.

    Parameters
    ----------
    path
        A scenario with a section `plan`.
    progress
        Shows long loops.

    Raises
    ------
    InputError
        Names file, line and key of the fault, or the reason why no plan is possible.
    """
    scenario, document = read_scenario_document(path)
    asked = read_scene(scenario, document.path)
    try:
        planned = make_plan(scenario, asked, progress)
    except GeometryError as fault:
        raise InputError(document.path, f"plan: {fault}", document.line_of(("plan",))) from fault
    return planned, make_flown_scenario(scenario, asked, planned)


def write_outputs(
    planned: FlightPlanned,
    as_flown: Scenario,
    folder: Path,
    source: Path,
    made: PlanOutputs = DEFAULT_OUTPUTS,
) -> tuple[str, ...]:
    """Write all files of a plan at once; return their names.

    Missions are only written where the plan is georeferenced; those of an earlier plan in the
    folder are removed.

    Parameters
    ----------
    planned, as_flown
        The plan, and the scenario that flies it.
    folder
        Output folder.
    source
        Input file that must not be overwritten.
    made
        Options.

    Raises
    ------
    OutputError
        The folder cannot be written.
    UavgramError
        A PDF is requested, but the program for it is missing.
    """
    if made.pdf is not None:
        weasyprint_for(SHEET)
    mission = flight_mission(planned, made.autopilot, made.heights)
    layers, sheet = plan_layers(planned), field_sheet(planned, made.units)
    with stage_output(folder, [source]) as hidden:
        replace_text(hidden / SHEET_FILE, sheet)
        if made.pdf is not None:
            replace_bytes(hidden / f"{SHEET}.pdf", field_sheet_pdf(sheet, made.pdf))
        write_layers_geojson(layers, hidden / "plan.geojson")
        write_kml(layers, hidden / "plan.kml", LOOKS)
        if make_no_site_message().code not in {message.code for message in planned.messages}:
            if made.autopilot == "ardupilot":
                replace_text(hidden / "mission.waypoints", waypoints_text(mission))
            replace_text(hidden / "mission.plan", qgc_plan_text(mission))
        write_plan_recording(planned, hidden / "plan.rrd", made.units)
        write_plan(planned, hidden / PLAN_FILE)
        remark = "The planned survey: `uavgram simulate` repeats it against known truth."
        replace_text(hidden / "scenario.yaml", format_scenario(as_flown, remark))
        written = {one.name for one in hidden.iterdir()}
    with convert_output_errors(folder):
        for name in (
            MISSION_FILES - written
        ):  # an earlier plan's, which must not be flown by mistake
            (folder / name).unlink(missing_ok=True)
    return tuple(sorted(written))
