"""The project file of a simulated survey, as a person would write it."""

from __future__ import annotations

from uavgram.model.scenario.errors import StatedSpec
from uavgram.model.scenario.plates import FAMILY
from uavgram.model.scenario.scenario import Scenario
from uavgram.model.scenario.simulated import SimulatedSurvey
from uavgram.model.typed_numbers import number_text

_Value = str | float | tuple[float, ...]


def project_yaml(survey: SimulatedSurvey) -> str:
    """Give the project file; its first line says what it is.

    Parameters
    ----------
    survey
        Whose scenario it states.
    """
    errors, stated = survey.scenario.errors, survey.scenario.stated
    arm = ", ".join(number_text(v) for v in errors.lever_arm_m)
    height = number_text(stated.ground_height_sigma_m)
    beside = number_text(stated.picks_identification_sigma_m)
    rough = number_text(stated.roughness_sigma_m)
    text = f"""\
# A simulated survey of a road accident; truth.json says what really was.
name: {survey.scenario.name}
images: photos/*.jpg
log: flight.tlog
camera: camera.yaml
picks: picks.csv
lines: lines.csv           # taped lengths; the one of use "check" is withheld
measure: measure.csv
check: check.csv           # surveyed points, only to judge the result
output: out
ground:
  height_sigma_m: {height}      # the scene lies a little below the place of take-off
  roughness_sigma_m: {rough}     # it is a plane; leave this out for a road
mount:
  gimbal: auto             # the log has the gimbal's attitude
  boresight_sigma_deg: {number_text(stated.boresight_sigma_deg)}
  lever_arm_m: [{arm}]
  lever_arm_sigma_m: {number_text(stated.lever_arm_sigma_m)}
time:
  offset_s: auto           # the camera's clock is wrong; the log's camera events tell by how much
  offset_sigma_s: {number_text(stated.clock_sigma_s)}
picks_sigma_px: {number_text(errors.pick_px)}
picks_identification_sigma_m: {beside}  # nothing is picked beside; leave this out for photos
"""
    return _as_the_scenario(text, survey.scenario)


def _as_the_scenario(text: str, scenario: Scenario) -> str:
    """The demo's project with what another scenario has other than it."""
    stated, usual, errors = scenario.stated, StatedSpec(), scenario.errors
    if scenario.telemetry == "none":
        text = text.replace("log: flight.tlog\n", "")
    if not scenario.flight.tells_clock:
        told = number_text(errors.camera_clock_offset_s)
        lines = text.splitlines()
        at = next(i for i, line in enumerate(lines) if line.startswith("  offset_s: "))
        lines[at] = f"  offset_s: {told}            # camera clock minus UTC"
        text = "\n".join([*lines, ""])
    if scenario.plates.at:
        side, sigma = map(number_text, (scenario.plates.side_m, scenario.plates.sigma_m))
        text += f"targets: {{family: {FAMILY}, side_m: {side}, sigma_m: {sigma}}}\n"
    if scenario.control:
        text = text.replace("check: check.csv", "control: control.csv\ncheck: check.csv")
    inner: dict[str, dict[str, tuple[_Value, _Value]]] = {
        "ground": {
            "slope_sigma_deg": (stated.ground_slope_sigma_deg, usual.ground_slope_sigma_deg),
        },
        "telemetry": {
            "position_sigma_m": (stated.position_sigma_m, usual.position_sigma_m),
            "attitude_sigma_deg": (stated.attitude_sigma_deg, usual.attitude_sigma_deg),
            "position_bias_sigma_m": (stated.position_bias_sigma_m, usual.position_bias_sigma_m),
            "heading_bias_sigma_deg": (
                stated.heading_bias_sigma_deg,
                usual.heading_bias_sigma_deg,
            ),
        },
        "tape": {"scale_sigma": (stated.tape_scale_sigma, usual.tape_scale_sigma)},
        "solve": {
            "outliers": (stated.outliers, usual.outliers),
            "noise": (stated.noise, usual.noise),
        },
    }
    for section, keys in inner.items():
        rows = [f"  {key}: {_yaml(own)}" for key, (own, other) in keys.items() if own != other]
        if rows and f"{section}:\n" in text:
            text = text.replace(f"{section}:\n", "\n".join([f"{section}:", *rows, ""]))
        elif rows:
            text += "\n".join([f"{section}:", *rows, ""])
    return text


def _yaml(value: _Value) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(number_text, value))}]"
    return value if isinstance(value, str) else number_text(value)
