"""Template of a new project file with comments, and changes of single settings."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import yaml

_PLAIN = re.compile(r"[A-Za-z][\w./-]*(?: [\w./-]+)*")
_OTHER_MEANINGS = {"yes", "no", "on", "off", "true", "false", "null", "none", "y", "n"}

Scalar = str | float | None
Settings = Mapping[str, "Scalar | Sequence[str] | Mapping[str, Scalar]"]
"""New values by key, or for a section by the keys in it."""

_LIST = r"""\[(?:"(?:\\.|[^"\\\n])*"|[^"\[\]\n])*\]"""
_VALUE = rf"""(?:"[^"\n]*"|'[^'\n]*'|\{{[^{{}}\n]*\}}|{_LIST}|[^\s#"'|>&*!\[{{][^#\n]*?)"""
_END = r"(?P<end>[ \t]*(?:[ \t]\#.*)?\r?)$"
_HEAD = rf"(?:\#[ ]?)?KEY:(?:[ \t]+(?P<value>{_VALUE}))?{_END}"
"""Pattern of a key of the file, or of the template's comment for it."""

_INNER = rf"(?P<indent>\#[ ]+|[ ]+)KEY:(?:[ \t]+(?P<value>{_VALUE}))?{_END}"
"""Pattern of a key of a section, or of the template's comment for it."""


@dataclass(frozen=True, kw_only=True)
class AssumedOrigin:
    """Assumed origin on the ground: WGS 84 degrees, height with sigma and datum."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    height_sigma_m: float
    datum: str


@dataclass(frozen=True, kw_only=True)
class ProjectText:
    """Values of a new project file; paths are relative to it, in the form of YAML's patterns.

    Attributes
    ----------
    name
        Name of the project.
    images
        Patterns.
    camera
        A file, ``auto``, or ``unknown``.
    log, poses
        At most one of them; None where there is none.
    tables
        Files of picks, lines, measure, and, where there are some, control and check.
    leave_out
        Names of photos among `images` that take no part.
    offset_s
        Camera clock minus UTC [s]; None: from the log's camera events.
    origin
        Position and height of the ground, where neither log nor poses state them.
    name_format
        Pattern of the times in the photos' names; None: EXIF states them.
    """

    name: str
    images: Sequence[str]
    camera: str
    log: str | None
    poses: str | None
    tables: Mapping[str, str]
    leave_out: Sequence[str] = ()
    offset_s: float | None = None
    origin: AssumedOrigin | None = None
    name_format: str | None = None


_COMMENTS = {
    "images": "a pattern, or a list of patterns",
    "leave_out": "photos of these that take no part, nor do their picks",
    "camera": "a camera file; auto: from the photos' tags; unknown: any drone's",
    "log": "the flight log: ArduPilot .bin, .log or .tlog, PX4 .ulg",
    "poses": "poses of the photos, where there is no log: exif, or a file",
    "picks": "picked pixels: `uavgram pick` fills it",
    "lines": "known lengths on the ground",
    "known": "other known values: angles, heights, right angles, points in line",
    "measure": "what to measure",
    "control": "points with known coordinates, used as observations",
    "control_lines": "lines of known position (kerbs, edges of a map), used as observations",
    "check": "points with known coordinates, used only to judge the result",
    "ties": "tie points between photos; auto: found where the file is missing",
    "plan": "the plan: `uavgram pick` lists the lines to mark",
}
_EXAMPLES = {
    "leave_out": "[IMG_0007.JPG]",
    "log": "flight.BIN",
    "known": "known.csv",
    "control": "control.csv",
    "control_lines": "control_lines.csv",
    "check": "check.csv",
    "ties": "auto",
    "plan": "plan.json",
}
_WIDTH = 34

_OPTIONS_HEAD = """
# What follows are the defaults that matter most; take the # off where yours differ.
"""
_OPTIONS = {
    "units": """\
# units: metric                    # what you read: metric (m, km/h), imperial (ft and in, mph),
#                                  # or such as {length: ft, speed: mph}; files keep metres
""",
    "case": """\
# case:                            # the head of the report
#   number: ""
#   title: ""
#   place: ""
#   date: ""
#   agency: ""
""",
    "world": """\
