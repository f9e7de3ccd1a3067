"""Command `uavgram plan`: a scenario in, a plan, its files and its flown scenario out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from uavgram.errors import GeometryError, InputError
from uavgram.io.exports.geojson import write_layers_geojson
from uavgram.io.exports.kml import write_kml
from uavgram.io.exports.missions import qgc_plan_text, waypoints_text
from uavgram.io.outputs import as_output_errors, replace_bytes, replace_text, staged_output
from uavgram.io.results.plan_json import write_plan
from uavgram.model.maps import Autopilot, HeightFrame, Paper
from uavgram.model.naming import METRIC, Units
from uavgram.model.planned import FlightPlanned
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.products.mission import flight_mission
from uavgram.stages.products.planned_layers import plan_layers
from uavgram.synthetic.accident_scene import SceneLine, ScenePoint
from uavgram.synthetic.plan.make import make_no_site_message, make_plan
from uavgram.synthetic.plan.scene import Asked, read_scene
from uavgram.synthetic.plan.wanted import list_wanted
from uavgram.synthetic.scenario import FlightPlan, Scenario, Site, Station
from uavgram.synthetic.scenario_file import format_scenario, read_scenario_document
from uavgram.views.field_sheet import NAME as SHEET
from uavgram.views.field_sheet import field_sheet, field_sheet_pdf
from uavgram.views.flight_plan_recording import write_plan_recording
from uavgram.views.map_styles import LOOKS
from uavgram.views.pages_pdf import weasyprint_for


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


@with_one_blas_thread
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
    with staged_output(folder, [source]) as hidden:
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
    with as_output_errors(folder):
        for name in (
            MISSION_FILES - written
        ):  # an earlier plan's, which must not be flown by mistake
            (folder / name).unlink(missing_ok=True)
    return tuple(sorted(written))