# world:
#   heights: msl                   # datum of heights in files: msl (mean sea level) or ellipsoid
""",
    "ground": """\
# ground:
#   height_m: 0.0                  # of the ground above the place of take-off
#   height_sigma_m: 0.3            # how well that is known
#   slope_sigma_deg: 3.0           # the ground is level up to this
""",
    "mount": """\
# mount:
#   gimbal: auto                   # auto: the log's gimbal angles where it has some; none: fixed
#   pitch_deg: auto                # -90 looks straight down, 0 forward, against tags and log;
#                                  # auto: from tags or log, and -90 without them
""",
    "tape": """\
# tape:
#   reading_sigma_m: 0.01          # of a length without its own sigma: the page proposes it
#   scale_sigma: 0.001             # common error of all lengths of one tape, as a share
""",
    "time": """\
# time:
#   offset_s: auto                 # camera clock minus UTC; auto: from the log's camera events
""",
}


def project_text(project: ProjectText) -> str:
    """Return the project file: every key has a comment, and unused keys are commented out."""
    images = [_scalar(pattern) for pattern in project.images]
    values: dict[str, str | None] = {
        "name": _scalar(project.name),
        "images": images[0] if len(images) == 1 else _yaml(project.images),
        "leave_out": _yaml(project.leave_out) if project.leave_out else None,
        "camera": _scalar(project.camera),
        "log": project.log and _scalar(project.log),
        "poses": project.poses and _scalar(project.poses),
        **dict.fromkeys(("picks", "lines", "known", "measure", "control")),
        **dict.fromkeys(("control_lines", "check", "ties", "plan")),
        **{key: _scalar(path) for key, path in project.tables.items()},
        "output": "out",
    }
    lines = ["# A project: which files, and how they were made. Paths are relative to this file."]
    for key, value in values.items():
        comment = _COMMENTS.get(key, "")
        if value is None and key == "poses" and project.log is not None:
            continue
        text = f"# {key}: {_EXAMPLES.get(key, 'exif')}" if value is None else f"{key}: {value}"
        lines.append(f"{text.ljust(_WIDTH)} # {comment}" if comment else text)
    text = "\n".join(lines) + "\n"
    options = dict(_OPTIONS)
    if project.origin is not None:
        options |= _origin_options(project.origin)
    if times := _time_lines(project):
        options["time"] = "\n".join(("time:", *times)) + "\n"
    return text + _OPTIONS_HEAD + "".join(options.values())


def _origin_options(origin: AssumedOrigin) -> dict[str, str]:
    place = f"{{latitude_deg: {origin.latitude_deg:.7f}, longitude_deg: {origin.longitude_deg:.7f}"
    return {
        "world": f"world:\n  origin: {place}, height_m: {origin.height_m:.1f}}}\n"
        f"  heights: {origin.datum:<23} # datum of heights in files: msl (mean sea level) or "
        "ellipsoid\n",
        "ground": "ground:\n"
        "  height_m: 0.0                    # of the ground above that origin\n"
        f"  height_sigma_m: {origin.height_sigma_m:<16.1f} # how well that is known\n"
        "#   slope_sigma_deg: 3.0           # the ground is level up to this\n",
    }


def _time_lines(project: ProjectText) -> list[str]:
    lines = []
    if project.name_format is not None:
        lines += [
            "  source: filename".ljust(_WIDTH) + " # the photos' names are their times",
            f"  filename_format: {json.dumps(project.name_format, ensure_ascii=False)}",
        ]
    if project.offset_s is not None:
        text = f"  offset_s: {project.offset_s!r}"
        lines.append(text.ljust(_WIDTH) + " # camera clock minus UTC")
    return lines


def apply_settings(text: str, settings: Settings) -> str | None:
    """Set values in a project file; comments and everything else stay unchanged.

    If the file has a key, or the template's comment for it, its line is changed in place. A missing
    key is added below the head of its section, and a missing section at the end.

    Parameters
    ----------
    text
        The project file.
    settings
        Values to set.

    Returns
    -------
    The new text; None where the file is written in a way in which no line can be changed alone.
    """
    is_windows = text.count("\r\n") == text.count("\n") > 0
    lines = (text.replace("\r\n", "\n") if is_windows else text).split("\n")
    for key, value in settings.items():
        if isinstance(value, Mapping):
            _set_section(lines, key, value)
        else:
            _set_value(lines, key, value)
    changed = "\n".join(lines)
    changed = changed.replace("\n", "\r\n") if is_windows else changed
    return (
        changed
        if _parse_mapping(changed) == _merge_settings(_parse_mapping(text), settings)
        else None
    )


def _set_value(lines: list[str], key: str, value: Scalar | Sequence[str]) -> None:
    at, head = _find(lines, _HEAD, key)
    if head is None:
        _append(lines, setting_text(key, value))
        return
    if not head["value"] and not lines[at].startswith("#"):  # a list, one item a line below
        while at + 1 < len(lines) and re.match(r"[ ]*- ", lines[at + 1]):
            del lines[at + 1]
    lines[at] = f"{setting_text(key, value)}{head['end']}"


def _set_section(lines: list[str], key: str, values: Mapping[str, Scalar]) -> None:
    at, head = _find(lines, _HEAD, key)
    if head is None:
        _append(lines, f"{key}:", *(f"  {name}: {_yaml(value)}" for name, value in values.items()))
        return
    if head["value"]:  # {a: 1, b: 2} on one line
        inside = yaml.safe_load(head["value"])
        flow = {**(inside if isinstance(inside, dict) else {}), **values}
        text = ", ".join(f"{name}: {_yaml(value)}" for name, value in flow.items())
        lines[at] = f"{key}: {{{text}}}{head['end']}"
        return
    lines[at] = f"{key}:{head['end']}"
    end = next((k for k in range(at + 1, len(lines)) if not _is_inside(lines[k])), len(lines))
    indents = (re.match(r" +(?=\S)", line) for line in lines[at + 1 : end])
    usual = next((one[0] for one in indents if one), "  ")
    for name, value in reversed(list(values.items())):
        below, found = _find(lines[at + 1 : end], _INNER, name)
        if found is None:
            lines.insert(at + 1, f"{usual}{name}: {_yaml(value)}")
            end += 1
        else:
            indent = usual if found["indent"].startswith("#") else found["indent"]
            lines[at + 1 + below] = f"{indent}{name}: {_yaml(value)}{found['end']}"


def _append(lines: list[str], *added: str) -> None:
    """Add a key at the end of a file, unless it exists in a form that no line can replace."""
    if not any(line.startswith(added[0].partition(":")[0] + ":") for line in lines):
        at = len(lines) - (lines[-1] == "")
        lines[at:at] = added


def _find(lines: Sequence[str], pattern: str, key: str) -> tuple[int, re.Match[str] | None]:
    """Find the line of a key; a comment for it only where there is no other line."""
    form = re.compile(pattern.replace("KEY", re.escape(key)))
    found = [(k, match) for k, line in enumerate(lines) if (match := form.match(line))]
    found.sort(key=lambda one: lines[one[0]].startswith("#"))
    return found[0] if found else (0, None)


def _is_inside(line: str) -> bool:
    """Return whether a line belongs to the section above it: indented, or a template comment."""
    return line.startswith((" ", "#  "))


def setting_text(key: str, value: Scalar | Sequence[str]) -> str:
    """Return a line of the project file that sets a key."""
    return f"{key}: {_yaml(value)}"


def _yaml(value: Scalar | Sequence[str]) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_scalar, value))}]"
    return _scalar(value) if isinstance(value, str) else json.dumps(value)


def _parse_mapping(text: str) -> dict[str, object]:
    try:
        said = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def _merge_settings(said: dict[str, object], settings: Settings) -> dict[str, object]:
    """Return the expected content of a file after the settings are applied."""
    merged = dict(said)
    for key, value in settings.items():
        before = merged.get(key)
        inside = before if isinstance(before, dict) else {}
        if isinstance(value, Mapping):
            merged[key] = {**inside, **value}
        else:
            merged[key] = value if value is None or isinstance(value, str | float) else [*value]
    return merged


def _scalar(text: str) -> str:
    """Return a YAML scalar, in double quotes (as in JSON) where it is ambiguous."""
    if _PLAIN.fullmatch(text.replace("*", "x")) and not text.startswith("*"):
        return json.dumps(text) if text.lower() in _OTHER_MEANINGS else text
    return json.dumps(text, ensure_ascii=False)
